# SPDX-License-Identifier: Apache-2.0
"""stability.py: which gains no loop bears, tried on rigid joints."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rig import MOTOR, board_config, joint

from control_board_ros.core.config.config import Impedance, Pid
from control_board_ros.settings.loading import load
from control_board_ros.settings.stability import bounds, filters, loops, warnings

GOOD = Pid(kp=400.0, ki=400.0, kd=40.0, integral_limit=20.0, derivative_cutoff=100.0)


def fastest(kp: float, ki: float, kd: float, inertia: float, period: float) -> float:
    """Growth of a rigid joint under a PID that is held for a period, 1/s; negative: it settles."""
    step = np.array([[1.0, period, 0.0], [0.0, 1.0, 0.0], [period, 0.0, 1.0]])
    acts = np.array([[0.5 * period**2], [period], [0.0]]) / inertia
    radius = np.abs(np.linalg.eigvals(step - acts @ np.array([[kp, kd, ki]]))).max()
    return math.log(radius) / period


@pytest.mark.parametrize("rate", [200.0, 500.0, 1000.0, 4000.0])
@pytest.mark.parametrize("inertia", [1e-3, 1.0, 30.0])
def test_the_bounds_are_those_of_a_rigid_joint(rate: float, inertia: float) -> None:
    """Somewhat below each bound it settles, or grows no faster than friction holds; above not."""
    period = 1.0 / rate
    one = joint("a", inertia_min=inertia, inertia_mean=inertia, inertia_max=inertia)
    limit = bounds(one, period)["position_pid.kd"][1]
    assert fastest(0.0, 0.0, 0.9 * limit, inertia, period) < 1e-6
    assert fastest(0.0, 0.0, 1.1 * limit, inertia, period) > 10.0
    for share in (0.0, 0.1, 0.5):
        own = replace(one, position_pid=replace(GOOD, kd=share * limit))
        kp = bounds(own, period)["position_pid.kp"][1]
        assert fastest(0.8 * kp, 0.0, share * limit, inertia, period) < 10.0
        assert fastest(1.5 * kp, 0.0, share * limit, inertia, period) > 4.0


def config(**changes: float):
    return board_config(joint("a", position_pid=replace(GOOD, **changes)), control_rate=1000.0)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"kp": 1e12}, "a.position_pid.kp: 1e+12 makes the loop unstable at 1000 Hz"),
        ({"ki": 1e12}, "a.position_pid.ki"),
        ({"kd": 1e12}, "a.position_pid.kd"),
        ({"kff": 1e12}, "a.position_pid.kff"),
        (
            {"derivative_cutoff": 1e-12},
            "a.position_pid.derivative_cutoff: 1e-12 Hz leaves no rate",
        ),
        ({"derivative_cutoff": 1e9}, "a.position_pid.derivative_cutoff"),
        ({"integral_limit": math.inf}, "a.position_pid.integral_limit: inf bounds nothing"),
    ],
)
def test_implausible_values_are_named(changes: dict[str, float], expected: str) -> None:
    """One line of the parameter, with what would be right; of nothing else."""
    assert warnings(config()) == {}
    [(name, text)] = warnings(config(**changes)).items()
    assert name == f"a.position_pid.{next(iter(changes))}"
    assert text.startswith(expected)


@pytest.mark.parametrize("robot", ["iiwa", "panda", "icub"])
@pytest.mark.parametrize("rate", [200.0, 1000.0, 4000.0])
def test_the_gains_of_the_robots_in_the_box_are_borne(robot: str, rate: float) -> None:
    assert warnings(load(robot, {"control_rate": rate}).board) == {}


def test_a_file_with_such_a_gain_is_warned_of_when_it_is_loaded() -> None:
    settings = load("iiwa", {"lbr_iiwa_joint_1.position_pid.kd": 1e9})
    assert any("lbr_iiwa_joint_1.position_pid.kd: 1e+09" in text for text in settings.warnings)


def test_the_bounds_by_hand() -> None:
    """J_min 2, J_max 8 kg·m², T = 0.01 s; R = 2 Ω, L = 0.02 H: a = e⁻¹."""
    pid = Pid(kp=100.0, ki=10.0, kd=40.0, kff=1.0)
    torque = Pid(kp=0.1, ki=0.2, kd=0.3, kff=0.4)
    one = joint(
        "a",
        inertia_min=2.0,
        inertia_mean=4.0,
        inertia_max=8.0,
        position_pid=pid,
        torque_pid=torque,
        current_pid=Pid(kp=0.7, ki=9.0),
        motor=replace(MOTOR, resistance=2.0, inductance=0.02),
        impedance=Impedance(stiffness=0.0, damping=0.0, max_stiffness=50.0, max_damping=5.0),
    )
    most_kp = (2.0 * 40.0 + 4.0 * 10.0 * 2.0) / 0.01
    current = 2.0 * (1.0 + math.exp(-1.0)) / (1.0 - math.exp(-1.0))
    expected = {
        "impedance.max_damping": (5.0, 400.0),
        "impedance.max_stiffness": (50.0, 80000.0),
        "position_pid.kp": (100.0, most_kp),
        "position_pid.ki": (10.0, 100.0 * (40.0 / 8.0 + 20.0)),
        "position_pid.kd": (40.0, 400.0),
        "position_pid.kff": (1.0, most_kp),
        "torque_pid.kp": (0.1, 2.0),
        "torque_pid.ki": (0.2, 200.0),
        "torque_pid.kd": (0.3, 0.02),
        "torque_pid.kff": (0.4, 10.0),
        "current_pid.kp": (0.7, current),
        "current_pid.ki": (9.0, current / 0.01),
    }
    found = bounds(one, 0.01)
    assert list(found) == list(expected)
    for name, (value, most) in expected.items():
        assert found[name] == (value, pytest.approx(most)), name
    faster = replace(one, direct_pid=replace(pid, kp=1e6, kd=500.0))
    found = bounds(faster, 0.01)
    most_kp = (2.0 * 400.0 + 80.0) / 0.01
    assert found["direct_pid.kp"] == (1e6, pytest.approx(most_kp))
    assert found["direct_pid.ki"][1] == pytest.approx(most_kp * (400.0 / 8.0 + 20.0))
    assert loops(faster)["direct_pid"] is faster.direct_pid
    assert list(loops(one)) == ["position_pid", "torque_pid"]


def test_a_winding_without_lag_bears_any_current_gain() -> None:
    """Its a is 1 to within rounding, and nothing is divided by 0."""
    slow = joint("a", motor=replace(MOTOR, resistance=1e-9, inductance=1.0))
    assert bounds(slow, 1e-3)["current_pid.kp"][1] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("pid", "rate", "names"),
    [
        (Pid(kp=0.0, kd=1.0, derivative_cutoff=0.1), 1000.0, []),
        (Pid(kp=0.0, kd=1.0, derivative_cutoff=0.099), 1000.0, ["derivative_cutoff"]),
        (Pid(kp=0.0, kd=1.0, derivative_cutoff=500.0), 1000.0, []),
        (Pid(kp=0.0, kd=1.0, derivative_cutoff=501.0), 1000.0, ["derivative_cutoff"]),
        (Pid(kp=0.0, kd=1.0, derivative_cutoff=400.0), 200.0, []),
        (Pid(kp=0.0, kd=1.0, derivative_cutoff=401.0), 200.0, ["derivative_cutoff"]),
        (Pid(kp=0.0, kd=0.0, derivative_cutoff=501.0), 1000.0, []),
        (Pid(kp=0.0, ki=1.0, integral_limit=50.0), 1000.0, []),
        (Pid(kp=0.0, ki=1.0, integral_limit=50.1), 1000.0, ["integral_limit"]),
        (Pid(kp=0.0, ki=0.0, integral_limit=50.1), 1000.0, []),
    ],
)
def test_filters_and_integrals_that_do_nothing(pid: Pid, rate: float, names: list[str]) -> None:
    """Of a joint of 5 N·m: both ends are allowed, and what is not used is not judged."""
    assert list(filters(pid, 5.0, rate)) == names

# SPDX-License-Identifier: Apache-2.0
"""stability.py: which gains no loop bears, tried on rigid joints."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rig import board_config, joint

from control_board_ros.core.config.config import Pid
from control_board_ros.core.config.stability import bounds, warnings
from control_board_ros.settings.loading import load

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
    ("changes", "told"),
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
def test_what_cannot_be_meant_is_named(changes: dict[str, float], told: str) -> None:
    """One line of the parameter, with what would be right; of nothing else."""
    assert warnings(config()) == {}
    [(name, text)] = warnings(config(**changes)).items()
    assert name == f"a.position_pid.{next(iter(changes))}"
    assert text.startswith(told)


@pytest.mark.parametrize("robot", ["iiwa", "panda", "icub"])
@pytest.mark.parametrize("rate", [200.0, 1000.0, 4000.0])
def test_the_gains_of_the_robots_in_the_box_are_borne(robot: str, rate: float) -> None:
    assert warnings(load(robot, {"control_rate": rate}).board) == {}


def test_a_file_with_such_a_gain_is_warned_of_when_it_is_loaded() -> None:
    settings = load("iiwa", {"lbr_iiwa_joint_1.position_pid.kd": 1e9})
    assert any("lbr_iiwa_joint_1.position_pid.kd: 1e+09" in text for text in settings.warnings)

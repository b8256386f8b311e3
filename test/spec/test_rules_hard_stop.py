# SPDX-License-Identifier: Apache-2.0
"""SPEC K6: a hard stop counts when it is confirmed; what only looks like one is a fault."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rig import LIMITS, M, Rig, board_config, joint, simulation_config, truth

from control_board_ros.core.config.config import BoardConfig, Calibration, ConfigError, Pid
from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.measurement import Array
from control_board_ros.sim.bodies.ideal import IdealBody
from control_board_ros.sim.config import SimulationConfig
from control_board_ros.sim.plant import SimulatedPlant

#: -4 % give 9.6 N·m at a stall, and 14.4 N·m in the push.
STOP = Calibration(type=5, output=-4.0, stop=-2.2, start=0.2, speed=1.0, timeout=20.0)
TORQUE = 9.6

#: Torque that acts on the joint besides its motor: of torque (N·m), position and velocity.
Load = Callable[[float, float, float], float]


class LoadedBody(IdealBody):
    """The ideal body with a load on its first joint."""

    load: Load

    def step(self, torque: Array) -> bool:
        loaded = torque.copy()
        position, velocity = float(self._position[0]), float(self._velocity[0])
        loaded[0] += self.load(float(torque[0]), position, velocity)
        return super().step(loaded)


def loaded(config: BoardConfig, simulation: SimulationConfig, load: Load) -> Rig:
    body = LoadedBody.of_board(config, simulation)
    body.load = load
    return Rig(config, SimulatedPlant(config, simulation, body))


def rig_with(
    load: Load = lambda torque, position, velocity: 0.0,
    calibration: Calibration = STOP,
    **changes: Any,
) -> Rig:
    """A joint at 0.5 rad whose encoder reads 0.7 more, with a load; it must calibrate."""
    config = board_config(joint("left", calibration=calibration, **changes))
    simulation = simulation_config(config, home=[0.5], zero=[0.7])
    return loaded(config, simulation, load)


def calibrate(rig: Rig) -> str:
    """Run the calibration to its end; the text of the fault, or nothing."""
    rig.tick(2)
    while rig.modes() == [M.CALIBRATING]:
        rig.tick(10)
    if rig.modes() == [M.HW_FAULT]:
        assert not rig.board.get_calibration("left")[0].calibrated
        text = rig.board.get_faults("left")[0].text
        assert text.startswith("calibration failed, ")
        return text
    assert rig.board.get_calibration("left")[0].done
    return ""


def held_by(most: float, at: float) -> Load:
    """A tight spot: beyond a place, a torque up to a threshold, N·m, moves nothing."""

    def load(torque: float, position: float, velocity: float) -> float:
        if position > at:
            return 0.0
        if abs(torque) <= most:
            return -torque - 200.0 * velocity
        return -float(np.copysign(most, torque))

    return load


def test_the_phases_of_a_hard_stop() -> None:
    """K6, K5: driven to the stop, back, to it again, pushed by half as much more, to the start."""
    rig = rig_with(calibration=replace(STOP, output=3.0, stop=2.2))
    phases: dict[str, list[float]] = {}
    rig.tick(2)
    while rig.modes() == [M.CALIBRATING]:
        shown = rig.tick()
        status = rig.board.get_calibration("left")[0]
        phases.setdefault(status.phase, []).append(float(shown.output[0]))
    assert list(phases) == [
        "driving to the hard stop",
        "backing off the stop",
        "approaching the stop again",
        "pushing against the stop",
        "moving to the start position",
        "done",
    ]
    assert set(phases["driving to the hard stop"][:-1]) == {3.0}
    assert set(phases["approaching the stop again"][:-1]) == {3.0}
    assert set(phases["pushing against the stop"][:-1]) == {4.5}
    shown = rig.run(0.5)
    assert shown.position[0] == pytest.approx(truth(rig), abs=1e-3)
    assert truth(rig) == pytest.approx(0.2, abs=0.02)


def test_an_elastic_stop_is_one() -> None:
    """K6: a stop that gives way by less than 5 mrad counts; the error is what the drive bends."""
    rig = rig_with(lambda _, q, dq: 4000.0 * max(-2.19 - q, 0.0) - 20.0 * dq * (q < -2.19))
    assert calibrate(rig) == ""
    shown = rig.run(0.5)
    assert abs(shown.position[0] - truth(rig)) == pytest.approx(0.01 - TORQUE / 4000.0, abs=1e-3)


@pytest.mark.parametrize(
    ("load", "why"),
    [
        (lambda _, q, dq: -20.0 * np.sin(q) - 5.0 * dq, "then moved by"),  # a pendulum, lifted
        (lambda _, q, dq: -100.0 * (q + 0.5) - 20.0 * dq, "then moved by"),  # a spring
        (held_by(12.0, at=-1.0), "then moved by"),  # a tight spot
        pytest.param(
            held_by(20.0, at=3.0),
            "on the second approach",
            marks=pytest.mark.fresh("a slower loop does not come back: another reason"),
        ),  # friction
        (lambda _, q, dq: 30.0 - 20.0 * dq, "against the output of -4 %"),  # pulled away
    ],
    ids=["pendulum", "spring", "tight spot", "friction", "load"],
)
def test_a_stall_in_mid_air_is_no_stop(load: Load, why: str) -> None:
    """K6, K4: held by a load or by friction: a fault with the reason, and what to do."""
    text = calibrate(rig_with(load))
    assert why in text
    assert "raise calibration.output" in text


@pytest.mark.parametrize("output", [-0.1, -0.3, -0.6, -1.0, -2.0, -4.0, -8.0])
@pytest.mark.parametrize("weight", [0.5, 2.0, 8.0, 20.0])
def test_no_output_finds_a_wrong_stop(output: float, weight: float) -> None:
    """K6, K4: however weak the drive is against the load: the true angle, or a fault."""
    rig = rig_with(
        lambda _, q, dq: weight * np.cos(q) - 2.0 * dq,
        replace(STOP, output=output, timeout=12.0),
        limits={"peak_current": 60.0},
    )
    if calibrate(rig) == "":
        assert rig.run(0.5).position[0] == pytest.approx(truth(rig), abs=2e-3)
    else:
        assert rig.modes() == [M.HW_FAULT]
        assert rig.tick().output[0] == 0.0


def test_a_strong_output_finds_the_stop() -> None:
    """K6, K5: the search above ends in a calibration where the drive carries the load."""
    rig = rig_with(lambda _, q, dq: 0.5 * np.cos(q) - 2.0 * dq, replace(STOP, output=-4.0))
    assert calibrate(rig) == ""
    assert rig.run(0.5).position[0] == pytest.approx(truth(rig), abs=2e-3)


def test_a_joint_that_does_not_come_back() -> None:
    """K6, K4: it must be able to move the other way."""
    text = calibrate(rig_with(held_by(1e9, at=-2.0)))
    assert "does not move in the other direction" in text


def test_a_stop_that_is_missing() -> None:
    """K6, K4: the way is not longer than the joint's range."""
    rig = rig_with()
    rig.plant.body._lower[0] = -100.0
    text = calibrate(rig)
    assert "no stop within" in text
    assert "the hard range being 4.4 rad" in text


def test_a_stop_at_the_wrong_end() -> None:
    """K6, K4: with that stop the joint would have begun outside its range."""
    text = calibrate(rig_with(calibration=replace(STOP, stop=2.2)))
    assert "would have started at 4.9 rad" in text
    assert "sign of calibration.output" in text


# --- sliding joints --------------------------------------------------------------------------

FINGER = Calibration(type=5, output=-4.0, stop=0.0, start=0.03, speed=0.05, timeout=20.0)
SLIDE = {"lower": 0.001, "upper": 0.039, "hard_lower": 0.0, "hard_upper": 0.04}


def finger(load: Load, calibration: Calibration = FINGER) -> Rig:
    """A sliding joint with 40 mm of way, at 20 mm; its reading is 1 mm too much."""
    limits = SLIDE | {"hard_margin": 0.002, "velocity": 0.5}
    gains = Pid(kp=2e4, ki=1e5, kd=400.0, integral_limit=40.0)
    one = joint(
        "left",
        kind="prismatic",
        calibration=calibration,
        limits=limits,
        position_pid=gains,
        max_travel_error=0.01,
    )
    config = board_config(one)
    simulation = simulation_config(config, home=[0.02], zero=[0.001])
    return loaded(config, simulation, load)


def test_a_sliding_joint_finds_its_stop() -> None:
    """K6, K5: tolerances of a sliding joint are metres."""
    rig = finger(lambda _, q, dq: -5.0 * dq)
    assert calibrate(rig) == ""
    assert rig.run(0.5).position[0] == pytest.approx(truth(rig), abs=1e-5)
    assert truth(rig) == pytest.approx(0.03, abs=1e-3)


@pytest.mark.fresh("a slower loop does not come back from friction: another reason")
def test_a_sliding_joint_held_in_mid_air() -> None:
    """K6, K4: 5 mm are far for a sliding joint, however little they are in rad."""
    text = calibrate(finger(lambda _, q, dq: -5000.0 * (q - 0.015) - 60.0 * dq))
    assert "then moved by" in text
    assert " m at -6 %" in text


@pytest.mark.fresh("a slower loop does not come back from friction: another reason")
@pytest.mark.parametrize("kind", [3, 5])
def test_a_sliding_joint_blocked_before_its_start(kind: int) -> None:
    """K4, K5: 10 mm away from the start position is not there."""
    blocked = replace(FINGER, type=kind, zero=0.001, timeout=8.0)
    text = calibrate(finger(lambda _, q, dq: -1e5 * max(q - 0.02, 0.0) - 100.0 * dq, blocked))
    assert "timed out after 8 s while moving to the start position" in text


# --- K8: drives without PWM --------------------------------------------------------------------


@pytest.mark.parametrize("drive", [["torque"], ["impedance"], ["position", "velocity", "torque"]])
def test_a_hard_stop_needs_a_drive_that_pushes(drive: list[str]) -> None:
    """K8: where neither pwm nor current is accepted it is an error of the configuration."""
    kinds = tuple(SetPoint[name.upper()] for name in drive)
    with pytest.raises(ConfigError, match="a hard stop needs pwm or current") as error:
        joint("left", calibration=STOP, drive=kinds)
    assert error.value.key == "left.calibration.type"
    assert joint("left", calibration=Calibration(type=12), drive=kinds).calibration


@pytest.mark.parametrize("drive", [["current"], ["torque", "pwm"]])
def test_a_hard_stop_is_found_by_current(drive: list[str]) -> None:
    """K8, K6: with the current that the PWM would give; slower than the speed limit."""
    kinds = tuple(SetPoint[name.upper()] for name in drive)
    rig = rig_with(drive=kinds, max_travel_error=math.inf)
    fastest = 0.0
    rig.tick(2)
    while rig.modes() == [M.CALIBRATING]:
        speed = abs(float(rig.tick().velocity[0]))
        if rig.board.get_calibration("left")[0].phase.startswith("driving"):
            fastest = max(fastest, speed)
    assert rig.modes() == [M.POSITION], rig.board.get_faults("left")[0].text
    assert rig.run(0.5).position[0] == pytest.approx(truth(rig), abs=2e-3)
    assert fastest < 1.05 * LIMITS.velocity

# SPDX-License-Identifier: Apache-2.0
"""Torques from outside, without a board: what they fill in, and how long (SPEC Y5, I7)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rig import COMPLIANT, MOTOR, STIFF, M, board_config, joint, plain

from control_board_ros.core.config.config import BoardConfig, Calibration
from control_board_ros.core.config.parts import Timeouts
from control_board_ros.core.state import StateArrays
from control_board_ros.core.terms.measurement import ROWS, Measurement, Row
from control_board_ros.core.watch.external_torque import ExternalTorques, without_torque

SILENCE = 0.1
PER_AMPERE = MOTOR.torque_per_ampere


def config_of(**timeouts: float) -> BoardConfig:
    """Joints: own (a sensor), outer (its torques come from outside), bare (without a sensor)."""
    given = Timeouts(**({"torque_sensor": SILENCE} | timeouts))
    return board_config(
        joint("own"), joint("outer", external_torque=True, timeouts=given), plain("bare")
    )


class Bench:
    """Torques of three joints, read at 3 A each, where the sensor says 7 N·m."""

    def __init__(self) -> None:
        self.config = config_of()
        self.state = StateArrays(self.config.names)
        self.torques = ExternalTorques(self.config, self.state)

    def modes(self, control: M, interaction: object = STIFF) -> None:
        self.state.control_modes[1] = control
        self.state.interaction_modes[1] = interaction  # type: ignore[call-overload]

    def fill(self, time: float) -> Measurement:
        values = np.zeros((ROWS, 3))
        values[Row.CURRENT], values[Row.TORQUE], values[Row.TORQUE_AGE] = 3.0, 7.0, 0.02
        given = Measurement(time, values)
        found = self.torques.fill(given)
        assert values[Row.TORQUE].tolist() == [7.0] * 3  # the plant's own stays as it is
        assert found.time == time
        assert found.values[Row.TORQUE, ::2].tolist() == [7.0, 7.0]
        assert found.values[Row.TORQUE_AGE, ::2].tolist() == [0.02, 0.02]
        return found


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_without_a_torque_the_current_is_used(bench: Bench) -> None:
    assert bench.torques.joints == [1]
    for time in (0.0, 0.05, 5.0):
        assert bench.fill(time).values[Row.TORQUE, 1] == pytest.approx(3.0 * PER_AMPERE)
        assert bench.torques.known.tolist() == [True, False, False]


def test_a_torque_counts_for_its_timeout(bench: Bench) -> None:
    """Both ends belong to it; a stamp ahead of the reading is none."""
    bench.torques.take(1, 4.5)
    for time, known in ((0.0, True), (SILENCE, True), (0.11, False), (-0.01, False)):
        torque = bench.fill(time).values[Row.TORQUE, 1]
        assert torque == pytest.approx(4.5 if known else 3.0 * PER_AMPERE)
        assert bench.torques.known.tolist() == [True, known, False]


@pytest.mark.parametrize(
    ("control", "interaction", "ages"),
    [
        (M.TORQUE, STIFF, True),
        (M.POSITION, COMPLIANT, True),
        (M.POSITION, STIFF, False),
        (M.OPENLOOP, COMPLIANT, False),
        (M.IDLE, COMPLIANT, False),
        (M.HW_FAULT, STIFF, False),
    ],
)
def test_a_torque_ages_where_a_law_follows_it(
    bench: Bench, control: M, interaction: object, ages: bool
) -> None:
    bench.modes(control, interaction)
    bench.state.time = 2.0
    bench.torques.take(1, 4.5)
    assert bench.fill(2.5).values[Row.TORQUE_AGE, 1] == pytest.approx(0.5 if ages else 0.0)


def test_before_the_first_torque_the_age_is_a_fault_at_once(bench: Bench) -> None:
    """Longer than any timeout, though the board has just begun."""
    bench.modes(M.TORQUE)
    assert bench.fill(0.0).values[Row.TORQUE_AGE, 1] == pytest.approx(1000.0)


def test_a_joint_without_an_external_torque_implements_less(bench: Bench) -> None:
    own, outer, bare = bench.config.joints
    assert [bench.torques.joint(j) for j in (0, 2)] == [own, bare]
    assert bench.torques.joint(1) == without_torque(outer)
    bench.torques.take(1, 1.0)
    bench.fill(0.05)
    assert bench.torques.joint(1) == outer
    bench.fill(1.0)
    assert bench.torques.joint(1) == without_torque(outer)


def test_a_reconfiguration_sets_timeouts_and_keeps_the_torque(bench: Bench) -> None:
    """A live parameter, of whichever joint, refuses no mode that needs the torque."""
    bench.torques.take(1, 1.0)
    bench.fill(0.05)
    assert bench.torques.known[1]
    changed = config_of(torque_sensor=0.5)
    stronger = replace(changed.joints[1], motor=replace(MOTOR, gear_ratio=100.0))
    joints = (changed.joints[0], stronger, changed.joints[2])
    bench.torques.reconfigure(replace(changed, joints=joints))
    assert bench.torques.known.tolist() == [True, True, False]
    assert bench.torques.joint(1) == stronger
    assert bench.fill(0.4).values[Row.TORQUE, 1] == 1.0
    assert bench.torques.joint(1) == stronger
    assert bench.fill(0.6).values[Row.TORQUE, 1] == pytest.approx(2.0 * 3.0 * PER_AMPERE)


def test_without_torque_a_joint_has_neither_torque_nor_compliant() -> None:
    calibration = Calibration(type=12, control_mode=M.TORQUE, interaction_mode=COMPLIANT)
    full = joint("outer", external_torque=True, startup_interaction=COMPLIANT)
    left = without_torque(replace(full, calibration=calibration))
    assert not left.torque_sensor
    assert not left.external_torque
    assert M.TORQUE not in left.control_modes
    assert set(left.control_modes) == {*full.control_modes} - {M.TORQUE}
    assert left.interaction_modes == (STIFF,)
    assert left.startup_interaction is STIFF
    assert left.calibration is not None
    assert (left.calibration.control_mode, left.calibration.interaction_mode) == (M.IDLE, STIFF)
    assert without_torque(full).calibration is None

# SPDX-License-Identifier: Apache-2.0
"""The calibration of several joints, watched to its end (SPEC K1, K2)."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rig import Rig, board_config, joint

from control_board_ros.core.config.config import Calibration
from control_board_ros.core.goals.tasks import CalibrationTask
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.vocabs import ControlMode

OFFSET = Calibration(type=3, required=False, start=0.4, speed=1.0)


@pytest.fixture
def rig() -> Rig:
    """Of three joints in IDLE, the last has no calibrator."""
    slow = replace(OFFSET, speed=0.2)
    made = Rig(
        board_config(joint("a", calibration=OFFSET), joint("b", calibration=slow), joint("c"))
    )
    made.tick(2)
    return made


def test_it_ends_when_all_its_joints_have_calibrated(rig: Rig) -> None:
    """K1: a is done, b takes longer; no outcome yet."""
    task = CalibrationTask(rig.board, ["a", "b"])
    rig.tick()
    assert task.outcome() is None
    assert [status.running for status in task.statuses()] == [True, True]
    rig.run(1.5)
    assert [status.running for status in task.statuses()] == [False, True]
    assert task.statuses()[0].done
    assert task.outcome() is None
    rig.run(6.5)
    assert task.outcome() == (True, "")
    assert [status.progress for status in task.statuses()] == [1.0, 1.0]


def test_a_joint_that_refuses_is_reported_at_the_end(rig: Rig) -> None:
    task = CalibrationTask(rig.board, None)
    rig.run(8.0)
    outcome = task.outcome()
    assert outcome is not None
    assert not outcome.success
    assert outcome.message.startswith("c has no calibrator")
    assert rig.modes()[:2] == [ControlMode.POSITION] * 2


def test_a_calibration_no_joint_accepts_is_an_error(rig: Rig) -> None:
    with pytest.raises(RequestError, match="c has no calibrator"):
        CalibrationTask(rig.board, "c")


def test_cancelled_its_joints_are_idle(rig: Rig) -> None:
    """K2: those that it calibrates, and no others."""
    assert rig.board.set_control_mode("c", "pos")
    task = CalibrationTask(rig.board, None)
    rig.tick(5)
    assert task.cancel() == "cancelled; a, b in IDLE, not calibrated"
    rig.tick()
    assert rig.modes() == [ControlMode.IDLE, ControlMode.IDLE, ControlMode.POSITION]


def test_a_power_cycle_that_ends_it_is_the_reason(rig: Rig) -> None:
    """N1: what is not required does not begin anew."""
    task = CalibrationTask(rig.board, ["a"])
    rig.tick(5)
    rig.board.power_cycle()
    assert task.outcome() == (False, "a is not calibrated: ended by a power cycle")

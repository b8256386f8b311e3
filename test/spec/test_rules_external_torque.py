# SPDX-License-Identifier: Apache-2.0
"""Torques that another program measures (SPEC Y5, I7)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from rig import COMPLIANT, STIFF, M, Rig, board_config, joint, ready

from control_board_ros.core.config.parts import Timeouts
from control_board_ros.core.terms.reply import Reason

SILENCE = 0.1


@pytest.fixture
def rig() -> Rig:
    measured = joint("left", external_torque=True, timeouts=Timeouts(torque_sensor=SILENCE))
    return ready(board_config(measured, joint("right")))


def send_torque(rig: Rig, torque: float, seconds: float = 0.05) -> Any:
    """Tell a torque cycle by cycle."""
    shown = rig.board.snapshot()
    for _ in range(round(seconds / rig.period)):
        assert rig.board.update_torque_sensor("left", torque)
        shown = rig.tick()
    return shown


def test_without_torques_there_is_no_sensor(rig: Rig) -> None:
    """I7, Y5: TORQUE and COMPLIANT are not offered, requested they are a fault."""
    control, interaction = rig.board.get_available_modes("left")[0]
    assert M.TORQUE not in control
    assert interaction == (STIFF,)
    assert np.isnan(rig.tick().torque).tolist() == [True, False]
    assert math.isnan(rig.board.get_torque("left")[0])
    assert rig.board.set_control_mode("left", "torq").codes == (Reason.UNSUPPORTED,)
    assert rig.modes()[0] is M.HW_FAULT
    rig.enter("pos", "left")
    assert rig.board.set_interaction_mode("left", "comp").codes == (Reason.UNSUPPORTED,)


def test_external_torque_replaces_the_sensor(rig: Rig) -> None:
    """Y5: whatever the joint's own sensor says."""
    assert send_torque(rig, 3.5).torque[0] == 3.5
    assert M.TORQUE in rig.board.get_available_modes("left")[0][0]
    assert rig.board.set_interaction_mode("left", COMPLIANT)
    assert rig.board.set_control_mode("left", "torq")
    assert send_torque(rig, 3.5).torque[0] == rig.board.get_torque("left")[0] == 3.5
    assert rig.modes()[0] is M.TORQUE


@pytest.mark.parametrize("mode", ["torq", "pos"])
def test_silence_is_a_fault_where_a_torque_is_followed(rig: Rig, mode: str) -> None:
    """Y5: in TORQUE, and in COMPLIANT."""
    send_torque(rig, 0.0)
    assert rig.board.set_interaction_mode("left", COMPLIANT)
    assert rig.board.set_control_mode("left", mode)
    send_torque(rig, 0.0)
    rig.run(SILENCE + 0.02)
    assert rig.modes()[0] is M.HW_FAULT
    assert "torque sensor" in rig.board.get_faults("left")[0].text
    assert not rig.board.set_control_mode("left", M.FORCE_IDLE) or rig.modes()[0] is M.IDLE
    send_torque(rig, 0.0)
    assert rig.board.set_control_mode("left", M.FORCE_IDLE)


def test_silence_is_no_fault_in_stiff_modes(rig: Rig) -> None:
    """Y5, I7: the joint holds as one without a sensor, and takes over its load (M9)."""
    assert rig.board.set_control_mode("left", "pos")
    send_torque(rig, 6.0)
    rig.plant.push("left", 6.0)
    send_torque(rig, -6.0, 0.8)
    before = rig.run(SILENCE + 0.5)
    assert rig.modes()[0] is M.POSITION
    assert math.isnan(before.torque[0])
    assert rig.board.set_control_mode("left", "posd")
    after = rig.run(0.5)
    assert abs(float(after.position[0] - before.position[0])) < 2e-3


def test_invalid_external_torques_are_ignored(rig: Rig) -> None:
    """P13, M4: counted, and the reason reported."""
    assert rig.board.update_torque_sensor("left", math.nan).codes == (Reason.NOT_FINITE,)
    assert rig.board.update_torque_sensor("right", 1.0).codes == (Reason.UNSUPPORTED,)
    assert not rig.board.update_torque_sensor("left", [1.0, 2.0])
    assert not rig.board.update_torque_sensor("nobody", 1.0)
    assert rig.board.rejected_commands.tolist() == [2, 1]

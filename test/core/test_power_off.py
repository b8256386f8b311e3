# SPDX-License-Identifier: Apache-2.0
"""The end of a program: every joint without power, whatever its mode."""

from __future__ import annotations

import pytest
from rig import board_config, in_status, joint, ready

from control_board_ros.core.terms.modes import SELECTABLE
from control_board_ros.core.terms.vocabs import ControlMode

M = ControlMode


@pytest.mark.parametrize("mode", sorted(SELECTABLE))
def test_every_mode_becomes_idle(mode: ControlMode) -> None:
    every = {"control_modes": SELECTABLE}
    rig = ready(board_config(joint("left", **every), joint("right", **every)))
    assert rig.board.set_control_mode(["left", "right"], mode)
    rig.tick()
    rig.board.power_off()
    assert set(rig.modes()) == {M.IDLE}
    assert not rig.board.tick(rig.plant.read()).powered.any()


@pytest.mark.parametrize(
    ("status", "after"),
    [
        (M.CALIBRATING, M.IDLE),  # K2
        (M.HW_FAULT, M.HW_FAULT),  # F2: what happened stays shown
        (M.NOT_CONFIGURED, M.NOT_CONFIGURED),  # N4
    ],
)
def test_no_status_keeps_power(status: ControlMode, after: ControlMode) -> None:
    rig = in_status(status)
    rig.board.power_off()
    assert rig.modes() == [after]
    assert not rig.board.tick(rig.plant.read()).powered.any()

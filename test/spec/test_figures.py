# SPDX-License-Identifier: Apache-2.0
"""The source's Figures 1, 3 and 4, walked arrow by arrow."""

from __future__ import annotations

import pytest
from rig import ACTIVE, COMPLIANT, STANDARD, STIFF, M, Rig, board_config, joint, ready

from control_board_ros.core.config.config import Calibration


def test_figure_1() -> None:
    """M1, I1, I2, I4: switching between control and interaction modes, box by box."""
    rig = ready(board_config(joint("left", startup_mode=M.POSITION)))
    board = rig.board

    def box(mode: object, interaction: object) -> None:
        for _ in range(2):
            assert board.get_control_mode(0) == [mode]
            assert board.get_interaction_mode(0) == [interaction]
            rig.run(0.1)

    box(M.POSITION, STIFF)
    assert board.set_interaction_mode(0, COMPLIANT)
    box(M.POSITION, COMPLIANT)
    assert board.set_control_mode(0, M.VELOCITY)
    box(M.VELOCITY, COMPLIANT)
    assert board.set_control_mode(0, M.IDLE)
    box(M.IDLE, COMPLIANT)
    assert board.set_interaction_mode(0, STIFF)
    box(M.IDLE, STIFF)
    assert board.set_control_mode(0, M.POSITION)
    box(M.POSITION, STIFF)


@pytest.mark.parametrize("before", ACTIVE, ids=str)
@pytest.mark.parametrize("after", ACTIVE, ids=str)
def test_figure_3(before: object, after: object) -> None:
    """F1, F2, M10: through idle, and through a fault, from any mode to any mode."""
    rig = ready(board_config(joint("left")))
    board = rig.board
    # Above: generic - IDLE -> idle - XXX -> generic.
    assert board.set_control_mode(0, before)
    assert board.set_control_mode(0, M.IDLE)
    assert rig.modes() == [M.IDLE]
    assert rig.tick().output[0] == 0.0
    assert board.set_control_mode(0, after)
    assert rig.modes() == [after]
    # Below: generic - hardware fault -> FAULT - FORCE_IDLE -> idle - XXX -> generic.
    assert board.set_control_mode(0, before)
    rig.plant.inject(0, "external")
    rig.tick()
    assert rig.modes() == [M.HW_FAULT]
    rig.run(0.1)
    for wanted in STANDARD:  # there are no other arrows out of FAULT
        assert not board.set_control_mode(0, wanted)
        assert rig.modes() == [M.HW_FAULT]
    assert board.set_control_mode(0, M.FORCE_IDLE)
    assert rig.modes() == [M.IDLE]
    assert board.set_control_mode(0, after)
    assert rig.modes() == [after]


@pytest.mark.parametrize("wanted", ACTIVE, ids=str)
def test_figure_4_without_calibration(wanted: object) -> None:
    """N1, N2, N3: power on -> not configured -> completed configuration -> idle -> XXX."""
    rig = Rig(board_config(joint("left"), autoconfigure=False))
    rig.run(0.1)
    assert rig.modes() == [M.NOT_CONFIGURED]
    assert rig.board.configure()
    assert rig.modes() == [M.IDLE]
    assert rig.board.set_control_mode(0, wanted)
    assert rig.modes() == [wanted]


@pytest.mark.parametrize("output", [-6.0, 6.0])
def test_figure_4_with_calibration(output: float) -> None:
    """N2, N3, K1, K3, K4: … + calibration command -> calibration -> generic mode, or fault."""
    calibration = Calibration(type=5, output=output, stop=2.2 if output > 0 else -2.2, speed=1.0)
    rig = Rig(board_config(joint("left", calibration=calibration), autoconfigure=False))
    rig.run(0.1)
    assert rig.modes() == [M.NOT_CONFIGURED]
    assert rig.board.configure()
    assert rig.modes() == [M.CALIBRATING]
    rig.run(0.5)
    assert rig.modes() == [M.CALIBRATING]
    rig.run(9.0)
    assert rig.modes() == [M.POSITION]
    # Unable to complete the calibration: FAULT.
    rig.board.power_cycle()
    assert rig.modes() == [M.NOT_CONFIGURED]
    assert rig.board.configure()
    rig.run(0.3)
    assert rig.modes() == [M.CALIBRATING]
    rig.plant.inject(0, "encoder_frozen", persistent=True)
    rig.run(2.0)
    assert rig.modes() == [M.HW_FAULT]
    assert rig.board.get_calibration(0)[0].message

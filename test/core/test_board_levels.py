# SPDX-License-Identifier: Apache-2.0
"""SPEC R4: parts that wait for configure do not start the others past their levels."""

from __future__ import annotations

from rig import M, Rig, board_config, joint

from control_board_ros.core.config.config import Calibration, joined


def test_a_part_without_autoconfigure_holds_its_level() -> None:
    """R4, N2: the level is done when that part is configured by hand; then the next one begins."""
    slow = Calibration(type=3, start=0.1, speed=0.5)
    parts = {
        "torso": board_config(joint("t", calibration=slow)),
        "head": board_config(joint("h"), autoconfigure=False),
        "arm": board_config(joint("a")),
    }
    rig = Rig(joined(parts), levels=(("torso", "head"), ("arm",)))
    rig.run(2.0)
    assert rig.modes() == [M.POSITION, M.NOT_CONFIGURED, M.NOT_CONFIGURED]
    assert rig.board.group("head").configure()
    rig.run(0.1)
    assert rig.modes() == [M.POSITION, M.IDLE, M.IDLE]
    rig.board.power_cycle()
    rig.tick(4)
    assert rig.modes() == [M.CALIBRATING, M.NOT_CONFIGURED, M.NOT_CONFIGURED]


def test_a_power_cycle_of_a_part_waits_for_its_level() -> None:
    """R4: also after a part failed; configure of that part starts it."""
    slow = Calibration(type=3, start=0.1, speed=0.5)
    parts = {"torso": board_config(joint("t", calibration=slow)), "arm": board_config(joint("a"))}
    rig = Rig(joined(parts), levels=(("torso",), ("arm",)))
    arm = rig.board.group("arm")
    rig.tick(4)
    arm.power_cycle()
    rig.tick(4)
    assert rig.modes() == [M.CALIBRATING, M.NOT_CONFIGURED]
    assert rig.board.set_control_mode("t", M.FORCE_IDLE)
    rig.tick(4)
    arm.power_cycle()
    rig.tick(4)
    assert rig.modes() == [M.IDLE, M.NOT_CONFIGURED]
    assert arm.configure()
    rig.tick(4)
    assert rig.modes() == [M.IDLE, M.IDLE]
    rig.board.power_cycle()
    rig.run(2.0)
    assert rig.modes() == [M.POSITION, M.IDLE]
    arm.power_cycle()
    rig.tick(4)
    assert rig.modes() == [M.POSITION, M.IDLE]

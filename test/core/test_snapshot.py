# SPDX-License-Identifier: Apache-2.0
"""Snapshot.joined: the boards of a robot side by side."""

from __future__ import annotations

import numpy as np
from rig import board_config, joint, plain, ready

from control_board_ros.core.state import Snapshot


def test_the_snapshot_of_one_board_is_its_own() -> None:
    """R1: a robot may have one part."""
    one = ready(board_config(joint("a"), plain("b"))).board.snapshot()
    same = Snapshot.joined([one])
    assert (same.time, same.cycle) == (one.time, one.cycle)
    np.testing.assert_array_equal(same.block, one.block)


def test_joints_stand_side_by_side() -> None:
    """R3: in the order of the parts, with the time of the cycle that they share."""
    first = ready(board_config(joint("a"), plain("b")))
    second = ready(board_config(plain("c")))
    assert first.board.set_control_mode("a", "pos")
    assert first.board.position_move("a", 0.5)
    parts = [rig.tick() for rig in (first, second)]
    whole = Snapshot.joined(parts)
    assert (whole.time, whole.cycle) == (parts[0].time, parts[0].cycle)
    assert whole.motion_done.tolist() == [False, True, True]
    assert whole.torque_sensor.tolist() == [True, False, False]
    assert whole.position.tolist() == [*parts[0].position, *parts[1].position]

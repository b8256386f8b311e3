# SPDX-License-Identifier: Apache-2.0
"""References of programs that repeat them: position moves, too, may come as a stream."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.group import JointGroup
from ...core.selection import RequestError
from ...core.terms.modes import MOVES
from ...core.terms.reply import Reply, accepted
from ...core.terms.vocabs import CommandKind


def send(
    board: JointGroup, kind: CommandKind, names: Sequence[str], values: Any, along: Any = None
) -> Reply:
    """Send references of one kind; a position that repeats is no new move.

    Args:
        board: the receiver.
        kind: of the references.
        names: of joints; none: all.
        values: one per joint.
        along: speeds or accelerations, one per joint; None: those that are set.
    """
    if kind is not CommandKind.POSITION:
        return board.command(kind, names, values, along)
    moves = without_repeats(board, names, values, along)
    if not moves:
        return accepted(board.selector.select(names).names)
    names, values, along = moves
    reply = board.command(kind, names, values, along)
    if reply and np.array_equal(board.get_target_position(reply.joints), values):
        return accepted(reply.joints)  # slower than requested: no news of a stream
    return reply


def without_repeats(
    board: JointGroup, names: Sequence[str], positions: Any, speeds: Any
) -> tuple[Sequence[str], Any, Any] | None:
    """Names, positions and speeds of the moves that are new; None where none is.

    A move is not new while it runs, and where its joint holds its target. Restarted with every
    message of a stream, it would never get up to its speed. What does not fit is returned as it
    came, for the board's report.
    """
    try:
        chosen = board.selector.select(names)
    except RequestError:
        return names, positions, speeds
    joints = chosen.names
    if len(positions) != len(joints) or (speeds is not None and len(speeds) != len(joints)):
        return names, positions, speeds
    moving = ~np.array(board.check_motion_done(joints))
    known = moving | (board.state.position_reference[chosen.joints] == positions)
    known &= board.get_target_position(joints) == positions
    known &= [mode is MOVES for mode in board.get_control_mode(joints)]
    if speeds is not None:
        known &= board.get_ref_speed(joints) == speeds
    new = np.flatnonzero(~known)
    if new.size == len(joints):
        return names, positions, speeds
    if not new.size:
        return None
    some = None if speeds is None else np.asarray(speeds)[new]
    return [joints[k] for k in new], np.asarray(positions)[new], some

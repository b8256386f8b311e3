# SPDX-License-Identifier: Apache-2.0
"""References as YARP's clients send them: streams, and what comes along stays set."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...core.group import JointGroup
from ...core.machine.commands import COMMANDS
from ...core.terms.reply import Answer, Reply, joints_of
from ...core.terms.vocabs import CommandKind
from ..wiring.streams import send as send_stream


def send(
    board: JointGroup, kind: CommandKind, names: Sequence[str], values: Any, along: Any = None
) -> Reply:
    """Send references of one kind.

    Args:
        board: the receiver.
        kind: of the references.
        names: of joints; none: all.
        values: one per joint.
        along: speeds or accelerations, one per joint, which stay set for the joints that accept
            them; None: those that are set.
    """
    reply = send_stream(board, kind, names, values, along)
    if along is not None and (taken := joints_of(reply, Answer.ACCEPTED)):
        asked = board.selector.select(names).names
        given = dict(zip(asked, along, strict=True))
        standing = {str(COMMANDS[kind].along): [given[name] for name in taken]}
        board.set_reference_speed(taken, **standing)
    return reply

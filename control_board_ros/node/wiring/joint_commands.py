# SPDX-License-Identifier: Apache-2.0
"""~/joint_commands: a JointState with the reference accepted by each joint's mode.

It is what ros2_control's topic-based hardware sends: one number per joint that has the command
interface, in the order of the joints; NaN where no controller commands.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...core.group import JointGroup
from ...core.machine.commands import COMMANDS
from ...core.selection import RequestError, Selection
from ...core.terms.reply import Reply
from ...core.terms.vocabs import CommandKind
from ...protocols import Floats
from ..loop.member import Member
from .messages import bounded
from .streams import send

K = CommandKind
#: The field of a JointState for values that messages of references call so.
FIELDS = {"positions": "position", "velocities": "velocity", "torques": "effort"}
#: Its kinds of reference, and their field; the first of several accepted by a mode.
KINDS = {kind: FIELDS[row.field] for kind, row in COMMANDS.items() if row.field in FIELDS}
#: The kind to report for a value that the joint's mode does not accept.
REFUSED = {"position": K.POSITION_DIRECT, "velocity": K.VELOCITY, "effort": K.TORQUE}


class JointCommands:
    """Takes joint commands and hands them to the board, each to its kind of reference.

    Args:
        member: whose joints are commanded.
        answer: receives each reply with a message.
    """

    def __init__(self, member: Member, answer: Callable[[Reply], None]) -> None:
        self._member, self._answer = member, answer

    def on_message(self, message: Any) -> None:
        """A JointState; without names, of all joints."""
        with self._member.exclusive() as board:
            replies = take(board, message)
        for reply in replies:
            self._answer(reply)


def take(board: JointGroup, message: Any) -> list[Reply]:
    """Start the references that a JointState carries; one reply for each kind of them.

    A position that repeats is no new move (P1). A velocity beside a position that is accepted has
    nothing: a controller that has stopped leaves a 0 in its command interfaces.
    """
    joints = bounded(message.name, board.count)
    try:
        chosen = board.selector.select(joints)
        values = {name: spread_short(board, chosen, name, message) for name in REFUSED}
    except RequestError as error:
        return [board.reject(joints, f"refused, {error}")]
    given = {field: ~np.isnan(numbers) for field, numbers in values.items()}
    left = np.logical_or.reduce(list(given.values()))
    taken = [
        (K(kind), field, board.state.accepts[kind, chosen.joints]) for kind, field in KINDS.items()
    ]
    ignored = [(kind, field, np.True_) for field, kind in REFUSED.items()]
    replies = []
    for kind, field, accepted in (*taken, *ignored):
        picked = left & given[field] & accepted
        if picked.any():
            left &= ~picked
            names = [chosen.names[k] for k in np.flatnonzero(picked)]
            replies.append(send(board, kind, names, values[field][picked]))
    return replies


def spread_short(board: JointGroup, chosen: Selection, field: str, message: Any) -> Floats:
    """The values of a field, one for each named joint, shape (k,); NaN where none is meant.

    Fewer values than joints apply to the joints that accept them, in their order.

    Raises:
        RequestError: it is not clear whose they are.
    """
    given: Floats = np.asarray(getattr(message, field)[: board.count + 1], dtype=float)
    count = len(chosen.numbers)
    if given.size == count:
        return given
    spread = np.full(count, np.nan)
    if given.size:
        kinds = [kind for kind, name in KINDS.items() if name == field]
        takes = board.state.accepts[:, chosen.joints][kinds].any(axis=0)
        if given.size != (some := np.count_nonzero(takes)):
            raise RequestError(
                f"{given.size} numbers in {field} for {count} joints, of which {some} accept it "
                f"in their mode; send one per joint, NaN for no command"
            )
        spread[takes] = given
    return spread

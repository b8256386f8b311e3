# SPDX-License-Identifier: Apache-2.0
"""The command topics: each converts its message and passes it to the board between two cycles.

~/joint_commands is what ros2_control's topic-based hardware sends: one number per joint that has
the command interface, in the order of the joints; NaN where no controller commands.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...core.group import JointGroup
from ...core.machine.commands import COMMANDS
from ...core.selection import RequestError, Selection
from ...core.terms.reply import Reason, Reply, accepted
from ...core.terms.vocabs import CommandKind
from ...interface import (
    COMMAND_TOPICS,
    EXTERNAL_TORQUE,
    EXTERNAL_TORQUE_SENSOR,
    FEEDFORWARD_COMMAND,
    GOAL_HEARTBEAT,
    HEARTBEAT,
    JOINT_COMMANDS,
    JOINT_TRAJECTORY,
    Endpoint,
)
from ...operations import optional, truncated
from ...protocols import Floats
from ...text import count_of
from ..loop.loop import Member

K = CommandKind
#: The field of a JointState for the values that messages of references name so.
FIELDS = {"positions": "position", "velocities": "velocity", "torques": "effort"}
#: The kinds of reference in a JointState, and their field; the first that a mode accepts counts.
KINDS = {kind: FIELDS[row.field] for kind, row in COMMANDS.items() if row.field in FIELDS}
#: The kind to report for a value that the joint's mode does not accept.
REFUSED = {"position": K.POSITION_DIRECT, "velocity": K.VELOCITY, "effort": K.TORQUE}

#: Speeds and accelerations of references, as YARP's messages name them.
YARPS = {"speeds": "ref_velocities", "accelerations": "ref_accelerations"}

Callback = Callable[[Any], None]
#: The throttled log: a message, and a name for its repetitions.
Warn = Callable[[str, str], None]
#: Sends references: the board, their kind, names of joints, values, speeds or accelerations.
Send = Callable[[JointGroup, CommandKind, Sequence[str], Any, Any], Reply]


def references(member: Member, topic: Endpoint, send: Send, warn: Warn) -> Callback:
    """The callback of a topic that has references of one kind, by its row of COMMANDS."""
    kind, has = topic.reference, topic.load().get_fields_and_field_types()
    assert kind is not None
    field, along_field = COMMANDS[kind].field, COMMANDS[kind].along or ""
    along = next((name for name in (along_field, YARPS.get(along_field, "")) if name in has), None)

    def on_message(message: Any) -> None:
        values = getattr(message, field)
        extra = None if along is None else optional(getattr(message, along))
        with member.exclusive() as board:
            reply = send(board, kind, truncated(message.names, board.count), values, extra)
        warn_of(reply, warn)

    return on_message


def refusing_stale(member: Member, warn: Warn) -> Callable[[Any, int], bool]:
    """Refuses a message that waited while the board stood still (B6), and says whether it did.

    It gets the message and when it was sent, ns of system time.
    """

    def refused(message: Any, sent: int) -> bool:
        text = member.loop.standstill.voids(sent)
        if not text:
            return False
        names = getattr(message, "names", getattr(message, "name", None))
        if names is not None:
            with member.exclusive() as board:
                board.reject(truncated(names, board.count), text, Reason.STALE)
        warn(f"command ignored: {text}", "ignored")
        return True

    return refused


def warn_of(reply: Reply, warn: Warn) -> None:
    """Log ignored references, and accepted ones that were bounded."""
    if reply.message:
        warn(reply.message, "times" if reply else "ignored")


class CommandTopics:
    """The callbacks of the command topics.

    ``injection``: whether faults and torques may be injected into a simulation.
    """

    def __init__(
        self,
        member: Member,
        *,
        injection: bool,
        joint_trajectory: Callback,
        warn: Warn,
        goal_heartbeat: Callback = lambda _: None,
    ) -> None:
        self._member, self._injection, self._warn = member, injection, warn
        self._others = {JOINT_TRAJECTORY: joint_trajectory, GOAL_HEARTBEAT: goal_heartbeat}

    def callbacks(self) -> dict[Endpoint, Callback]:
        """The receivers of each command topic."""
        by_topic = {
            topic: references(self._member, topic, JointGroup.command, self._warn)
            for topic in COMMAND_TOPICS
            if topic.reference is not None and topic is not JOINT_TRAJECTORY
        }
        return (
            by_topic
            | self._others
            | {
                FEEDFORWARD_COMMAND: self._feedforward,
                EXTERNAL_TORQUE: self._external_torque,
                JOINT_COMMANDS: self._joint_commands,
                HEARTBEAT: self._heartbeat,
                EXTERNAL_TORQUE_SENSOR: self._external_torque_sensor,
            }
        )

    def _joint_commands(self, message: Any) -> None:
        with self._member.exclusive() as board:
            replies = joint_commands(board, message)
        for reply in replies:
            warn_of(reply, self._warn)

    def _feedforward(self, message: Any) -> None:
        with self._member.exclusive() as board:
            joints = truncated(message.names, board.count)
            outputs, torques = optional(message.outputs), optional(message.torques)
            reply = board.set_feedforward(joints, outputs, torques)
        warn_of(reply, self._warn)

    def _external_torque(self, message: Any) -> None:
        """Apply torques to joints of the simulation from outside, until they are 0."""
        simulation = self._member.loop.simulation()
        if not self._injection:
            self._warn(
                "external torque ignored: fault injection is off; "
                "start the node with allow_fault_injection: true",
                "ignored",
            )
            return
        torques = np.asarray(message.torques)
        with self._member.exclusive() as board:
            names = board.selector.select(truncated(message.names, board.count)).names
            if len(names) == torques.size and np.isfinite(torques).all():
                for name, torque in zip(names, torques.tolist(), strict=True):
                    simulation.push(name, torque)
                return
        self._warn(
            f"external torque ignored: {torques.size} torques for {len(names)} joints; "
            "send one finite number per named joint",
            "ignored",
        )

    def _external_torque_sensor(self, message: Any) -> None:
        with self._member.exclusive() as board:
            joints = truncated(message.names, board.count)
            reply = board.update_torque_sensor(joints, message.torques)
        warn_of(reply, self._warn)

    def _heartbeat(self, _message: Any) -> None:
        with self._member.exclusive() as board:
            board.beat(time.monotonic())


def stream(
    board: JointGroup, kind: CommandKind, names: Sequence[str], values: Any, along: Any = None
) -> Reply:
    """Send references that a program repeats: moves slower than requested are not reported."""
    reply = board.command(kind, names, values, along)
    if kind is not CommandKind.POSITION or not reply:
        return reply
    bounded_to = board.get_target_position(reply.joints)
    return accepted(reply.joints) if np.array_equal(bounded_to, values) else reply


def joint_commands(board: JointGroup, message: Any) -> list[Reply]:
    """Start the references of a JointState; returns one reply for each kind.

    A velocity beside an accepted position is
    ignored: a controller that has stopped leaves a 0 in its command interfaces.
    """
    joints = truncated(message.name, board.count)
    try:
        selection = board.selector.select(joints)
        values = {name: spread_short(board, selection, name, message) for name in REFUSED}
    except RequestError as error:
        return [board.reject(joints, f"refused, {error}")]
    present = {field: ~np.isnan(numbers) for field, numbers in values.items()}
    left = np.logical_or.reduce(list(present.values()))
    rows = [
        (K(kind), field, board.state.accepts[kind, selection.joints])
        for kind, field in KINDS.items()
    ]
    ignored = [(kind, field, np.True_) for field, kind in REFUSED.items()]
    replies = []
    for kind, field, accepting in (*rows, *ignored):
        picked = left & present[field] & accepting
        if picked.any():
            left &= ~picked
            names = [selection.names[k] for k in np.flatnonzero(picked)]
            replies.append(stream(board, kind, names, values[field][picked]))
    return replies


def spread_short(board: JointGroup, selection: Selection, field: str, message: Any) -> Floats:
    """The values of a field, one for each named joint, shape (k,); NaN: no command.

    Fewer values than joints apply to the joints that accept them, in their order.

    Raises:
        RequestError: their number is neither that of the joints nor of those that accept them.
    """
    numbers: Floats = np.asarray(getattr(message, field)[: board.count + 1], dtype=float)
    count = len(selection.numbers)
    if numbers.size == count:
        return numbers
    spread = np.full(count, np.nan)
    if numbers.size:
        kinds = [kind for kind, name in KINDS.items() if name == field]
        accepting = board.state.accepts[:, selection.joints][kinds].any(axis=0)
        if numbers.size != (some := np.count_nonzero(accepting)):
            raise RequestError(
                f"{count_of(numbers.size, 'numbers')} in {field} for {count_of(count, 'joints')}, "
                f"{some} of which may have one in their mode; send one per joint, NaN for none"
            )
        spread[accepting] = numbers
    return spread

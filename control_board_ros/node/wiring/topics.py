# SPDX-License-Identifier: Apache-2.0
"""The command topics: each converts its message and hands it to the board between two cycles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...core.group import JointGroup
from ...core.machine.commands import COMMANDS
from ...core.terms.reply import Reply
from ...interface import (
    COMMAND_TOPICS,
    EXTERNAL_TORQUE,
    EXTERNAL_TORQUE_SENSOR,
    FEEDFORWARD_COMMAND,
    HEARTBEAT,
    JOINT_COMMANDS,
    JOINT_TRAJECTORY,
    Endpoint,
)
from ..loop.member import Member
from .joint_commands import JointCommands
from .messages import bounded, optional

FEEDFORWARD = "feedforward"
KINDS = {kind.name.lower(): kind for kind in COMMANDS}


def send(
    board: JointGroup,
    kind: str,
    joints: Sequence[str],
    values: Sequence[float] | None,
    along: Sequence[float] | None,
    *,
    together: bool = False,
) -> Reply:
    """Do what the command topic of a kind does (SendReference).

    Args:
        board: whose joints are commanded.
        kind: of the references, as on the wire.
        joints: names; none for all.
        values: one per joint, shape (k,); None: none were sent.
        along: speeds or accelerations, likewise; of feed-forward the torques.
        together: whether all joints accept their references or none does.
    """
    if kind == FEEDFORWARD:
        return board.set_feedforward(joints, values, along, together=together)
    if kind in KINDS:
        given = () if values is None else values
        return board.command(KINDS[kind], joints, given, along, together=together)
    known = ", ".join([*KINDS, FEEDFORWARD])
    return board.reject(joints, f"kind {kind[:32]!r} unknown; one of {known}")


class CommandTopics:
    """The callbacks of the command topics.

    Args:
        member: whose board is commanded.
        injection: whether a simulation may be disturbed.
        joint_trajectory: receives a trajectory.
        warn: throttled log: ignored and bounded references, and a name for their repetitions.
    """

    def __init__(
        self,
        member: Member,
        *,
        injection: bool,
        joint_trajectory: Callable[[Any], None],
        warn: Callable[..., None],
    ) -> None:
        self._member, self._injection = member, injection
        self._joint_trajectory, self._warn = joint_trajectory, warn

    def callbacks(self) -> dict[Endpoint, Callable[[Any], None]]:
        """The receivers of each command topic."""
        references = [
            topic
            for topic in COMMAND_TOPICS
            if topic.reference is not None and topic is not JOINT_TRAJECTORY
        ]
        found = {topic: self._reference(topic) for topic in references}
        found |= {
            FEEDFORWARD_COMMAND: self._feedforward,
            EXTERNAL_TORQUE: self._external_torque,
            JOINT_TRAJECTORY: self._joint_trajectory,
            JOINT_COMMANDS: JointCommands(self._member, self._answer).on_message,
            HEARTBEAT: self._heartbeat,
            EXTERNAL_TORQUE_SENSOR: self._external_torque_sensor,
        }
        return found

    def _reference(self, topic: Endpoint) -> Callable[[Any], None]:
        """A callback that sends references of the topic's kind, by its row of COMMANDS."""
        kind = topic.reference
        assert kind is not None
        row = COMMANDS[kind]
        along = row.along if row.along in topic.load().get_fields_and_field_types() else None

        def take(message: Any) -> None:
            values = getattr(message, row.field)
            extra = None if along is None else optional(getattr(message, along))
            with self._member.exclusive() as board:
                reply = board.command(kind, bounded(message.names, board.count), values, extra)
            self._answer(reply)

        return take

    def _feedforward(self, message: Any) -> None:
        with self._member.exclusive() as board:
            joints = bounded(message.names, board.count)
            outputs, torques = optional(message.outputs), optional(message.torques)
            reply = board.set_feedforward(joints, outputs, torques)
        self._answer(reply)

    def _external_torque(self, message: Any) -> None:
        """Push joints of the simulation from outside, until a 0 comes."""
        simulation = self._member.loop.simulation()
        if not self._injection:
            self._warn(
                "external torque ignored: fault injection is off; "
                "start the node with allow_fault_injection: true"
            )
            return
        torques = np.asarray(message.torques)
        with self._member.exclusive() as board:
            names = board.selector.select(bounded(message.names, board.count)).names
            if len(names) == torques.size and np.isfinite(torques).all():
                for name, torque in zip(names, torques.tolist(), strict=True):
                    simulation.push(name, torque)
                return
        self._warn(
            f"external torque ignored: {torques.size} torques for {len(names)} joints; "
            "send one finite number per named joint"
        )

    def _external_torque_sensor(self, message: Any) -> None:
        with self._member.exclusive() as board:
            joints = bounded(message.names, board.count)
            reply = board.update_torque_sensor(joints, message.torques)
        self._answer(reply)

    def _heartbeat(self, _message: Any) -> None:
        with self._member.exclusive() as board:
            board.beat()

    def _answer(self, reply: Reply) -> None:
        """Log ignored references, and accepted ones that were bounded."""
        if reply.message:
            self._warn(reply.message, "times" if reply else "ignored")

# SPDX-License-Identifier: Apache-2.0
"""A board of the domain: its latest messages and its client."""

from __future__ import annotations

import json
import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from rclpy.node import Node

from control_board_ros.client import BoardError, ControlBoardClient
from control_board_ros.client.state import joint_names, seconds
from control_board_ros.core.model.coupling import Coupling
from control_board_ros.core.selection import RequestError
from control_board_ros.interface import (
    COMMAND_TOPICS,
    FAULTS,
    HEARTBEAT,
    MODES,
    MOST_JOINTS,
    NOTES,
    REQUEST_LOG,
    ROBOT_DESCRIPTION,
    STATE,
    Endpoint,
)
from control_board_ros.joint_limits import FIELDS, JointLimits
from control_board_ros.text import clean, clean_name, clean_names, first_of

from . import robot
from .subscriptions import Newest

#: s within which messages received over ROS are matched with the panel's own.
OWN_REQUEST_S = 2.0
#: s without a state of a watched board before its subscriptions are renewed.
SILENCE = 5.0


class Board:
    """One board.

    Args:
        node: the panel's.
        name: full name of the board's node.
        number: of the board, in frames and mesh addresses.
        answer_timeout: s to wait for an answer.

    Attributes: name, number, client, state (subscribed while watched, else None), robot (its
    description), info (for the page; empty until known), modes and faults (for the page), measured
    (a program of the panel commands it).
    """

    def __init__(self, node: Node, name: str, number: int, answer_timeout: float) -> None:
        self.name, self.number = name, number
        self.client = ControlBoardClient(
            node, name, find_timeout=answer_timeout, answer_timeout=answer_timeout
        )
        self.state: Newest | None = None
        self._node = node
        self.robot = robot.NO_ROBOT
        self.info: dict[str, Any] = {}
        self.modes: dict[str, Any] = {}
        self.faults: dict[str, Any] = {"faults": []}
        self.targets: list[float] = []
        self.measured = False
        self._notes: Any = None
        self._modes = Newest(node, MODES, name)
        self._faults = Newest(node, FAULTS, name)
        self._description = Newest(node, ROBOT_DESCRIPTION, name)
        self._commands = {
            topic: Newest(node, topic, name) for topic in COMMAND_TOPICS if topic is not HEARTBEAT
        }
        self._requests = Newest(node, REQUEST_LOG, name)
        self._requests_known = False  # the first one may be old
        self._sent = deque[tuple[float, Endpoint, tuple[str, ...], tuple[float, ...]]](maxlen=256)
        self._requested = -math.inf

    def close(self) -> None:
        self.watch(on=False)
        for topic in self._topics():
            topic.close()
        if self._notes is not None:
            self._node.destroy_publisher(self._notes)
        self.client.close()

    def is_recorded(self) -> bool:
        """Whether a recorder subscribes to its notes."""
        if self._notes is None:
            self._notes = self._node.create_publisher(NOTES.load(), NOTES.of(self.name), 10)
        return bool(self._notes.get_subscription_count())

    def note(self, text: str) -> bool:
        """Publish a note to its recordings; false without a recording."""
        if recorded := self.is_recorded():
            self._notes.publish(NOTES.load()(data=text))
        return recorded

    def watch(self, *, on: bool) -> None:
        """Subscribe to its state, or unsubscribe: 100 messages/s have a cost."""
        if on and self.state is None:
            self.state = Newest(self._node, STATE, self.name)
        elif not on and self.state is not None:
            self.state.close()
            self.state = None

    @property
    def space(self) -> str:
        """The namespace of its node, shared by the parts of a robot."""
        return self.name.rpartition("/")[0]

    def repeats(self, other: Board) -> bool:
        """Whether it includes another board's joints: it is the robot of a part."""
        names, others = set(self.names), set(other.names)
        return self.space == other.space and bool(others) and others < names

    @property
    def names(self) -> list[str]:
        """Its joints, in board order; empty before the first message."""
        names: list[str] = self.modes.get("names", [])
        return names

    def poll(self) -> dict[str, Any]:
        """News since the last call, for the page, by kind."""
        if self.state is not None and time.monotonic() - self.state.last >= SILENCE:
            self._renew()
        news: dict[str, Any] = {}
        if (modes := self._modes.take_read()) is not None:
            shown = shown_modes(modes)
            changes = self._changes(shown)
            news["modes"] = self.modes = shown
            if changes and time.monotonic() - self._requested > OWN_REQUEST_S:
                news["elsewhere"] = changes
        if (faults := self._faults.take_read()) is not None:
            self.faults = {"faults": [shown_fault(fault) for fault in faults.faults[:MOST_JOINTS]]}
            news["faults"] = self.faults
        if (description := self._description.take_read()) is not None:
            self.robot = robot.read(description.data, f"mesh/{self.number}/")
            news["robot"] = True
        return news

    def _renew(self) -> None:
        """Renew the subscriptions, after the old ones receive nothing any more."""
        for topic in self._topics():
            topic.renew()

    def _topics(self) -> list[Newest]:
        latched = (self._modes, self._faults, self._description)
        state = [] if self.state is None else [self.state]
        return [*state, *latched, *self._commands.values(), self._requests]

    def _changes(self, modes: dict[str, Any]) -> str:
        """Text of the joints' changes of control mode."""
        before = dict(zip(self.names, self.modes.get("control", ()), strict=True))
        now = zip(modes["names"], modes["control"], strict=True)
        changed = [(name, mode) for name, mode in now if before.get(name, mode) != mode]
        return first_of([f"{name} {before[name]} → {mode}" for name, mode in changed], 3)

    def poll_commands(self) -> list[str]:
        """Texts of other programs' commands: the newest on each topic."""
        lines: list[str] = []
        if self.measured:
            self.requesting()
        for topic, newest in self._commands.items():
            raw = newest.take()
            if raw is None:
                continue
            message = newest.read()
            names, values = tuple(names_of(message)), first_values(message)
            if not self.measured and not self._was_sent(topic, names, values):
                lines.append(f"{topic.short}: {in_words(names, values)}")
        if (asked := self._requests.take_read()) is not None and self._requests_known:
            lines += self._requested_elsewhere(asked)
        self._requests_known = True
        return lines

    def _requested_elsewhere(self, asked: Any) -> list[str]:
        """Text of another program's request; empty for the panel's own."""
        names, values, what = tuple(names_of(asked)), tuple[float, ...](), asked.name
        try:
            fields = json.loads(asked.request)
            if isinstance(fields, dict) and "values" in fields:  # a reference, as on its topic
                what = str(fields["kind"])
                values = tuple(float(value) for value in fields["values"])
        except (TypeError, ValueError, KeyError, OverflowError, RecursionError):
            return [f"{clean(asked.name)}, with unreadable fields"]
        topic = next((t for t in COMMAND_TOPICS if t.short == f"command/{what}"), None)
        if topic is not None and self._was_sent(topic, names, values):
            return []
        if topic is None and time.monotonic() - self._requested <= OWN_REQUEST_S:
            return []
        return [f"{clean(what)}: {in_words(names, values)}"]

    def requesting(self) -> None:
        """Mark following mode changes as the panel's own."""
        self._requested = time.monotonic()

    def sending(self, topic: Endpoint, names: Sequence[str], values: Sequence[float]) -> None:
        """Mark a command as the panel's own."""
        many = tuple(values) * (len(names) if len(values) == 1 else 1)
        self._sent.append((time.monotonic(), topic, tuple(names), many))

    def _was_sent(
        self, topic: Endpoint, names: tuple[str, ...], values: tuple[float, ...]
    ) -> bool:
        since = time.monotonic() - OWN_REQUEST_S
        return any(
            at >= since and (t, n, v) == (topic, names, values) for at, t, n, v in self._sent
        )

    async def ask_info(self) -> None:
        """Request data for the page: limits, available modes, greatest impedance.

        Raises:
            BoardError: the board does not answer.
        """
        aio = self.client.aio
        names = list(await aio.wait_until_found())
        available = await aio.get_available_modes()
        stiffness, damping = await aio.get_max_impedance()
        self.info = {
            "names": names,
            "kinds": list(map(self.robot.kind, names)),
            "limits": await self._limits(names),
            "control": [[mode.code for mode in control] for control, _ in available],
            "interaction": [[mode.code for mode in both] for _, both in available],
            "max_stiffness": stiffness.tolist(),
            "max_damping": damping.tolist(),
            "description": bool(self.robot.urdf),
            "coupling": await self._coupling(names),
        }

    async def _coupling(self, names: list[str]) -> list[tuple[str, list[tuple[int, float]]]]:
        """Joints of the description that axes move: each with the axes' numbers and shares."""
        if not self.robot.joints or all(name in self.robot.joints for name in names):
            return []
        try:
            coupling = await self.client.aio.get_coupling()
        except (BoardError, RequestError):
            return []  # these joints do not move in the view
        return moved_by_axes(names, coupling)

    async def _limits(self, names: list[str]) -> dict[str, list[float | None]]:
        """The limits in force, by kind; those of the URDF if the board does not answer."""
        try:
            limits = await self.client.aio.get_joint_limits(names)
            known = dict(zip(names, limits, strict=True))
        except (BoardError, RequestError):
            known = {}
        stops = {
            n: JointLimits(joint.lower, joint.upper) for n, joint in self.robot.joints.items()
        }
        rows = [known.get(n) or stops.get(n, JointLimits()) for n in names]
        return {field: [finite(getattr(row, field)) for row in rows] for field in FIELDS}

    async def ask_targets(self) -> bool:
        """Request the targets of moves; returns whether they are new.

        Raises:
            BoardError: the board does not answer.
        """
        targets = [finite(q) or 0.0 for q in await self.client.aio.get_target_position()]
        changed, self.targets = targets != self.targets, targets
        return changed

    def torque_reference(self, joint: str) -> float | None:
        """The torque in force for a joint, N·m; None without its state."""
        state = None if self.state is None else self.state.take_read() or self.state.read()
        torques = dict(zip(state.names, state.torque_reference, strict=False)) if state else {}
        return finite(torques.get(joint))


def finite(value: Any) -> float | None:
    """A number for JSON; None where not finite."""
    return float(value) if value is not None and math.isfinite(value) else None


def shown_modes(message: Any) -> dict[str, Any]:
    """A JointModes message for the page.

    Raises:
        RequestError: it is invalid.
    """
    return {
        "names": list(joint_names(message.names)),
        "control": list(map(clean_name, fitting(message, "control_modes"))),
        "interaction": list(map(clean_name, fitting(message, "interaction_modes"))),
    }


def fitting(message: Any, field: str) -> Any:
    """A field with one entry per name.

    Raises:
        RequestError: another number of entries.
    """
    values, count = getattr(message, field), len(message.names)
    if len(values) != count:
        raise RequestError(f"a message with {count} names and {len(values)} {field} is left out")
    return values


def shown_fault(fault: Any) -> dict[str, Any]:
    return {
        "name": clean_name(fault.name),
        "code": fault.code,
        "text": clean(fault.text),
        "stamp": seconds(fault.stamp),
    }


def names_of(message: Any) -> Sequence[str]:
    """The joints of a command; empty: all."""
    fields = (getattr(message, field, ()) for field in ("names", "joint_names", "name"))
    names: Sequence[str] = next(filter(None, fields), ())
    return names


def first_values(message: Any) -> tuple[float, ...]:
    """The references of a command: its first field of numbers."""
    fields: Mapping[str, str] = message.get_fields_and_field_types()
    for field, kind in fields.items():
        if kind == "sequence<double>":
            return tuple(getattr(message, field))
    return ()


def in_words(names: Sequence[str], values: Sequence[float]) -> str:
    """Text of references, in the board's units; the first three."""
    if not names:
        return "all joints"
    shown = clean_names(names)
    pairs = [f"{name} {value:.4g}" for name, value in zip(shown, values, strict=False)]
    return first_of(pairs or list(shown), 3)  # only the names of a trajectory


def moved_by_axes(
    names: Sequence[str], coupling: Coupling
) -> list[tuple[str, list[tuple[int, float]]]]:
    """Joints that are no axes, each with the numbers of its axes and their shares."""
    places = [names.index(axis) if axis in names else -1 for axis in coupling.axes]
    return [
        (name, [(j, share) for j, share in zip(places, row, strict=True) if share and j >= 0])
        for name, row in zip(coupling.physical_joints, coupling.rows, strict=True)
        if name not in names
    ]

# SPDX-License-Identifier: Apache-2.0
"""What the parts of the client share: the link, the joints, the last state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from control_board_msgs.msg import BoardState, JointModes
from numpy.typing import NDArray

from control_board_ros.core.reply import Answer, Reply, refused
from control_board_ros.core.selection import RequestError, Selection, Selector
from control_board_ros.interfaces import Floats, Joints

from .link import LATCHED, Link
from .modes_view import ModesView
from .waiting import Steps

#: State messages to let pass after a request before one surely shows what it did: the first may
#: have been taken before.
SETTLING = 2


FLOAT_FIELDS = [
    name
    for name, kind in BoardState.get_fields_and_field_types().items()
    if kind == "sequence<double>"
]


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A BoardState message with numpy arrays, one entry per joint in the board's order.

    Attributes: stamp (s, time of the reading), names, position, velocity, torque (measured),
    position_reference, velocity_reference, torque_reference (in force), output (PWM percent),
    current (A), motion_done, rejected_commands, calibrated, temperature (°C, of the winding).
    """

    stamp: float
    names: tuple[str, ...]
    position: Floats
    velocity: Floats
    torque: Floats
    position_reference: Floats
    velocity_reference: Floats
    torque_reference: Floats
    output: Floats
    current: Floats
    motion_done: NDArray[np.bool_]
    rejected_commands: NDArray[np.uint64]
    calibrated: NDArray[np.bool_]
    temperature: Floats

    @classmethod
    def of(cls, message: Any) -> State:
        """The state in a BoardState message."""
        floats = {
            field: np.array(getattr(message, field), dtype=np.float64) for field in FLOAT_FIELDS
        }
        return cls(
            stamp=seconds(message.header.stamp),
            names=tuple(message.names),
            motion_done=np.array(message.motion_done, dtype=np.bool_),
            rejected_commands=np.array(message.rejected_commands, dtype=np.uint64),
            calibrated=np.array(message.calibrated, dtype=np.bool_),
            **floats,
        )


def reply_of(response: Any, selection: Selection) -> Reply:
    """The board's own answer for each joint; of none, where the request was wrong as a whole."""
    answers = tuple(Answer(text) for text in response.answers)
    names = selection.names if answers else ()
    reasons = tuple(response.reasons) if any(response.reasons) else ()
    return Reply(names, answers, response.message, reasons)


def seconds(stamp: Any) -> float:
    """A ROS time stamp in s."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)


class StateView:
    """The last BoardState message, and how many came; ``wanted`` is the number that will do."""

    def __init__(self) -> None:
        self.message: Any = None
        self.heard = 0
        self.wanted = 1

    def on_message(self, message: Any) -> None:
        self.message = message
        self.heard += 1


class ClientBase:
    """Connection and joints; the parts of ControlBoardClient derive from it."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._view = ModesView()
        self._states = StateView()
        link.subscribe(JointModes, "modes", self._view.on_message, LATCHED)

    # Joints

    def _find(
        self, timeout: float | None = None, also: Callable[[], bool] = lambda: True
    ) -> Steps[Selector]:
        """The board's joints, once it is found and what else is asked holds."""
        patience = self._link.find_timeout if timeout is None else timeout
        found = yield from self._link.until(lambda: self._view.known() and also(), patience)
        if not found:
            raise self._link.not_found(patience)
        selector = self._view.selector
        assert selector is not None
        return selector

    def _select(self, joints: Joints) -> Steps[Selection]:
        selector = yield from self._find()
        return selector.select(joints)

    # Requests

    def _request(self, kind: Any, name: str, selection: Selection, **fields: Any) -> Steps[Any]:
        """Call a service that takes names."""
        request = kind.Request(names=list(selection.names), **fields)
        response = yield from self._link.call(kind, name, request)
        return response

    def _get(self, kind: Any, name: str, joints: Joints) -> Steps[Any]:
        """Call a service that reads.

        Raises:
            RequestError: an unknown joint, or one named twice.
        """
        selection = yield from self._select(joints)
        response = yield from self._request(kind, name, selection)
        if not response.success:
            raise RequestError(response.message)
        return response

    def _change(self, kind: Any, name: str, selection: Selection, **fields: Any) -> Steps[Reply]:
        """Call a service that answers for each joint."""
        response = yield from self._request(kind, name, selection, **fields)
        self._changed()
        return reply_of(response, selection)

    def _trigger(self, kind: Any, name: str, request: Any) -> Steps[Reply]:
        """Call a service that concerns the whole board."""
        names = (yield from self._find()).names
        response = yield from self._link.call(kind, name, request)
        self._changed()
        self._view.doubt()
        if response.success:
            return Reply(names, (Answer.ACCEPTED,) * len(names), response.message)
        return refused(response.message, names)

    # State

    def _changed(self) -> None:
        """A request was made: states from before it do not count any more."""
        self._states.wanted = self._states.heard + SETTLING

    def _state(self, *, fresh: bool = True) -> Steps[State]:
        """The last state; a fresh one shows what was asked for before."""
        states, link = self._states, self._link
        yield from self._find()
        link.subscribe(BoardState, "state", states.on_message)
        if fresh or states.message is None:
            yield from link.settle()
            yield from link.until(lambda: states.heard >= states.wanted, link.answer_timeout)
        states.wanted = min(states.wanted, states.heard)
        if states.message is None:
            raise link.timed_out("state")
        return State.of(states.message)

    def _measured(self, field: str, joints: Joints) -> Steps[Any]:
        selection = yield from self._select(joints)
        state = yield from self._state()
        return getattr(state, field)[selection.joints]

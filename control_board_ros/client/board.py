# SPDX-License-Identifier: Apache-2.0
"""The client of one board."""

from __future__ import annotations

import time
import weakref
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Any

from control_board_msgs.srv import GetFaults, InjectFault, Step
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from control_board_ros.core.faults import FaultRecord
from control_board_ros.core.reply import Reply, accepted, refused
from control_board_ros.core.selection import RequestError
from control_board_ros.core.vocabs import CommandKind
from control_board_ros.interfaces import Floats, Joints, ModeShortcuts, Values

from .base import State, seconds
from .link import LATCHED, Link
from .modes import for_each
from .parameters import ParameterOperations
from .references import Fields
from .waiting import Aio, Steps, operation
from .yarp_names import name_here


class ControlBoardClient(ParameterOperations, ModeShortcuts):
    """A control board somewhere on ROS, with the methods of the in-process one.

    Args:
        node: a node of yours; the client uses its context, namespace, remappings and log.
        board: name of the board's node, relative to the node's namespace, or absolute.
        find_timeout: s to wait for the board to appear, in every call.
        answer_timeout: s to wait for an answer.

    ``joints`` is an index, a name, a sequence of them, or None for all. Set methods return a
    Reply; get methods return one entry per joint in the order asked, and raise RequestError (a
    ValueError) for a joint that does not exist. Every method raises BoardNotFound, BoardTimeout
    or another BoardError when the connection fails. ``aio`` has the awaitable forms.
    """

    def __init__(
        self,
        node: Any,
        board: str = "control_board",
        *,
        find_timeout: float = 5.0,
        answer_timeout: float = 2.0,
    ) -> None:
        link = Link(node, board, find_timeout, answer_timeout)
        super().__init__(link)
        self._description: deque[str] = deque(maxlen=1)
        self.aio = Aio(self, link.wake_user)
        self._close = weakref.finalize(self, link.close)  # also when the program ends

    def close(self) -> None:
        """End the connection."""
        self._close()

    def __enter__(self) -> ControlBoardClient:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __getattr__(self, name: str) -> Any:
        """Say where a method of YARP is found here."""
        here = None if name.startswith("_") else name_here(name, dir(type(self)))
        hint = f"; here it is {here}, and angles are in rad" if here else ""
        raise AttributeError(f"{type(self).__name__} has no {name!r}{hint}")

    def log_deprecated(self, text: str) -> None:
        """Warn in the log of the user's node (D1)."""
        self._link.user.get_logger().warning(text)

    # The board

    @property
    def board_name(self) -> str:
        """The absolute name of the board's node."""
        return self._link.name

    @operation
    def wait_until_found(self, timeout: float | None = None) -> Steps[tuple[str, ...]]:
        """Wait for the board (the find timeout, or so many s); its joint names.

        Raises:
            BoardNotFound: it did not appear.
        """
        yield from self._find(timeout, self._link.is_there)  # what is known may be gone since
        return self._view.names

    @property
    def names(self) -> tuple[str, ...]:
        """Joint names in the board's order."""
        return self._view.names or self.wait_until_found()

    def get_axes(self) -> int:
        """How many joints the board has."""
        return len(self.names)

    @operation
    def get_state(self, *, fresh: bool = True) -> Steps[State]:
        """The last state of all joints, one that shows what was asked for before.

        With ``fresh=False`` the last one heard, without waiting once there is one.
        """
        return (yield from self._state(fresh=fresh))

    @operation
    def wait_for_state(
        self, condition: Callable[[State], bool], timeout: float | None = None
    ) -> Steps[State]:
        """Wait until a state fulfils the condition; that state.

        Raises:
            BoardTimeout: it did not within the answer timeout, or so many s.
        """
        patience = self._link.answer_timeout if timeout is None else timeout
        end = time.monotonic() + patience
        state = yield from self._state()
        while not condition(state):
            heard = self._states.heard
            new = yield from self._link.until(
                lambda heard=heard: self._states.heard != heard,  # type: ignore[misc]
                end - time.monotonic(),
            )
            if not new:
                raise self._link.timed_out("state", patience)
            state = State.of(self._states.message)
        return state

    @operation
    def get_encoder(self, joints: Joints = None) -> Steps[Floats]:
        """Measured positions."""
        measured: Floats = yield from self._measured("position", joints)
        return measured

    @operation
    def get_encoder_speed(self, joints: Joints = None) -> Steps[Floats]:
        """Measured velocities."""
        measured: Floats = yield from self._measured("velocity", joints)
        return measured

    @operation
    def get_torque(self, joints: Joints = None) -> Steps[Floats]:
        """Measured torques."""
        measured: Floats = yield from self._measured("torque", joints)
        return measured

    @operation
    def get_current(self, joints: Joints = None) -> Steps[Floats]:
        """Motor currents, A."""
        measured: Floats = yield from self._measured("current", joints)
        return measured

    @operation
    def get_temperature(self, joints: Joints = None) -> Steps[Floats]:
        """Temperatures of the windings, °C; NaN where there is no sensor."""
        measured: Floats = yield from self._measured("temperature", joints)
        return measured

    @operation
    def relative_move(
        self, joints: Joints, distances: Values, speeds: Values | None = None
    ) -> Steps[Reply]:
        """Start moves by so much from the measured positions, as position_move does (P1)."""
        try:
            selection = yield from self._select(joints)
            ways = for_each(distances, len(selection.names), "distances")
        except RequestError as error:
            return refused(str(error))
        state = yield from self._state()
        targets = state.position[selection.joints] + ways
        fields: Fields = {"positions": targets, "speeds": speeds}
        return (yield from self._command(CommandKind.POSITION, selection.names, fields))

    @operation
    def check_motion_done(self, joints: Joints = None) -> Steps[list[bool]]:
        """False from the cycle that accepts a move until its profile ends (P3)."""
        done = yield from self._measured("motion_done", joints)
        return [bool(value) for value in done]

    @operation
    def get_faults(self, joints: Joints = None) -> Steps[list[FaultRecord]]:
        """The last fault of each joint, active or not (F5)."""
        response = yield from self._get(GetFaults, "get_faults", joints)
        return [
            FaultRecord(
                name=fault.name,
                active=fault.active,
                code=fault.code,
                text=fault.text,
                stamp=seconds(fault.stamp),
            )
            for fault in response.faults
        ]

    @operation
    def get_robot_description(self) -> Steps[str]:
        """The board's URDF."""
        heard = self._description
        topic = self._link.name.rsplit("/", 1)[0] + "/robot_description"
        yield from self._find()
        self._link.subscribe(String, topic, lambda message: heard.append(message.data), LATCHED)
        if not (yield from self._link.until(lambda: bool(heard), self._link.answer_timeout)):
            raise self._link.timed_out("robot_description")
        return heard[-1]

    @operation
    def configure(self) -> Steps[Reply]:
        """The whole configuration is in: joints leave NOT_CONFIGURED (N2)."""
        return (yield from self._trigger(Trigger, "configure", Trigger.Request()))

    @operation
    def power_cycle(self) -> Steps[Reply]:
        """Back to power-on (N1)."""
        return (yield from self._trigger(Trigger, "power_cycle", Trigger.Request()))

    # The simulation

    @operation
    def pause(self, paused: bool = True) -> Steps[Reply]:
        """Pause the simulation, or let it go on."""
        return (yield from self._trigger(SetBool, "pause", SetBool.Request(data=paused)))

    @operation
    def step(self, steps: int = 1) -> Steps[Reply]:
        """Advance a paused simulation by so many control cycles."""
        if not 0 < steps < 2**32:
            return refused(f"steps must be from 1 to {2**32 - 1}, not {steps}")
        return (yield from self._trigger(Step, "step", Step.Request(steps=steps)))

    @operation
    def reset(self) -> Steps[Reply]:
        """Back to the initial pose and power-on."""
        return (yield from self._trigger(Trigger, "reset", Trigger.Request()))

    @operation
    def inject_fault(self, joints: Joints, fault: str, persistent: bool = False) -> Steps[Reply]:
        """Break something in simulated joints: ``overcurrent``, ``encoder``, …"""
        try:
            selection = yield from self._select(joints)
        except RequestError as error:
            return refused(str(error))
        response = yield from self._request(
            InjectFault, "inject_fault", selection, fault=fault, persistent=persistent
        )
        self._changed()
        if response.success:
            return accepted(selection.names)
        return refused(response.message, selection.names)

    @operation
    def clear_injected_faults(self) -> Steps[Reply]:
        """Remove injected causes; the latch stays until FORCE_IDLE."""
        return (yield from self._trigger(Trigger, "clear_injected_faults", Trigger.Request()))

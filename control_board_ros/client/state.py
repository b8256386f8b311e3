# SPDX-License-Identifier: Apache-2.0
"""Received from a board: states, joint names, calibration statuses."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from control_board_ros.core.calibration.calibrations import CalibrationStatus
from control_board_ros.core.selection import RequestError
from control_board_ros.interface import GET_CONTROL_MODE, MOST_JOINTS, STATE
from control_board_ros.protocols import Floats
from control_board_ros.text import clean_names

from .errors import InvalidAnswer

if TYPE_CHECKING:
    from .ros_link import RosLink

#: s without a state before the subscriptions are renewed, repeatedly.
RENEWAL_PERIOD = 5.0
#: Age in s from which a state requires an answer of the board, paused or out of reach.
STALE_AGE = 0.5
#: Messages received since a request before the newest certainly includes its effect: the first
#: may have been read before.
SETTLING_MESSAGES = 2


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A BoardState message with numpy arrays of shape (n,), joints in the board's order.

    Units are those of revolute joints; sliding joints have m, m/s and N in their place.

    Attributes:
        stamp: time of the reading, s.
        names: of the joints.
        position: measured, rad.
        velocity: measured, rad/s.
        torque: measured, N·m.
        position_reference: in force, rad; not the target of a move.
        velocity_reference: in force, rad/s.
        torque_reference: in force, N·m.
        output: PWM asked for, percent; 0 where a drive takes another set-point.
        current: of the motor, A.
        motion_done: whether no position move is active.
        rejected_commands: commands ignored since the start of the board.
        calibrated: whether the calibration is valid or not required.
        temperature: of the winding, °C; NaN where there is no sensor.
        brake: whether the joint's brake is closed; false where there is none.
        motor_position: of the motor's shaft, rad; NaN without an encoder there.
        motor_velocity: likewise, rad/s.
        acceleration: of the joint, rad/s².
        supply_voltage: of the amplifier, V; NaN where it is not measured.
        applied: PWM that acted, percent.
        age: of the joint's reading, s.
        external_torque: from outside, N·m; NaN where it is not known (X1).
        contacts: reacted to since the start of the board (X2).
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
    brake: NDArray[np.bool_]
    motor_position: Floats
    motor_velocity: Floats
    acceleration: Floats
    supply_voltage: Floats
    applied: Floats
    age: Floats
    external_torque: Floats
    contacts: NDArray[np.uint64]

    @classmethod
    def of(cls, message: Any) -> State:
        floats = {
            field: np.array(getattr(message, field), dtype=np.float64) for field in FLOAT_FIELDS
        }
        for field in OPTIONAL_FIELDS:  # a board without these fields
            if not floats[field].size:
                floats[field] = np.full(len(floats["position"]), np.nan)
        return cls(
            stamp=seconds(message.header.stamp),
            names=clean_names(message.names[:MOST_JOINTS]),
            motion_done=np.array(message.motion_done, dtype=np.bool_),
            rejected_commands=np.array(message.rejected_commands, dtype=np.uint64),
            calibrated=np.array(message.calibrated, dtype=np.bool_),
            brake=np.array(message.brake or [False] * len(message.position), dtype=np.bool_),
            contacts=np.array(message.contacts or [0] * len(message.position), dtype=np.uint64),
            **floats,
        )

    def checked(self) -> State:
        """This state; raises InvalidAnswer where lengths of fields differ."""
        count = len(self.names)
        for field in (*FLOAT_FIELDS, *OTHER_FIELDS):
            if (size := len(getattr(self, field))) != count:
                raise InvalidAnswer(f"a state of {count} joints has {size} values of {field}")
        return self


#: Fields that a board may lack.
OPTIONAL_FIELDS = (
    "motor_position",
    "motor_velocity",
    "acceleration",
    "supply_voltage",
    "applied",
    "age",
    "external_torque",
)
#: Fields that are no float arrays.
OTHER_FIELDS = ("motion_done", "rejected_commands", "calibrated", "brake", "contacts")
#: Fields converted to float arrays.
FLOAT_FIELDS = [field.name for field in fields(State) if field.type == "Floats"]


def seconds(stamp: Any) -> float:
    """A ROS time stamp in s."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)


class StateView:
    """The last state received over ROS, and whether it includes the effect of earlier requests.

    Decided by reception time, not processing time: on a busy machine, older states are still
    queued when a request is answered.
    """

    def __init__(self, link: RosLink) -> None:
        self._link = link
        self._message: Any = None
        self._received = 0  # messages
        # Last receptions, ns of the system's clock, oldest first.
        self._arrived = (0,) * SETTLING_MESSAGES
        self._wanted = 0  # earliest valid value of the oldest of these, ns
        self._at = self._since = time.monotonic()  # of the last message; or of the last renewal, s

    def changed(self) -> None:
        """Invalidate states from before a request."""
        self._wanted = time.time_ns()

    async def latest(self, *, fresh: bool = True) -> State:
        """The last state; a fresh one includes the effect of earlier requests.

        Raises:
            BoardTimeout: no state, or only an old one and the board does not answer.
        """
        link = self._link
        link.subscribe(STATE, self.on_message)
        # Before the first one, the board may not have discovered the subscription.
        patience = link.find_timeout if self._message is None else link.answer_timeout
        if fresh or self._message is None:
            await link.flush()
            if not await link.thread.until(self.shown, patience):
                self._renew()
        self._wanted = min(self._wanted, self._arrived[0])
        if fresh and self._message is not None and time.monotonic() - self._at > STALE_AGE:
            await link.call(GET_CONTROL_MODE)
        if self._message is None:
            raise link.timed_out(STATE, patience)
        return State.of(self._message).checked()

    def shown(self) -> bool:
        """Whether the last state includes the effect of earlier requests."""
        return self._message is not None and self._arrived[0] >= self._wanted

    async def following(self, timeout: float) -> State | None:
        """The state after the last one; None after ``timeout`` s."""
        received = self._received
        came = await self._link.thread.until(lambda: self._received != received, timeout)
        if not came:
            self._renew()
        return State.of(self._message).checked() if came else None

    def _renew(self) -> None:
        """Renew the subscriptions after SILENCE s without a state.

        After an outage longer than the middleware's memory, only new subscriptions receive.
        """
        if time.monotonic() - self._since >= RENEWAL_PERIOD:
            self._since = time.monotonic()
            self._link.renew()

    def on_message(self, message: Any, info: dict[str, int]) -> None:
        """Process a BoardState message; middlewares without reception time report 0."""
        self._message = message
        self._arrived = (*self._arrived[1:], info["received_timestamp"] or time.time_ns())
        self._received += 1
        self._at = self._since = time.monotonic()


def joint_names(names: Sequence[str]) -> tuple[str, ...]:
    """The joint names of a message, sanitised.

    Raises:
        RequestError: the names are invalid; the message is ignored.
    """
    if len(names) > MOST_JOINTS:
        raise RequestError(f"a message of {len(names)} joints is left out; {MOST_JOINTS} at most")
    known = clean_names(names)
    if len(set(known)) != len(known) or not all(known):
        raise RequestError("a message with a joint of no name, or of another's, is left out")
    return known


class CalibrationView:
    """Status of the calibrations started by this client, by joint.

    The link's thread updates it from feedback and results.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._statuses: dict[str, CalibrationStatus] = {}

    def status(self, name: str) -> CalibrationStatus:
        with self._lock:
            return self._statuses.get(name, CalibrationStatus(name))

    def started(self, names: Sequence[str]) -> None:
        with self._lock:
            for name in names:
                self._statuses[name] = CalibrationStatus(name, running=True, phase="waiting")

    def on_feedback(self, feedback: Any) -> None:
        """Process a Calibrate feedback; after the result only completed joints count."""
        with self._lock:
            for name, progress in zip(feedback.names, feedback.progress, strict=True):
                if self._statuses[name].running:
                    self._statuses[name] = CalibrationStatus(
                        name, running=True, progress=progress, phase=feedback.phase
                    )
                elif progress >= 1.0:
                    self._statuses[name] = done(name)

    def ended(self, names: Sequence[str], success: bool, message: str) -> None:
        """Process a result; completed joints count as done even where others failed."""
        with self._lock:
            for name in names:
                status = self._statuses[name]
                if success or status.progress >= 1.0:
                    self._statuses[name] = done(name)
                else:
                    self._statuses[name] = replace(
                        status, running=False, phase="failed", message=message
                    )


def done(name: str) -> CalibrationStatus:
    return CalibrationStatus(name, done=True, progress=1.0, phase="done")

# SPDX-License-Identifier: Apache-2.0
"""The state of a board as its ~/state messages tell it."""

from __future__ import annotations

import time
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from control_board_ros.interface import GET_CONTROL_MODE, MOST_JOINTS, STATE
from control_board_ros.protocols import Floats
from control_board_ros.text import clean_names

from .errors import InvalidAnswer
from .link import Link

#: s without a state after which the subscriptions are made anew, and again after as long.
SILENCE = 5.0
#: Age in s from which a state counts only if the board answers: it may be paused, or out of reach.
STALE = 0.5
#: State messages that must have arrived since a request before the newest surely shows what it
#: did: the first may have been read before.
SETTLING = 2


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
        position_reference: in force now, rad; not the target of a move.
        velocity_reference: in force now, rad/s.
        torque_reference: in force now, N·m.
        output: PWM, percent.
        current: of the motor, A.
        motion_done: whether no position move is under way.
        rejected_commands: commands ignored since the board was started.
        calibrated: whether the joint has the calibration that it requires, if any.
        temperature: of the winding, °C; NaN where there is no sensor.
        brake: whether the joint's brake is closed; false where there is none.
        motor_position: of the motor's shaft, rad; NaN without an encoder there.
        motor_velocity: likewise, rad/s.
        acceleration: of the joint, rad/s².
        supply_voltage: of the amplifier, V; NaN where it is not measured.
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

    @classmethod
    def of(cls, message: Any) -> State:
        """The state in a BoardState message."""
        floats = {
            field: np.array(getattr(message, field), dtype=np.float64) for field in FLOAT_FIELDS
        }
        for field in OF_MOTORS:  # a board that tells nothing of motors
            if not floats[field].size:
                floats[field] = np.full(len(floats["position"]), np.nan)
        return cls(
            stamp=seconds(message.header.stamp),
            names=clean_names(message.names[:MOST_JOINTS]),
            motion_done=np.array(message.motion_done, dtype=np.bool_),
            rejected_commands=np.array(message.rejected_commands, dtype=np.uint64),
            calibrated=np.array(message.calibrated, dtype=np.bool_),
            brake=np.array(message.brake, dtype=np.bool_),
            **floats,
        )

    def checked(self) -> State:
        """The same, where every field has an entry for each joint.

        Raises:
            InvalidAnswer: one has more or fewer.
        """
        count = len(self.names)
        for field in (*FLOAT_FIELDS, "motion_done", "rejected_commands", "calibrated", "brake"):
            if (found := len(getattr(self, field))) != count:
                raise InvalidAnswer(f"a state of {count} joints has {found} values of {field}")
        return self


#: The fields of a message that become arrays of numbers.
#: What not every board tells.
OF_MOTORS = ("motor_position", "motor_velocity", "acceleration", "supply_voltage")
FLOAT_FIELDS = [field.name for field in fields(State) if field.type == "Floats"]


def seconds(stamp: Any) -> float:
    """A ROS time stamp in s."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)


class StateView:
    """The last state heard, and whether it shows what was asked for before.

    What counts is when a message arrived, not when it was taken: on a busy machine, states of
    before a request wait in line when its answer is taken.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._message: Any = None
        self._heard = 0  # messages so far
        self._arrived = (0,) * SETTLING  # the last ones, ns of the system's clock, oldest first
        self._wanted = 0  # when the oldest of these must have arrived, ns
        self._at = self._since = time.monotonic()  # of the last message; or of the last renewal, s

    def changed(self) -> None:
        """A request was made: states from before it do not count any more."""
        self._wanted = time.time_ns()

    async def latest(self, *, fresh: bool = True) -> State:
        """The last state; a fresh one shows what was asked for before.

        Raises:
            BoardTimeout: there is none, or only an old one and the board does not answer.
        """
        link = self._link
        link.subscribe(STATE, self.on_message)
        # Until the first one, the board may not have heard of the subscription yet.
        patience = link.find_timeout if self._message is None else link.answer_timeout
        if fresh or self._message is None:
            await link.settle()
            if not await link.thread.until(self.shown, patience):
                self._renew()
        self._wanted = min(self._wanted, self._arrived[0])
        if fresh and self._message is not None and time.monotonic() - self._at > STALE:
            await link.call(GET_CONTROL_MODE)
        if self._message is None:
            raise link.discovery.timed_out(STATE, patience)
        return State.of(self._message).checked()

    def shown(self) -> bool:
        """Whether the last state shows what was asked for before."""
        return self._message is not None and self._arrived[0] >= self._wanted

    async def following(self, timeout: float) -> State | None:
        """The state after the last one; None when none came within so many s."""
        heard = self._heard
        came = await self._link.thread.until(lambda: self._heard != heard, timeout)
        if not came:
            self._renew()
        return State.of(self._message).checked() if came else None

    def _renew(self) -> None:
        """No state came: make the subscriptions anew where that lasts.

        A board that was out of reach for longer than the middleware remembers it is heard again by
        new ones, whatever became of the old ones.
        """
        if time.monotonic() - self._since >= SILENCE:
            self._since = time.monotonic()
            self._link.renew()

    def on_message(self, message: Any, info: dict[str, int]) -> None:
        """Take a BoardState message; middlewares that do not tell when it arrived say 0."""
        self._message = message
        self._arrived = (*self._arrived[1:], info["received_timestamp"] or time.time_ns())
        self._heard += 1
        self._at = self._since = time.monotonic()

# SPDX-License-Identifier: Apache-2.0
"""The state of a board as its ~/state messages tell it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from control_board_ros.interface import STATE
from control_board_ros.protocols import Floats

from .link import Link
from .waiting import Steps

#: State messages to let pass after a request before one surely shows what it did: the first may
#: have been taken before.
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


#: The fields of a message that become arrays of numbers.
FLOAT_FIELDS = [field.name for field in fields(State) if field.type == "Floats"]


def seconds(stamp: Any) -> float:
    """A ROS time stamp in s."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)


class StateView:
    """The last state heard, and whether it shows what was asked for before."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._message: Any = None
        self._heard = 0  # messages so far
        self._wanted = 1  # the number of the message that will do

    def changed(self) -> None:
        """A request was made: states from before it do not count any more."""
        self._wanted = self._heard + SETTLING

    def latest(self, *, fresh: bool = True) -> Steps[State]:
        """The last state; a fresh one shows what was asked for before."""
        link = self._link
        link.subscribe(STATE, self._on_message)
        if fresh or self._message is None:
            yield from link.settle()
            yield from link.thread.until(lambda: self._heard >= self._wanted, link.answer_timeout)
        self._wanted = min(self._wanted, self._heard)
        if self._message is None:
            raise link.discovery.timed_out(STATE)
        return State.of(self._message)

    def following(self, timeout: float) -> Steps[State | None]:
        """The state after the last one; None when none came within so many s."""
        heard = self._heard
        came = yield from self._link.thread.until(lambda: self._heard != heard, timeout)
        return State.of(self._message) if came else None

    def _on_message(self, message: Any) -> None:
        self._message = message
        self._heard += 1

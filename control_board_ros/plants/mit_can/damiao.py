# SPDX-License-Identifier: Apache-2.0
"""Damiao motors: registers, states and faults as published.

An answer has the id and the state of its motor. What a restart forgets is read back before power:
TIMEOUT, the watchdog, and CTRL_MODE are lost with the supply. CTRL_MODE is read just after it,
too; until it is told, the motor's law is not known.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

from ..drives.can_line import Frame
from ..drives.driver import ONE_TURN, Answers, Identity, Order
from ..drives.faults import coded
from ..drives.interview import Question, Questions, ask, find, told
from ..drives.reconcile import ASK, CONFIRM, GOAL, POWER_ON, RESET
from ..interface import DriveFault, DriveLimits
from . import frames as f

#: Ids whose answers hold them: four bits.
IDS = range(1, 16)
#: Where registers are read and written: frame, orders.
REGISTERS, GET, SET, STORE, REFRESH = 0x7FF, 0x33, 0x55, 0xAA, 0xCC
MST_ID, ESC_ID, TIMEOUT, CTRL_MODE, SW_VER = 7, 8, 9, 10, 14
RANGES = PMAX, VMAX, TMAX = 21, 22, 23
#: Registers that hold whole numbers; the others are floats.
WHOLE = {MST_ID, ESC_ID, TIMEOUT, CTRL_MODE, SW_VER}
LAST_REGISTER = 81
#: s per count of TIMEOUT; the control mode of MIT frames.
TIMEOUT_STEP, MIT_MODE = 50e-6, 1
#: How often its mode is read under power: so many answers are awaited.
AGAIN = 3
DISABLED, ENABLED = 0, 1
FAULTS = {
    0x8: "over-voltage",
    0x9: "under-voltage",
    0xA: "over-current",
    0xB: "bridge over-temperature",
    0xC: "winding over-temperature",
    0xD: "watchdog: communication lost",
    0xE: "overload",
}


class Damiao:
    """One motor.

    Args:
        axis: Its joint.
        bus: For texts.

    Attributes: ranges (of its frames), master (the id of its answers; None: it is not known).
    """

    law = MIT_MODE

    def __init__(self, axis: f.MitAxis, bus: str) -> None:
        if axis.id not in IDS:
            raise axis.refused("id", "1 to 15 is required: answers hold four bits of it")
        self._axis, self._bus = axis, bus
        self.ranges = f.Ranges(12.5, 30.0, 10.0)
        self.master: int | None = None
        self._again = 0  # answers for its mode that are awaited, after its power came

    def sent(self, message: Any) -> bool:
        """Whether a frame is from this motor."""
        from_master = message.arbitration_id == self.master and not message.is_extended_id
        return from_master and len(message.data) == 8 and message.data[0] & 0xF == self._axis.id

    @property
    def off(self) -> Frame:
        """The frame that takes its power."""
        return self._axis.id, f.DISABLE

    def set_up(self, timeout: float) -> Questions[Identity]:
        """MIT mode and watchdog, acknowledged; its ranges."""
        number = self._axis.id
        question = reading(number, MST_ID, several=True)
        self.master = int((yield from find(question, self._axis, self._bus, "mit_can")))
        yield from self._put(CTRL_MODE, MIT_MODE)
        yield from self._put(TIMEOUT, int(timeout / TIMEOUT_STEP))
        ends = []
        for register in RANGES:
            ends.append((yield from self._get(register)))
        self.ranges = f.Ranges(*ends)
        version = int((yield from self._get(SW_VER)))
        return Identity(
            id=number,
            type="Damiao",
            firmware=f"{version}",
            limits=limits(self.ranges),
            turn=ONE_TURN,
        )

    def confirm(self, timeout: float) -> Questions[bool]:
        mode, watch = (yield from self._get(CTRL_MODE)), (yield from self._get(TIMEOUT))
        return mode == MIT_MODE and watch == int(timeout / TIMEOUT_STEP)

    def _get(self, register: int) -> Questions[float]:
        number = self._axis.id
        text = f"id {number} does not answer for register {register}"
        value: float = yield from ask(reading(number, register), text)
        return value

    def _put(self, register: int, value: int) -> Questions[None]:
        """Write a register of whole numbers, until it is lost with the supply; clear faults."""
        number = self._axis.id
        data = struct.pack("<BBBBI", number, 0, SET, register, value)
        request = [(number, f.CLEAR), (REGISTERS, data)]
        question = Question(request, reading(number, register).pick)
        text = f"id {number} does not answer for register {register}"
        if (yield from ask(question, text)) != value:
            raise ValueError(f"id {number} does not accept {value} in register {register}")

    def frames(self, order: Order, answers: Answers, k: int) -> Iterator[Frame]:
        number, action = self._axis.id, order.action
        answers.asked[k] += 1
        if action is GOAL:
            if self._again > 0:  # it may have restarted since its set-up was confirmed
                yield from reading(number, CTRL_MODE).request
            yield number, f.command(self.ranges, order.kind, order.values)
        elif action is POWER_ON:
            answers.asked[k] += 1
            self._again = AGAIN
            yield number, f.ENABLE
            yield number, f.command(self.ranges, order.kind, order.values)
        elif action in (ASK, CONFIRM):
            yield REGISTERS, refresh(number)
        else:
            yield number, f.CLEAR if action is RESET else f.DISABLE

    def take(self, message: Any, answers: Answers, k: int) -> bool:
        """Read an answer; true where it is a motion."""
        data = bytes(message.data)
        if is_register(data, self._axis.id):
            if data[3] == CTRL_MODE:
                self._again = max(0, self._again - 1)
                if data[4:] != MIT_MODE.to_bytes(4, "little"):
                    answers.reported[k].lost = True
            return False  # of a question before
        reported, state = answers.reported[k], data[0] >> 4
        answers.came(k, data)
        if reported.lost:
            return True  # its ranges are not known yet
        motion = f.readings(self.ranges, data)
        answers.position[k], answers.velocity[k], answers.torque[k] = motion
        answers.temperature[k] = data[7]
        reported.power, reported.law = state == ENABLED, None if self._again else MIT_MODE
        fault = None if state in (DISABLED, ENABLED) else coded(state, FAULTS)
        reported.fault = fault or beyond(self.ranges, data)
        return True


def change_id(old: int, new: int) -> Questions[None]:
    """Write and store the id of a motor without power, and that of its answers, 0x10 above it.

    Raises:
        ConnectionError: it does not answer.
        ValueError: it has power.
    """
    text = f"id {old} does not answer"
    state = Question(
        [(REGISTERS, refresh(old))], lambda m: m.data[0] if len(m.data) == 8 else None
    )
    if (yield from ask(state, text)) >> 4 == ENABLED:
        raise ValueError(f"id {old} has power; it changes its id without")
    for register, value in ((MST_ID, 0x10 + new), (ESC_ID, new)):
        data = struct.pack("<BBBBI", old, 0, SET, register, value)
        yield Question([(REGISTERS, data)], reading(old, register).pick)
    for register, value in ((ESC_ID, new), (MST_ID, 0x10 + new)):
        content = yield from ask(reading(new, register), f"id {new} does not answer")
        if content != value:
            raise ValueError(f"id {old} does not accept {value} in register {register}")
    yield told((REGISTERS, bytes([new, 0, STORE, 1, 0, 0, 0, 0])))


def limits(ranges: f.Ranges) -> DriveLimits:
    """The limits of a motor: the ends of its frames."""
    return DriveLimits(
        lower=-ranges.position,
        upper=ranges.position,
        velocity=ranges.velocity,
        torque=ranges.torque,
    )


def beyond(ranges: f.Ranges, data: bytes) -> DriveFault | None:
    """The fault of a position at an end of its range: the motor may be beyond it."""
    if data[1:3] not in (b"\0\0", b"\xff\xff"):
        return None
    return DriveFault(0, f"position at the end of its range, {ranges.position:g} rad")


def refresh(drive: int) -> bytes:
    """A question for the motion of a motor, which commands nothing."""
    return bytes([drive, 0, REFRESH, 0, 0, 0, 0, 0])


def is_register(data: bytes, drive: int) -> bool:
    """Whether a frame of a motor is the answer to a question for a register.

    It has the motor's id without a state, 0, the order, and the number of the register; at this
    place a motion has a position of the range's lower end and a velocity beyond a third of its
    range, of a motor without power.
    """
    return data[:2] == bytes([drive, 0]) and data[2] in (GET, SET) and data[3] <= LAST_REGISTER


def reading(drive: int, register: int, *, several: bool = False) -> Question:
    """The question for a register; its answer is a number."""
    form = "<I" if register in WHOLE else "<f"

    def pick(message: Any) -> float | None:
        data = bytes(message.data)
        other = message.is_extended_id or message.arbitration_id >= REGISTERS
        if other or len(data) != 8 or not is_register(data, drive):
            return None
        return float(struct.unpack(form, data[4:])[0]) if data[3] == register else None

    return Question([(REGISTERS, bytes([drive, 0, GET, register, 0, 0, 0, 0]))], pick, several)

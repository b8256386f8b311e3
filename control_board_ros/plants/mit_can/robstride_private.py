# SPDX-License-Identifier: Apache-2.0
"""RobStride motors in their private protocol, as they are delivered: ids of 29 bits.

Id         kind 5 bit · 16 bits · 8 bits: the motor that is told, or the host that is answered
Command    kind 1, the 16 bits are τ; q · q̇ · k · d, 16 bits each, the highest byte first
Answer     kind 2, the 16 bits are mode 2 · faults 6 · id 8; q · q̇ · τ · temperature, 0.1 °C
Parameter  kinds 17 (read) and 18 (write): index 16 · zeros 16 · value 32, the lowest byte first

An answer holds mode and faults, and the watchdog (canTimeout) is written at the set-up. It is lost
with the supply, and therefore read back before power, just after it, and from a motor that was
silent.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from ..drives.can_line import Frame
from ..drives.driver import ONE_TURN, Answers, Identity, Order
from ..drives.faults import flagged
from ..drives.interview import Question, Questions, ask, find
from ..drives.reconcile import ASK, GOAL, OFF, POWER_ON, RESET
from ..interface import DriveFault
from . import frames as f
from . import robstride as r
from .damiao import limits

#: Kinds of frames.
IDENTIFY, COMMAND, MOTION, ENABLE, STOP, SET_ZERO, SET_ID = 0, 1, 2, 3, 4, 6, 7
READ, WRITE, FAULT, STORE, SET_BAUDRATE, SET_REPORT, SET_PROTOCOL = 17, 18, 21, 22, 23, 24, 25
#: To whom an identity is told.
EVERYBODY = 0xFE
#: Parameters, those of bytes and of whole numbers; the others are floats.
FAULTS, RUN_MODE, TORQUE_LIMIT, VOLTAGE, CAN_TIMEOUT = 0x3022, 0x7005, 0x700B, 0x701C, 0x7028
BYTES, WHOLE = (RUN_MODE, 0x7029, 0x702A, 0x702C, 0x702D), (FAULTS, 0x7026, CAN_TIMEOUT)
#: The run mode of commands; counts of CAN_TIMEOUT, 1/s, and the most that it accepts.
OPERATION, TIMEOUT_RATE, MOST_TIMEOUT = 0, 20_000, 100_000
#: Data of frames: clear faults; which firmware, and the begin of its answer; a secret, before a
#: number that is stored.
CLEAR, WHICH = bytes([1, *bytes(7)]), bytes([0, 0xC4, *bytes(6)])
FIRMWARE, SECRET = bytes([0, 0xC4, 0x56]), bytes(range(1, 7))
#: Faults in an answer.
BITS = {
    1 << 0: "under-voltage",
    1 << 1: "over-current",
    1 << 2: "over temperature",
    1 << 3: "encoder",
    1 << 4: "stall overload",
    1 << 5: "encoder not calibrated",
}
#: The model whose positions had another range before a firmware.
OLDER, SINCE, OLD_RANGE = "rs00", (0, 0, 2, 6), 12.5
#: How often its watchdog is read when its power came or went: so many answers are awaited.
AGAIN = 3
TRIPPED = DriveFault(0, "watchdog: no command within its timeout; or it restarted")


class Parts(NamedTuple):
    """Parts of an id."""

    kind: int
    between: int
    to: int

    @classmethod
    def of(cls, frame_id: int) -> Parts:
        return cls(frame_id >> 24 & 0x1F, frame_id >> 8 & 0xFFFF, frame_id & 0xFF)


def frame(kind: int, drive: int, data: bytes = bytes(8), between: int = r.MASTER) -> Frame:
    """A frame to a motor; the 16 bits between are the host, unless they are given."""
    return kind << 24 | between << 8 | drive, data


def command(
    drive: int, ranges: f.Ranges, values: tuple[float, float, float, float, float]
) -> Frame:
    """A command of q, q̇, k, d, τ."""
    *numbers, force = f.counts(ranges, *values, 16)
    return frame(COMMAND, drive, struct.pack(">4H", *numbers), force)


def pack(index: int, value: float) -> bytes:
    """A value of a parameter."""
    if index in BYTES or index in WHOLE:
        return int(value).to_bytes(4, "little")
    return struct.pack("<f", value)


def unpack(index: int, data: bytes) -> float:
    """The value of a parameter."""
    if index in BYTES:
        return data[0]
    if index in WHOLE:
        return int.from_bytes(data, "little")
    return float(struct.unpack("<f", data)[0])


def reading(drive: int, index: int, before: Sequence[Frame] = ()) -> Question:
    """The question for a parameter; NaN: the motor does not have it.

    Args:
        drive: Id.
        index: Of the parameter.
        before: Frames that are sent before.
    """

    def pick(message: Any) -> float | None:
        kind, between, _ = Parts.of(message.arbitration_id)
        data = bytes(message.data)
        if not sent_by(drive, message) or kind != READ or data[:2] != index.to_bytes(2, "little"):
            return None
        return math.nan if between >> 8 else unpack(index, data[4:])

    return Question([*before, read(drive, index)], pick)


def read(drive: int, index: int) -> Frame:
    return frame(READ, drive, index.to_bytes(8, "little"))


def sent_by(drive: int, message: Any) -> bool:
    """Whether a frame is from a motor, by its id."""
    kind, between, _ = Parts.of(message.arbitration_id)
    if not message.is_extended_id or kind not in (IDENTIFY, MOTION, READ, FAULT):
        return False
    return between & 0xFF == drive and len(message.data) == 8


def identity(drive: int) -> Question:
    """The question for the number of a motor's processor."""

    def pick(message: Any) -> bytes | None:
        mine = sent_by(drive, message) and Parts.of(message.arbitration_id).kind == IDENTIFY
        return bytes(message.data) if mine else None

    return Question([frame(IDENTIFY, drive)], pick, several=True)


def motion(drive: int, request: Frame, begin: bytes = b"") -> Question:
    """A question whose answer is a motion, or what else begins so."""

    def pick(message: Any) -> bytes | None:
        mine = sent_by(drive, message) and Parts.of(message.arbitration_id).kind == MOTION
        data = bytes(message.data)
        return data if mine and data.startswith(begin) else None

    return Question([request], pick)


def change_id(old: int, new: int) -> Questions[None]:
    """Give a motor without power another id, and store it.

    What answers to a write holds its mode: its limit of torque is written as it is.

    Raises:
        ConnectionError: it does not answer.
        ValueError: it has power.
    """
    text = f"id {old} does not answer"
    limit = yield from ask(reading(old, TORQUE_LIMIT), text)

    def pick(message: Any) -> bool | None:
        kind, between, _ = Parts.of(message.arbitration_id)
        return bool(between >> 14) if sent_by(old, message) and kind == MOTION else None

    rewrite = frame(WRITE, old, TORQUE_LIMIT.to_bytes(4, "little") + pack(TORQUE_LIMIT, limit))
    if (yield from ask(Question([rewrite], pick), text)):
        raise ValueError(f"id {old} has power; it changes its id without")
    yield Question([frame(SET_ID, old, between=new << 8 | r.MASTER)], identity(new).pick)
    yield motion(new, frame(STORE, new, SECRET + bytes([7, 8])))


class RobStridePrivate:
    """One motor.

    Args:
        axis: Its joint.
        bus: For texts.

    Attributes: ranges (of its frames).
    """

    law = OPERATION

    def __init__(self, axis: f.MitAxis, bus: str) -> None:
        self._axis, self._bus = axis, bus
        self.ranges = r.ranges(axis)
        self._action, self._timeout = OFF, 0
        self._again = 0  # answers for its watchdog that are awaited

    def sent(self, message: Any) -> bool:
        """Whether a frame is from this motor."""
        return sent_by(self._axis.id, message)

    def set_up(self, timeout: float) -> Questions[Identity]:
        """Run mode and watchdog, read back; its firmware and its limit of torque."""
        number = self._axis.id
        yield from find(identity(number), self._axis, self._bus, "mit_can")
        cleared = motion(number, frame(STOP, number, CLEAR))
        yield from ask(cleared, f"id {number} does not answer; is it powered?")
        firmware = yield from self._firmware()
        model = self._axis.model
        if model == OLDER and not self._axis.scales and firmware and firmware < SINCE:
            self.ranges = self.ranges._replace(position=OLD_RANGE)
        self._timeout = min(MOST_TIMEOUT, int(timeout * TIMEOUT_RATE))
        quiet = frame(SET_REPORT, number, SECRET + bytes(2))
        yield from self._put(RUN_MODE, OPERATION, quiet)
        yield from self._put(CAN_TIMEOUT, self._timeout)
        most = yield from self._get(TORQUE_LIMIT)
        ends = limits(self.ranges)
        if most > 0.0:
            ends = replace(ends, torque=min(self.ranges.torque, most))
        self._word = 0  # its faults, as it told them unasked
        self._tripped = False  # its power went
        return Identity(
            id=number,
            type=f"RobStride {model.upper()}",
            firmware=".".join(map(str, firmware)),
            limits=ends,
            turn=ONE_TURN,
        )

    def _firmware(self) -> Questions[tuple[int, ...]]:
        """Its numbers; none: it does not tell."""
        question = motion(self._axis.id, frame(STOP, self._axis.id, WHICH), FIRMWARE)
        for _ in range(2):
            if answers := (yield question):
                return tuple(answers[0][3:7])
        return ()

    def confirm(self, _timeout: float) -> Questions[bool]:
        watch, mode = (yield from self._get(CAN_TIMEOUT)), (yield from self._get(RUN_MODE))
        return watch == self._timeout and mode == OPERATION

    def _get(self, index: int, before: Sequence[Frame] = ()) -> Questions[float]:
        number = self._axis.id
        text = f"id {number} does not answer for parameter {index:#x}"
        value: float = yield from ask(reading(number, index, before), text)
        return value

    def _put(self, index: int, value: int, *before: Frame) -> Questions[None]:
        """Write a parameter of whole numbers, until it is lost with the supply."""
        number = self._axis.id
        write = frame(WRITE, number, index.to_bytes(4, "little") + pack(index, value))
        if (yield from self._get(index, [*before, write])) != value:
            raise ValueError(f"id {number} does not accept {value} in parameter {index:#x}")

    def frames(self, order: Order, answers: Answers, k: int) -> Iterator[Frame]:
        number, self._action = self._axis.id, order.action
        answers.asked[k] += 1
        if self._again > 0:  # it may have restarted since its set-up was confirmed
            yield read(number, CAN_TIMEOUT)
        if order.action is GOAL:
            yield command(number, self.ranges, f.values(order.kind, order.values))
        elif order.action is POWER_ON:
            answers.asked[k] += 1
            self._again = AGAIN
            yield frame(ENABLE, number)
            yield command(number, self.ranges, f.values(order.kind, order.values))
        elif order.action is ASK:
            yield read(number, CAN_TIMEOUT)
        else:
            if order.interview is not None:  # what it writes is answered by motions, too
                answers.asked[k] += len(order.interview.question.request)
            if order.action is RESET:
                self._word, self._tripped = 0, False
            yield frame(STOP, number, CLEAR if order.action is RESET else bytes(8))

    @property
    def off(self) -> Frame:
        """The frame that takes its power."""
        return frame(STOP, self._axis.id)

    def take(self, message: Any, answers: Answers, k: int) -> bool:
        """Read an answer; true where it is the one that is awaited."""
        kind, between, _ = Parts.of(message.arbitration_id)
        data, reported = bytes(message.data), answers.reported[k]
        if kind == FAULT:
            self._word = int.from_bytes(data[:4], "little")
        elif kind == READ:
            if data[:2] == CAN_TIMEOUT.to_bytes(2, "little") and not between >> 8:
                self._again = max(0, self._again - 1)
                if unpack(CAN_TIMEOUT, data[4:]) != self._timeout:
                    reported.lost = True
            if self._action is ASK:
                answers.raw[k][data] = None
                answers.heard(k)
                return True
        elif kind == MOTION and not data.startswith(FIRMWARE):
            answers.came(k, data)
            if not reported.lost:  # else its ranges are not known yet
                self._read(between, data, answers, k)
            return True
        return False

    def _read(self, between: int, data: bytes, answers: Answers, k: int) -> None:
        place, rate, force, heat = struct.unpack(">4H", data)
        moved = f.moved(self.ranges, place, rate, force, 16)
        answers.position[k], answers.velocity[k], answers.torque[k] = moved
        answers.temperature[k] = 0.1 * heat
        reported = answers.reported[k]
        power, bits = bool(between >> 14), between >> 8 & 0x3F
        if reported.power and not power and self._action is GOAL:
            self._tripped, self._again = True, AGAIN
        reported.power, reported.law = power, None if self._again else OPERATION
        known = flagged(self._word, r.FAULTS) or flagged(bits, BITS)
        reported.fault = known or (TRIPPED if self._tripped else None)

# SPDX-License-Identifier: Apache-2.0
"""Virtual RobStride motors: their private protocol and that of MIT, parameters, watchdog, faults.

Commands act in the operation mode; in the others (position, velocity, current) it has no torque.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator

from ..drives.can_frame import EXTENDED, SHORT
from ..drives.can_line import Frame
from . import frames as f
from . import robstride as r
from . import robstride_private as p

#: Protocols by number; modes in answers.
PRIVATE, CANOPEN, MIT = range(3)
RESET, RUNNING = 0, 2
#: Before the first command with power: none.
STILL = (0.0, 0.0, 0.0, 0.0, 0.0)
FIRMWARE = (0, 2, 3, 17)
#: Parameters that are read and written: index, as it is delivered, ends (RS02).
PARAMETERS: dict[int, tuple[float, float, float]] = {
    p.RUN_MODE: (0, 0, 5),
    0x7006: (0.0, -23.0, 23.0),
    0x700A: (0.0, -44.0, 44.0),
    p.TORQUE_LIMIT: (17.0, 0.0, 17.0),
    0x7010: (0.17, 0.0, 200.0),
    0x7011: (0.012, 0.0, 200.0),
    0x7014: (0.1, 0.0, 1.0),
    0x7016: (0.0, -4.0 * math.pi, 4.0 * math.pi),
    0x7017: (2.0, 0.0, 44.0),
    0x7018: (23.0, 0.0, 23.0),
    0x701E: (40.0, 0.0, 200.0),
    0x701F: (6.0, 0.0, 200.0),
    0x7020: (0.02, 0.0, 200.0),
    0x7021: (0.1, 0.0, 1.0),
    0x7022: (20.0, 0.0, 1000.0),
    0x7024: (10.0, 0.0, 44.0),
    0x7025: (10.0, 0.0, 1000.0),
    0x7026: (1, 1, 255),
    p.CAN_TIMEOUT: (0, 0, p.MOST_TIMEOUT),
    0x7029: (0, 0, 1),
    0x702A: (0, 0, 1),
    0x702B: (0.0, -7.0, 7.0),
    0x702C: (0, 0, 1),
    0x702D: (0, 0, 1),
    0x702E: (10.0, 0.0, 1000.0),
}
#: Those that are read only, some by two indices; of the supply, V.
POSITION, VELOCITY, TORQUE = (0x7019, 0x3016), (0x701B, 0x3017), (0x302C,)
SUPPLY = 48.0
#: Those that the frame of storing does not store.
VOLATILE = {p.RUN_MODE, 0x7006, 0x700A, 0x7016}
#: Faults of an answer, by those of the word.
SHORT_FAULTS = {1 << 2: 1 << 0, 1 << 16: 1 << 1, 1 << 0: 1 << 2, 1 << 14: 1 << 4, 1 << 7: 1 << 5}
#: What is stored: protocol and CAN_TIMEOUT; as it is delivered, and as its tool can set it.
DELIVERED, SWITCHED = (PRIVATE, 0), (MIT, p.TIMEOUT_RATE)


class VirtualRobStride:
    """A RobStride motor; see ``virtual.world.VirtualDrive``.

    Attributes: state (1 with power, else 0), faults (its word of faults), protocol, parameters (by
        index, as they act now).
    """

    def __init__(self, drive: int, ranges: f.Ranges, stored: tuple[int, int] = DELIVERED) -> None:
        self.id = drive
        self.ranges, self.silent, self.persists = ranges, False, 0
        self._stored_id, self._stored_protocol = drive, stored[0]
        self._stored = {index: values[0] for index, values in PARAMETERS.items()}
        self._stored[p.CAN_TIMEOUT] = stored[1]
        self._stored[p.TORQUE_LIMIT] = ranges.torque
        self._position = self._velocity = self._zero = 0.0
        self._host = r.MASTER
        self.reboot()

    def reboot(self) -> None:
        self.state, self.faults, self._mode = 0, self.persists, 0
        self.id, self.protocol = self._stored_id, self._stored_protocol
        self.parameters = dict(self._stored)
        self._command: tuple[float, ...] = STILL
        self._quiet = self.torque = 0.0
        self._boots, self._fails, self._reports, self._reported = True, False, False, 0.0

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.state, self.faults, self.persists = 0, code, code if persists else 0
        self._fails = True

    def unasked(self) -> Iterator[Frame]:
        """Its identity when it starts, its faults when they come, its motion where it reports."""
        if self.protocol != PRIVATE or self.silent:
            return
        if self._boots:
            self._boots = False
            yield self._identity()
        if self._fails:
            self._fails = False
            yield self._answer(p.FAULT, struct.pack("<II", self.faults, 0), 0)
        if self._reports and self._reported >= 0.01:
            self._reported = 0.0
            yield self._motion()

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[Frame]:
        if self.silent or len(data) != 8:
            return
        if self.protocol == MIT and frame_id == self.id:
            self._quiet = 0.0
            yield r.MASTER, self._on_mit(data)
        elif self.protocol == PRIVATE and frame_id > SHORT and frame_id & 0xFF == self.id:
            self._quiet = 0.0
            kind, between, _ = p.Parts.of(frame_id)
            if kind != p.COMMAND:
                self._host = between & 0xFF
            yield from self._on_private(kind, between, data)

    def _on_mit(self, data: bytes) -> bytes:
        if data[:6] == b"\xff" * 6 and data[7] == f.CLEAR[7] and data[6] != 0xFF:
            return bytes([self.id]) + self.faults.to_bytes(4, "little") + bytes(3)
        if data == f.ENABLE:
            self._enable()
        elif data == f.DISABLE:
            self.state = 0
        elif data == f.CLEAR:
            self.faults = self.persists
        elif data == f.ZERO:
            self._set_zero()
        elif data[:6] == b"\xff" * 6:  # an order of the protocol, never a command
            if data[7] == f.ENABLE[7] and data[6] < 3:
                self._mode = data[6]
            elif data[7] == f.DISABLE[7] and data[6] < 3:
                self._stored_protocol = data[6]
            elif data[7] == r.SET_ID and 0 < data[6] < 128:
                self.id = self._stored_id = data[6]
        elif self._mode == 0:
            self._command = f.commanded(self.ranges, data)
        moves = self._position, self._velocity, self.torque
        return f.answer(self.ranges, self.id, *moves, (300).to_bytes(2, "big"))

    def _enable(self) -> None:
        if not self.faults:
            self.state, self._command = 1, STILL

    def _set_zero(self) -> None:
        self._zero += self._position
        self._position = 0.0

    def _on_private(self, kind: int, between: int, data: bytes) -> Iterator[Frame]:
        """Answer to a frame; to one that it does not know there is none."""
        if kind == p.IDENTIFY:
            yield self._identity()
        elif kind == p.READ:
            yield self._parameter(data)
        elif kind in (p.SET_ID, p.SET_BAUDRATE, p.SET_PROTOCOL):
            self._store(kind, between, data)
            yield self._identity()
        elif kind == p.STOP and data == p.WHICH:
            self.state = 0
            yield self._answer(p.MOTION, p.FIRMWARE + bytes([*FIRMWARE, 0]), self._status)
        elif self._obey(kind, between, data):
            yield self._motion()

    def _store(self, kind: int, between: int, data: bytes) -> None:
        if kind == p.SET_ID:
            self.id = between >> 8 if 0 < between >> 8 < 128 else self.id
        elif kind == p.SET_PROTOCOL and data[:6] == p.SECRET and data[6] <= MIT:
            self._stored_protocol = data[6]

    def _obey(self, kind: int, between: int, data: bytes) -> bool:
        if kind == p.COMMAND:
            numbers = *struct.unpack(">4H", data), between
            self._command = f.counted(self.ranges, numbers, 16)
        elif kind == p.ENABLE:
            self._enable()
        elif kind == p.STOP:
            self.state = 0
            self.faults = self.persists if data[0] == 1 else self.faults
        elif kind == p.SET_ZERO and data[0] == 1:
            self._set_zero()
        elif kind == p.WRITE:
            self._write(data)
        elif kind == p.STORE and data[:6] == p.SECRET:
            self._stored |= {k: v for k, v in self.parameters.items() if k not in VOLATILE}
            self._stored_id = self.id
        elif kind == p.SET_REPORT and data[:6] == p.SECRET:
            self._reports = data[6] == 1
        else:
            return False
        return True

    def _write(self, data: bytes) -> None:
        index = int.from_bytes(data[:2], "little")
        if index in PARAMETERS:
            value = p.unpack(index, data[4:])
            _, low, high = PARAMETERS[index]
            high = self.ranges.torque if index == p.TORQUE_LIMIT else high
            if low <= value <= high:
                self.parameters[index] = value

    def _parameter(self, data: bytes) -> Frame:
        index = int.from_bytes(data[:2], "little")
        measured: dict[int, float] = {p.VOLTAGE: SUPPLY, 0x701A: 0.0, 0x2005: self._zero}
        measured |= dict.fromkeys(POSITION, self._position) | dict.fromkeys(TORQUE, self.torque)
        measured |= dict.fromkeys(VELOCITY, self._velocity) | {p.FAULTS: self.faults}
        if index in measured or index in self.parameters:
            value = p.pack(index, (measured | self.parameters)[index])
        else:
            return self._answer(p.READ, data[:4] + bytes(4), 1)
        return self._answer(p.READ, data[:4] + value, 0)

    @property
    def _status(self) -> int:
        """Mode and faults, above the id in an answer."""
        bits = sum(bit for fault, bit in SHORT_FAULTS.items() if self.faults & fault)
        return (RUNNING if self.state else RESET) << 6 | bits

    def _motion(self) -> Frame:
        ends, wrap = self.ranges, 2.0 * self.ranges.position
        place = (self._position + ends.position) % wrap - ends.position
        data = struct.pack(
            ">4H",
            f.count(place, -ends.position, ends.position, 16),
            f.count(self._velocity, -ends.velocity, ends.velocity, 16),
            f.count(self.torque, -ends.torque, ends.torque, 16),
            300,
        )
        return self._answer(p.MOTION, data, self._status)

    def _answer(self, kind: int, data: bytes, above: int) -> Frame:
        return kind << 24 | above << 16 | self.id << 8 | self._host, data

    def _identity(self) -> Frame:
        number = bytes([0x52, 0x53, *bytes(5), self._stored_id])
        return EXTENDED * (self.id <= SHORT >> 8) | self.id << 8 | p.EVERYBODY, number

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self._position, self._velocity = position - self._zero, velocity
        self._quiet, self._reported = self._quiet + seconds, self._reported + seconds
        watch = self.parameters[p.CAN_TIMEOUT] / p.TIMEOUT_RATE
        if 0.0 < watch < self._quiet:
            self.state = 0
        on = self.state and self.parameters[p.RUN_MODE] == p.OPERATION
        self.torque = f.given(self.ranges, self._command, self._position, velocity) if on else 0.0
        return self.torque

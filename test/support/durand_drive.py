# SPDX-License-Identifier: Apache-2.0
"""A CiA 402 drive whose CANopen is durand's: SDO, NMT and PDOs of another hand than the driver's.

Its state machine is written from CiA 402-2, figure 8 and tables 30 to 33, apart from ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from durand import MinimalNode, Record, Variable
from durand.datatypes import DatatypeEnum as Type
from durand.network import NetworkABC
from durand.object_dictionary import ObjectDictionary

COUNTS = 1 << 17
COUNT = 2.0 * math.pi / COUNTS
RATED = 2.0  # N·m
CSP, CSV, CST = 8, 9, 10
#: Status words of its states; those of a mode that follows its commands have bit 12.
DISABLED, READY, ON, ENABLED, STOPPING, FAULT = 0x40, 0x21, 0x23, 0x27, 0x07, 0x08
U8, U16, U32 = Type.UNSIGNED8, Type.UNSIGNED16, Type.UNSIGNED32
I8, I16, I32 = Type.INTEGER8, Type.INTEGER16, Type.INTEGER32
#: Index, type, access, value.
OBJECTS = (
    (0x1001, U8, "ro", 0), (0x6007, I16, "rw", 1), (0x603F, U16, "ro", 0), (0x6040, U16, "rw", 0),
    (0x6041, U16, "ro", DISABLED), (0x605A, I16, "rw", 2), (0x605E, I16, "rw", 2),
    (0x6060, I8, "rw", 0), (0x6061, I8, "ro", 0), (0x6064, I32, "ro", 0), (0x606C, I32, "ro", 0),
    (0x6071, I16, "rw", 0), (0x6072, U16, "rw", 2000), (0x6076, U32, "ro", 2000),
    (0x6077, I16, "ro", 0), (0x6079, U32, "ro", 48000), (0x607A, I32, "rw", 0),
    (0x6080, U32, "rw", 3000), (0x60B2, I16, "rw", 0), (0x60FF, I32, "rw", 0),
    (0x6502, U32, "ro", 0x380),
)  # fmt: skip
LISTS = {0x1016: (U32, 0), 0x1029: (U8, 0), 0x607D: (I32, 0, 0), 0x608F: (U32, COUNTS, 1)}


class Wire(NetworkABC):
    """Frames for the node, and those that it sends."""

    def __init__(self) -> None:
        self.called: dict[int, Callable[[int, bytes], None]] = {}
        self.sent: list[tuple[int, bytes]] = []

    def add_subscription(self, cob_id: int, callback: Callable[[int, bytes], None]) -> None:
        self.called[cob_id] = callback

    def remove_subscription(self, cob_id: int, callback: object = None) -> None:
        self.called.pop(cob_id, None)

    def send(self, cob_id: int, msg: bytes) -> None:
        self.sent.append((cob_id, bytes(msg)))


class DurandDrive:
    """One drive; see ``virtual.world.VirtualDrive``.

    Attributes: keeps (a mode that it does not leave; 0: none), status (its status word).
    """

    def __init__(self, drive: int) -> None:
        self.id, self.silent, self.persists, self.keeps = drive, False, 0, 0
        self._position = self._velocity = self.torque = 0.0
        self.reboot()

    def reboot(self) -> None:
        self._wire, objects = Wire(), ObjectDictionary()
        for index, kind, access, value in OBJECTS:
            objects[index] = Variable(kind, access, value)
        for index, (kind, *values) in LISTS.items():
            record = Record()
            for place, value in enumerate(values, start=1):
                record[place] = Variable(kind, "rw", value)
            objects[index] = record
        period = Record()
        period[1], period[2] = Variable(U8, "rw", 1), Variable(I8, "rw", -3)
        objects[0x60C2] = period
        self.node = MinimalNode(self._wire, self.id, objects)
        objects[0x1000] = Variable(U32, "ro", 0x00020192)
        objects[0x1008] = Variable(Type.VISIBLE_STRING, "ro", b"durand")
        objects[0x1018][4] = Variable(U32, "ro", self.id)
        self.status, self._code, self._word = DISABLED, 0, 0
        self._beat = math.nan
        objects.update_callbacks[0x6040, 0].add(self._obey)
        self._show()

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.status, self._code, self.persists = FAULT, code, code if persists else 0

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        if self.silent:
            return
        watched = self._value(0x1016, 1) >> 16 & 0x7F
        if frame_id == 0x700 + watched:
            self._beat = 0.0
        if frame_id == 0x80:
            self._show()
        if frame_id in self._wire.called:
            self._wire.called[frame_id](frame_id, data)
        sent, self._wire.sent = self._wire.sent, []
        yield from sent

    def _value(self, index: int, subindex: int = 0) -> int:
        return int(self.node.object_dictionary.read(index, subindex))

    def _obey(self, word: int) -> None:
        """A control word."""
        rising = word & 0x80 and not self._word & 0x80
        self._word = word
        if self.status == FAULT:
            if rising and not self.persists:
                self.status, self._code = DISABLED, 0
            return
        if not word & 0x02:  # disable voltage
            self.status = DISABLED
        elif not word & 0x04:  # quick stop
            self.status = STOPPING if self.status == ENABLED else DISABLED
        elif word & 0x07 == 0x06:  # shutdown
            self.status = READY
        elif self.status in (READY, ON, ENABLED):
            enable = word & 0x08 and self.status in (ON, ENABLED)
            self.status = ENABLED if enable else ON

    def _show(self) -> None:
        """Readings become values of objects, as PDOs of durand want it."""
        write = self.node.object_dictionary.write
        follows = 0x1000 if self.status == ENABLED and self._law in (CSP, CSV, CST) else 0
        write(0x6041, 0, self.status | follows | 0x0200)
        write(0x603F, 0, self._code)
        write(0x6061, 0, self._law)
        write(0x6064, 0, round(self._position / COUNT))
        write(0x606C, 0, round(self._velocity / COUNT))
        write(0x6077, 0, round(1e3 * self.torque / RATED))

    @property
    def _law(self) -> int:
        return self.keeps or self._value(0x6060)

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self._position, self._velocity = position, velocity
        self._beat += seconds
        if self._beat > 1e-3 * (self._value(0x1016, 1) & 0xFFFF):
            self._beat = math.nan
            if self._value(0x6007) == 1:
                self.fail(0x8130)
        self.torque = self._torque() if self.status == ENABLED else 0.0
        return self.torque

    def _torque(self) -> float:
        most = 1e-3 * self._value(0x6072) * RATED
        torque = 1e-3 * self._value(0x60B2) * RATED
        if self._law == CST:
            torque += 1e-3 * self._value(0x6071) * RATED
        elif self._law == CSV:
            torque += 3.0 * (self._value(0x60FF) * COUNT - self._velocity)
        elif self._law == CSP:
            error = self._value(0x607A) * COUNT - self._position
            torque += 60.0 * error - 3.0 * self._velocity
        return max(-most, min(most, torque))

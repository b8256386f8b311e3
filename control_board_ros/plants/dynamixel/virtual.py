# SPDX-License-Identifier: Apache-2.0
"""A virtual Dynamixel X: protocol 2, control table, operating modes, watchdog, hardware errors.

Written from the e-manual, the driver's library left aside: checksum and stuffing are its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ...core.config.config import JointConfig
from ..drives.axes import Axis
from ..drives.serial_line import Item
from ..virtual.pty_bus import VirtualSerialBus
from ..virtual.servo import BROADCAST, Framer, Loop, Packet, ServoMotor, Table
from ..virtual.world import World
from . import control_table as c
from . import table as t

HEADER, STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"
PING, READ, WRITE, REG_WRITE, ACTION, FACTORY_RESET, REBOOT = 1, 2, 3, 4, 5, 6, 8
CLEAR, STATUS, SYNC_READ, SYNC_WRITE, BULK_READ, BULK_WRITE = 0x10, 0x55, 0x82, 0x83, 0x92, 0x93
#: Errors of a status: e-manual, DYNAMIXEL Protocol 2.0, section "Status Packet".
FAILED, BAD_INSTRUCTION, BEYOND_RANGE, BAD_LENGTH, BEYOND_LIMIT, NO_ACCESS = 1, 2, 4, 5, 6, 7
ALERT, INPUT_VOLTAGE = 0x80, 1
CLEAR_TURNS, CLEAR_ERRORS = b"\x01\x44\x58\x4c\x22", b"\x02\x45\x52\x43\x4c"
GOALS = range(t.GOAL_PWM.address, t.GOAL_POSITION.address + 4)
#: s without an answer; counts of a turn.
REBOOT_TIME, TURN = 0.01, 4096
MODEL = t.MODELS[c.ROWS["Model Number"].value]


def _remainder(byte: int) -> int:
    value = byte << 8
    for _ in range(8):
        value = (value << 1 ^ 0x8005 if value & 0x8000 else value << 1) & 0xFFFF
    return value


REMAINDERS = [_remainder(byte) for byte in range(256)]


def checksum(data: bytes) -> int:
    """CRC-16, polynomial 0x8005, highest bit first, from 0."""
    value = 0
    for byte in data:
        value = (value << 8 ^ REMAINDERS[value >> 8 ^ byte]) & 0xFFFF
    return value


def packed(drive: int, instruction: int, parameters: bytes) -> bytes:
    body = (bytes([instruction]) + parameters).replace(HEADER, STUFFED)
    whole = HEADER + bytes([0, drive]) + (len(body) + 2).to_bytes(2, "little") + body
    return whole + checksum(whole).to_bytes(2, "little")


def length_of(head: bytes) -> int:
    return 7 + int.from_bytes(head[5:7], "little")


def unpacked(data: bytes) -> Packet | None:
    """The packet of these bytes, or None where its checksum is wrong."""
    if len(data) < 10 or checksum(data[:-2]) != int.from_bytes(data[-2:], "little"):
        return None
    body = data[7:-2].replace(STUFFED, HEADER)
    return Packet(data[4], body[0], body[1:])


class VirtualDynamixel:
    """An XM430-W350, as delivered but for its id; see ``virtual.world.VirtualDrive``.

    Attributes: table (its control table), motor (at its output), storing (s for which it hears
        nothing after it stored a value; see ``ERASING``).
    """

    def __init__(self, drive: int) -> None:
        self.silent, self.persists, self.storing = False, 0, 0.0
        self.motor, self._loop = ServoMotor(*c.MOTOR), Loop()
        self.table = Table(c.SIZE)
        self.torque, self._turns, self._asked = 0.0, 0, drive
        self._forget(t.ID, c.BAUD_RATE)
        self.table.set(t.ID, drive)
        self.table.set(c.BAUD_RATE, c.BAUDRATES.index(1_000_000))
        self.reboot()

    @property
    def id(self) -> int:
        return self.table.get(t.ID)

    @property
    def baudrate(self) -> int:
        """At which it listens, bit/s."""
        return c.BAUDRATES[self.table.get(c.BAUD_RATE)]

    def _forget(self, *items: Item) -> None:
        """The values of delivery in the stored area, of these items too."""
        for row in c.ROWS.values():
            if row.item.address < c.RAM and (
                row.item not in (t.ID, c.BAUD_RATE) or row.item in items
            ):
                self.table.set(row.item, row.value)

    def reboot(self) -> None:
        self.table.bytes[c.RAM :] = bytes(c.SIZE - c.RAM)
        for address, row in c.AT.items():
            if address >= c.RAM:
                self.table.set(row.item, row.value)
        self._reset_goals()
        self._quiet = self._away = self._hold = self._profile = 0.0
        self._registered: tuple[int, bytes] | None = None
        self._turns = -((round(self.motor.position / t.COUNT) + t.CENTRE) // TURN)
        if self.persists:
            self.fail(self.persists, persists=True)

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.persists = code if persists else 0
        self.table.set(t.ERROR, code)
        self.table.set(t.TORQUE, 0)

    def turn(self, packet: Packet) -> int:
        """Its place among those that answer to a packet."""
        ids = {SYNC_READ: packet.parameters[4:], BULK_READ: packet.parameters[::5]}
        return ids.get(packet.instruction, bytes([self.id])).find(self.id)

    def on_packet(self, packet: Packet) -> Iterator[bytes]:
        drive, instruction, data = packet
        if self.silent or self._away > 0.0 or drive not in (self.id, BROADCAST):
            return
        self._quiet, self._asked = 0.0, self.id
        if drive == self.id:
            yield from self._for_it_alone(instruction, data)
        elif instruction in (WRITE, REG_WRITE, ACTION, REBOOT, CLEAR):
            any(self._for_it_alone(instruction, data))  # no one answers to all
        else:
            yield from self._for_all(instruction, data)

    def _for_all(self, instruction: int, data: bytes) -> Iterator[bytes]:
        if instruction == PING:
            yield self._status(0, self._about())
        elif instruction == SYNC_READ and self.id in data[4:]:
            yield from self._told(1, *self._read(*_places(data)))
        elif instruction == BULK_READ:
            for k in range(0, len(data) - 4, 5):
                if data[k] == self.id:
                    yield from self._told(1, *self._read(*_places(data[k + 1 :])))
        elif instruction == SYNC_WRITE and len(data) > 4:
            address, length = _places(data)
            for place in range(4, len(data) - length, length + 1):
                if data[place] == self.id:
                    self._write(address, data[place + 1 : place + 1 + length])
        elif instruction == BULK_WRITE:
            while len(data) > 5:
                address, length = _places(data[1:])
                if data[0] == self.id:
                    self._write(address, data[5 : 5 + length])
                data = data[5 + length :]

    def _for_it_alone(self, instruction: int, data: bytes) -> Iterator[bytes]:
        if instruction == PING:
            yield self._status(0, self._about())
        elif instruction == READ and len(data) == 4:
            yield from self._told(1, *self._read(*_places(data)))
        elif instruction == WRITE and len(data) > 2:
            error = self._write(int.from_bytes(data[:2], "little"), data[2:])
            yield from self._told(2, error)
        elif instruction == REG_WRITE and len(data) > 2:
            self._registered = int.from_bytes(data[:2], "little"), data[2:]
            self.table.set(c.REGISTERED, 1)
            yield from self._told(2, 0)
        elif instruction == ACTION:
            error = self._write(*self._registered) if self._registered else 0
            self._registered = None
            self.table.set(c.REGISTERED, 0)
            yield from self._told(2, error)
        elif instruction == FACTORY_RESET and data[:1] in (b"\xff", b"\x01", b"\x02"):
            yield from self._told(2, 0)
            self._forget(*{0xFF: (t.ID, c.BAUD_RATE), 1: (c.BAUD_RATE,), 2: ()}[data[0]])
            self.reboot()
        elif instruction == REBOOT:
            yield from self._told(2, 0)
            self.reboot()
            self._away = REBOOT_TIME
        elif instruction == CLEAR and data in (CLEAR_TURNS, CLEAR_ERRORS):
            if data == CLEAR_TURNS:
                self._turns = -((round(self.motor.position / t.COUNT) + t.CENTRE) // TURN)
            elif not self.persists:
                self.table.set(t.ERROR, 0)
            yield from self._told(2, 0)
        else:
            yield from self._told(2, BAD_INSTRUCTION)

    def _about(self) -> bytes:
        return bytes(self.table.bytes[0:2] + self.table.bytes[6:7])

    def _told(self, level: int, error: int, data: bytes = b"") -> Iterator[bytes]:
        """A status, where its level of answers has one for this."""
        if self.table.get(c.RETURN_LEVEL) >= level:
            yield self._status(error, data)

    def _status(self, error: int, data: bytes = b"") -> bytes:
        alert = ALERT if self.table.get(t.ERROR) else 0
        return packed(self._asked, STATUS, bytes([error | alert]) + data)

    def _read(self, address: int, length: int) -> tuple[int, bytes]:
        if address + length > c.SIZE:
            return NO_ACCESS, b""
        self._refresh()
        places = (self._direct(address + k) for k in range(length))
        return 0, bytes(self.table.bytes[place] for place in places)

    def _direct(self, address: int) -> int:
        """Indirect data are those at their addresses."""
        pointer = c.POINTERS.get(address)
        return self.table.get(pointer) if pointer is not None else address

    def _write(self, address: int, data: bytes) -> int:
        """Write all of the items, or none; the error."""
        places = {self._direct(address + k): byte for k, byte in enumerate(data)}
        rows = {c.OF[place].item.address: c.OF[place] for place in places if place in c.OF}
        if any(place not in c.OF for place in places):
            return NO_ACCESS
        for row in rows.values():
            whole = range(row.item.address, row.item.address + row.item.length)
            if any(place not in places for place in whole):
                return BAD_LENGTH
            value = row.parse(bytes(places[place] for place in whole))
            if error := self._refusal(row, value):
                return error
        on = self.table.get(t.TORQUE)
        if min(places) < c.RAM:
            self._away = max(self._away, self.storing)
        for place, byte in places.items():
            self.table.bytes[place] = byte
        if t.TORQUE.address in places and self.table.get(t.TORQUE) and not on:
            self.table.set(t.GOAL_POSITION, self._count())
            self._profile = float(self._count())
        if t.MODE.address in places:
            self._reset_goals()
            for row in c.OF_MODE:
                self.table.set(row.item, row.value)
        return 0

    def _refusal(self, row: c.Row, value: int) -> int:
        """The error of a write to an item; 0: it is accepted."""
        item, table = row.item, self.table
        stored = item.address < c.RAM or any(
            first <= item.address < first + 2 * c.COUNT for first, _ in c.BLOCKS
        )
        tripped = item.address in GOALS and table.get(t.WATCHDOG) == t.TRIPPED
        if not row.writable or tripped or (stored and table.get(t.TORQUE)):
            return NO_ACCESS
        if item in c.BOUNDS:
            return BEYOND_LIMIT if abs(value) > table.get(c.BOUNDS[item]) else 0
        if not row.low <= value <= row.high or (item == t.MODE and value not in c.MODES):
            return BEYOND_RANGE
        if item == t.GOAL_POSITION and table.get(t.MODE) == t.POSITION_MODE:
            low, high = (table.get(end, signed=True) for end in (t.MIN_POSITION, t.MAX_POSITION))
            return 0 if low <= value <= high else BEYOND_LIMIT
        return FAILED if item == t.TORQUE and value and table.get(t.ERROR) else 0

    def _reset_goals(self) -> None:
        """A change of mode, and a start, give all that the limits allow."""
        for goal, limit in c.BOUNDS.items():
            self.table.set(goal, 0 if goal == t.GOAL_VELOCITY else self.table.get(limit))

    @property
    def _way(self) -> int:
        return -1 if self.table.get(c.DRIVE_MODE) & 1 else 1

    def _refresh(self) -> None:
        current = self._way * round(self.torque / self.motor.constant / MODEL.ampere)
        self.table.set(t.CURRENT, max(-32768, min(32767, current)))
        self.table.set(c.PRESENT_PWM, self._way * round(self.motor.duty * t.FULL_PWM))
        self.table.set(t.VELOCITY, self._way * round(self.motor.velocity / t.SPEED))
        self.table.set(t.POSITION, self._count())
        self.table.set(t.VOLTAGE, round(self.motor.supply / t.VOLT))
        self.table.set(t.TEMPERATURE, 30)

    def _count(self) -> int:
        count = round(self.motor.position / t.COUNT) + TURN * self._turns
        return self._way * count + t.CENTRE + self.table.get(c.HOMING, signed=True)

    def _place(self, count: float) -> float:
        """The position of a count, rad."""
        count = self._way * (count - t.CENTRE - self.table.get(c.HOMING, signed=True))
        return (count - TURN * self._turns) * t.COUNT

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self.motor.position, self.motor.velocity = position, velocity
        self._away = max(0.0, self._away - seconds)
        self._quiet += seconds
        self._check_supply()
        watch, on = self.table.get(t.WATCHDOG), self.table.get(t.TORQUE)
        if on and 0 < watch < t.TRIPPED and self._quiet > watch * t.WATCHDOG_STEP:
            self.table.set(t.WATCHDOG, t.TRIPPED)
            self._hold = position
        if on:
            most = abs(self.table.get(t.GOAL_PWM, signed=True)) / t.FULL_PWM
            self.torque = self.motor.torque(self._duty(seconds), most)
        else:
            self._loop.rest()
            self.motor.duty = self.torque = 0.0
        return self.torque

    def _check_supply(self) -> None:
        """Beyond its limits, an error until it restarts (e-manual, Hardware Error Status)."""
        volts, table = round(self.motor.supply / t.VOLT), self.table
        if not table.get(c.MIN_VOLTAGE) <= volts <= table.get(c.MAX_VOLTAGE):
            table.set(t.ERROR, table.get(t.ERROR) | INPUT_VOLTAGE)
            if table.get(c.SHUTDOWN) & INPUT_VOLTAGE:
                table.set(t.TORQUE, 0)

    def _duty(self, seconds: float) -> float:
        """What the loop of its mode asks for, as a share of the supply."""
        table, motor, loop = self.table, self.motor, self._loop
        mode, stopped = table.get(t.MODE), table.get(t.WATCHDOG) == t.TRIPPED
        amps = table.get(t.GOAL_CURRENT, signed=True) * MODEL.ampere
        if mode == t.VELOCITY_MODE:
            goal = 0 if stopped else self._way * table.get(t.GOAL_VELOCITY, signed=True)
            return loop.duty(goal - motor.velocity / t.SPEED, *c.gains(table, c.VELOCITY_GAINS))
        if mode == t.CURRENT_MODE or (mode == t.PWM_MODE and stopped):
            return motor.duty_of(0.0 if stopped else self._way * amps)
        if mode == t.PWM_MODE:
            return self._way * table.get(t.GOAL_PWM, signed=True) / t.FULL_PWM
        error = (self._hold if stopped else self._goal(seconds)) - motor.position
        duty = loop.duty(error / t.COUNT, *c.gains(table, c.POSITION_GAINS))
        if mode in (t.POSITION_MODE, t.EXTENDED):
            return duty
        return max(motor.duty_of(-abs(amps)), min(motor.duty_of(abs(amps)), duty))

    def _goal(self, seconds: float) -> float:
        """Where its profile is on the way to the goal, rad."""
        goal = self.table.get(t.GOAL_POSITION, signed=True)
        if speed := self.table.get(c.PROFILE_VELOCITY):
            step = speed * t.SPEED * seconds / t.COUNT
            self._profile += max(-step, min(step, goal - self._profile))
            return self._place(self._profile)
        self._profile = float(goal)
        return self._place(goal)


def _places(data: bytes) -> tuple[int, int]:
    return int.from_bytes(data[:2], "little"), int.from_bytes(data[2:4], "little")


def virtual_drive(axis: Axis, joint: JointConfig | None) -> VirtualDynamixel:
    made = VirtualDynamixel(axis.id)
    if joint is not None:
        made.motor.fit(joint, axis.ratio)
        made.table.set(c.MIN_VOLTAGE, int(0.8 * made.motor.supply / t.VOLT))
        made.table.set(c.MAX_VOLTAGE, int(1.2 * made.motor.supply / t.VOLT))
        most = min(32767, int(joint.limits.peak_current / MODEL.ampere))
        made.table.set(t.CURRENT_LIMIT, most)
        made.table.set(t.VELOCITY_LIMIT, int(1.5 * joint.limits.velocity * axis.ratio / t.SPEED))
    return made


def virtual_bus(world: World, drives: Sequence[VirtualDynamixel]) -> VirtualSerialBus:
    return VirtualSerialBus(world, drives, Framer(HEADER, 7, length_of, unpacked))

# SPDX-License-Identifier: Apache-2.0
"""A virtual Dynamixel X: protocol 2, control table, operating modes, watchdog, hardware errors.

Written from the published protocol and control table, the driver's library left aside: its
checksum and its byte stuffing are of their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ...core.config.config import JointConfig
from ..drives.axes import Axis
from ..drives.serial_line import Item
from ..virtual.pty_bus import VirtualSerialBus
from ..virtual.servo import BROADCAST, Framer, Packet, ServoMotor, Table
from ..virtual.world import World
from . import table as t

HEADER, STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"
PING, READ, WRITE, REBOOT, STATUS = 0x01, 0x02, 0x03, 0x08, 0x55
SYNC_READ, SYNC_WRITE = 0x82, 0x83
FAILED, BAD_INSTRUCTION, NO_ACCESS, ALERT = 1, 2, 7, 0x80
GOALS = range(t.GOAL_PWM.address, t.GOAL_POSITION.address + 4)
EEPROM = 64
REBOOT_TIME = 0.01
NUMBER = 1020
MODEL = t.MODELS[NUMBER]


def checksum(data: bytes) -> int:
    """CRC-16, polynomial 0x8005, highest bit first, from 0."""
    value = 0
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x8005 if value & 0x8000 else value << 1) & 0xFFFF
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
    """One servo of MODEL; see ``virtual.world.VirtualDrive``.

    Attributes: table (its control table), motor (with its loops).
    """

    def __init__(self, drive: int) -> None:
        self.id, self.silent, self.persists = drive, False, 0
        self.motor = ServoMotor(constant=1.8, resistance=5.0, supply=12.0)
        self.table = Table(1024)
        for item, value in (
            (t.MODEL, NUMBER),
            (t.FIRMWARE, 45),
            (t.ID, drive),
            (t.MODE, t.POSITION_MODE),
            (t.PWM_LIMIT, t.FULL_PWM),
            (t.CURRENT_LIMIT, 1193),
            (t.VELOCITY_LIMIT, 200),
            (t.MAX_POSITION, 4095),
        ):
            self.table.set(item, value)
        self.torque = 0.0
        self.reboot()

    def reboot(self) -> None:
        self.table.bytes[EEPROM:] = bytes(len(self.table.bytes) - EEPROM)
        for k in range(28):
            self.table.set(Item(t.INDIRECT + 2 * k, 2), t.DATA + k)
        self._quiet, self._away = 0.0, 0.0
        self._hold = 0.0
        if self.persists:
            self.fail(self.persists, persists=True)

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.persists = code if persists else 0
        self.table.set(t.ERROR, code)
        self.table.set(t.TORQUE, 0)

    def on_packet(self, packet: Packet) -> Iterator[bytes]:
        drive, instruction, data = packet
        if self.silent or self._away > 0.0 or drive not in (self.id, BROADCAST):
            return
        self._quiet = 0.0
        if instruction == PING:
            about = self.table.bytes[0:2] + self.table.bytes[6:7]
            yield self._status(0, bytes(about))
        elif instruction == READ and drive == self.id and len(data) == 4:
            yield self._status(0, self._read(*_places(data)))
        elif instruction == WRITE and len(data) > 2:
            error = self._write(int.from_bytes(data[:2], "little"), data[2:])
            if drive == self.id:
                yield self._status(error)
        elif instruction == REBOOT and drive == self.id:
            yield self._status(0)
            self.reboot()
            self._away = REBOOT_TIME
        elif instruction == SYNC_READ and self.id in data[4:]:
            yield self._status(0, self._read(*_places(data)))
        elif instruction == SYNC_WRITE and len(data) > 4:
            address, length = _places(data)
            for place in range(4, len(data) - length, length + 1):
                if data[place] == self.id:
                    self._write(address, data[place + 1 : place + 1 + length])
        elif drive == self.id:
            yield self._status(BAD_INSTRUCTION)

    def _status(self, error: int, data: bytes = b"") -> bytes:
        alert = ALERT if self.table.get(t.ERROR) else 0
        return packed(self.id, STATUS, bytes([error | alert]) + data)

    def _read(self, address: int, length: int) -> bytes:
        self._refresh()
        return bytes(self.table.bytes[self._direct(address + k)] for k in range(length))

    def _direct(self, address: int) -> int:
        """Indirect data are those at their addresses."""
        number = address - t.DATA
        if 0 <= number < 28:
            return self.table.get(Item(t.INDIRECT + 2 * number, 2))
        return address

    def _write(self, address: int, data: bytes) -> int:
        if address < EEPROM and self.table.get(t.TORQUE):
            return NO_ACCESS
        if address in GOALS and self.table.get(t.WATCHDOG) == t.TRIPPED:
            return NO_ACCESS
        if t.INDIRECT <= address < t.INDIRECT + 56 and self.table.get(t.TORQUE):
            return NO_ACCESS
        if address == t.TORQUE.address and data[0] and self.table.get(t.ERROR):
            return FAILED
        on = self.table.get(t.TORQUE)
        self.table.bytes[address : address + len(data)] = data
        if address == t.TORQUE.address and data[0] and not on:
            self.table.set(t.GOAL_POSITION, self._count())
        if address == t.MODE.address:
            for goal in (t.GOAL_PWM, t.GOAL_CURRENT, t.GOAL_VELOCITY):
                self.table.set(goal, 0)
        return 0

    def _refresh(self) -> None:
        current = round(self.torque / self.motor.constant / MODEL.ampere)
        self.table.set(t.CURRENT, max(-32768, min(32767, current)))
        self.table.set(t.VELOCITY, round(self.motor.velocity / t.SPEED))
        self.table.set(t.POSITION, self._count())
        self.table.set(t.VOLTAGE, round(self.motor.supply / t.VOLT))
        self.table.set(t.TEMPERATURE, 30)

    def _count(self) -> int:
        return round(self.motor.position / t.COUNT) + t.CENTRE

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self.motor.position, self.motor.velocity = position, velocity
        self._away = max(0.0, self._away - seconds)
        self._quiet += seconds
        watch = self.table.get(t.WATCHDOG)
        on = self.table.get(t.TORQUE)
        if on and 0 < watch < t.TRIPPED and self._quiet > watch * t.WATCHDOG_STEP:
            self.table.set(t.WATCHDOG, t.TRIPPED)
            self._hold = position
        most = self.table.get(t.CURRENT_LIMIT) * MODEL.ampere * self.motor.constant
        torque = self._torque() if on else 0.0
        self.torque = max(-most, min(most, torque))
        return self.torque

    def _torque(self) -> float:
        table, motor = self.table, self.motor
        mode, stopped = table.get(t.MODE), table.get(t.WATCHDOG) == t.TRIPPED
        if mode == t.VELOCITY_MODE:
            goal = table.get(t.GOAL_VELOCITY, signed=True) * t.SPEED
            return motor.towards_velocity(0.0 if stopped else goal)
        if mode in (t.CURRENT_MODE, t.PWM_MODE) and stopped:
            return 0.0
        if mode == t.CURRENT_MODE:
            amps = table.get(t.GOAL_CURRENT, signed=True) * MODEL.ampere
            return amps * motor.constant
        if mode == t.PWM_MODE:
            return motor.at_output(table.get(t.GOAL_PWM, signed=True) / t.FULL_PWM)
        goal = (table.get(t.GOAL_POSITION, signed=True) - t.CENTRE) * t.COUNT
        return motor.towards_position(self._hold if stopped else goal)


def _places(data: bytes) -> tuple[int, int]:
    return int.from_bytes(data[:2], "little"), int.from_bytes(data[2:4], "little")


def virtual_drive(axis: Axis, joint: JointConfig | None) -> VirtualDynamixel:
    made = VirtualDynamixel(axis.id)
    if joint is not None:
        made.motor.fit(joint, axis.ratio)
        most = min(32767, int(joint.limits.peak_current / MODEL.ampere))
        made.table.set(t.CURRENT_LIMIT, most)
        made.table.set(t.VELOCITY_LIMIT, int(1.5 * joint.limits.velocity * axis.ratio / t.SPEED))
    return made


def virtual_bus(world: World, drives: Sequence[VirtualDynamixel]) -> VirtualSerialBus:
    return VirtualSerialBus(world, drives, Framer(HEADER, 7, length_of, unpacked))

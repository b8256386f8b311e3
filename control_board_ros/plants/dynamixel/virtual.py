# SPDX-License-Identifier: Apache-2.0
"""A virtual Dynamixel X: protocol 2, control table, operating modes, watchdog, hardware errors.

Written from the published protocol and control table, the driver's library left aside: its
checksum and its byte stuffing are of their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from ...core.config.config import JointConfig
from ..drives.axes import Axis
from ..drives.serial_line import Item
from ..virtual.pty_bus import VirtualSerialBus
from ..virtual.world import World
from . import table as t

HEADER, STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"
PING, READ, WRITE, REBOOT, STATUS = 0x01, 0x02, 0x03, 0x08, 0x55
SYNC_READ, SYNC_WRITE = 0x82, 0x83
BROADCAST = 254
FAILED, BAD_INSTRUCTION, BAD_LENGTH, NO_ACCESS, ALERT = 1, 2, 5, 7, 0x80
GOALS = range(t.GOAL_PWM.address, t.GOAL_POSITION.address + 4)
EEPROM = 64
REBOOT_TIME = 0.01


class Packet(NamedTuple):
    """An instruction: whom it is for, what, and its parameters."""

    drive: int
    instruction: int
    parameters: bytes


def checksum(data: bytes) -> int:
    """CRC-16, polynomial 0x8005, highest bit first, from 0."""
    value = 0
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x8005 if value & 0x8000 else value << 1) & 0xFFFF
    return value


def packed(drive: int, instruction: int, parameters: bytes) -> bytes:
    """A packet as it goes over the wire."""
    body = (bytes([instruction]) + parameters).replace(HEADER, STUFFED)
    whole = HEADER + bytes([0, drive]) + (len(body) + 2).to_bytes(2, "little") + body
    return whole + checksum(whole).to_bytes(2, "little")


class Framer:
    """Finds packets among bytes; see ``virtual.pty_bus.Framer``."""

    def __init__(self) -> None:
        self._bytes = b""

    def drop(self) -> None:
        """The line was quiet: what is left of a packet is none, as a servo decides by time."""
        self._bytes = b""

    def feed(self, data: bytes) -> Iterator[Packet]:
        """The packets that are whole now."""
        self._bytes += data
        while (start := self._bytes.find(HEADER)) >= 0:
            found = self._bytes[start:]
            if len(found) < 7 or len(found) < (end := 7 + int.from_bytes(found[5:7], "little")):
                self._bytes = found if len(found) < 512 else b""
                return
            if end >= 10 and checksum(found[: end - 2]) == int.from_bytes(
                found[end - 2 : end], "little"
            ):
                body = found[7 : end - 2].replace(STUFFED, HEADER)
                yield Packet(found[4], body[0], body[1:])
                self._bytes = found[end:]
            else:
                self._bytes = found[1:]
        self._bytes = self._bytes[-2:]


class VirtualDynamixel:
    """One servo.

    Args:
        drive: Its id.
        model: Its number.
        torque_constant: At its output, N·m/A.
        resistance: Of its winding, Ω.

    Attributes:
        table: Its control table.
        stiffness, damping: Of its position loop, N·m/rad and N·m·s/rad; its velocity loop has
            the damping.
        silent: It answers to nothing.
        torque: At its output now, N·m.
    """

    SOME_FAULT = 32

    def __init__(
        self,
        drive: int,
        model: int = 1020,
        torque_constant: float = 1.8,
        resistance: float = 5.0,
        supply: float = 12.0,
    ) -> None:
        self.id, self._model, self.silent, self.persists = drive, t.MODELS[model], False, 0
        self._constant, self._resistance, self.supply = torque_constant, resistance, supply
        self.stiffness, self.damping = 60.0, 3.0
        self._stored = bytearray(EEPROM)
        self.table = bytearray(1024)
        for item, value in (
            (t.MODEL, model),
            (t.FIRMWARE, 45),
            (t.ID, drive),
            (t.MODE, t.POSITION_MODE),
            (t.CURRENT_LIMIT, 1193),
            (t.VELOCITY_LIMIT, 200),
            (t.MAX_POSITION, 4095),
        ):
            self._set(item, value)
        self.torque = self._position = self._velocity = 0.0
        self._restart()

    def _restart(self) -> None:
        """As after its supply was gone: the RAM area is as the maker made it."""
        self.table[EEPROM:] = bytes(len(self.table) - EEPROM)
        for k in range(28):
            self._set(Item(t.INDIRECT + 2 * k, 2), self._model.data + k)
        self._quiet, self._away = 0.0, 0.0
        self._hold = 0.0
        if self.persists:
            self.fail(self.persists, persists=True)

    def reboot(self) -> None:
        """Its supply was gone for a moment."""
        self._restart()

    def fail(self, code: int, *, persists: bool = False) -> None:
        """A hardware error; it shuts down. One that persists is there again after a restart."""
        self.persists = code if persists else 0
        self._set(t.ERROR, code)
        self._set(t.TORQUE, 0)

    def heal(self) -> None:
        """The cause is gone; the error stays until a restart."""
        self.persists = 0

    # --- the wire ---------------------------------------------------------------------------

    def on_packet(self, packet: Packet) -> Iterator[bytes]:
        """The status packets that it answers with."""
        drive, instruction, data = packet
        if self.silent or self._away > 0.0 or drive not in (self.id, BROADCAST):
            return
        self._quiet = 0.0
        if instruction == PING:
            about = self.table[0:2] + self.table[6:7]
            yield self._status(0, bytes(about))
        elif instruction == READ and drive == self.id and len(data) == 4:
            yield self._status(0, self._read(*_places(data)))
        elif instruction == WRITE and len(data) > 2:
            error = self._write(int.from_bytes(data[:2], "little"), data[2:])
            if drive == self.id:
                yield self._status(error)
        elif instruction == REBOOT and drive == self.id:
            yield self._status(0)
            self._restart()
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
        alert = ALERT if self._get(t.ERROR) else 0
        return packed(self.id, STATUS, bytes([error | alert]) + data)

    def _read(self, address: int, length: int) -> bytes:
        self._refresh()
        return bytes(self.table[self._direct(address + k)] for k in range(length))

    def _direct(self, address: int) -> int:
        """Indirect data are those at their addresses."""
        number = address - self._model.data
        if 0 <= number < 28:
            return self._get(Item(t.INDIRECT + 2 * number, 2))
        return address

    def _write(self, address: int, data: bytes) -> int:
        if address < EEPROM and self._get(t.TORQUE):
            return NO_ACCESS
        if address in GOALS and self._get(t.WATCHDOG) == t.TRIPPED:
            return NO_ACCESS
        if t.INDIRECT <= address < t.INDIRECT + 56 and self._get(t.TORQUE):
            return NO_ACCESS
        if address == t.TORQUE.address and data[0] and self._get(t.ERROR):
            return FAILED
        on = self._get(t.TORQUE)
        self.table[address : address + len(data)] = data
        if address == t.TORQUE.address and data[0] and not on:
            self._set(t.GOAL_POSITION, self._count())
        if address == t.MODE.address:
            for goal in (t.GOAL_PWM, t.GOAL_CURRENT, t.GOAL_VELOCITY):
                self._set(goal, 0)
        return 0

    def _refresh(self) -> None:
        """Readings into the table."""
        if not self._model.ampere:
            current = round(self.torque / self._constant * 100.0)
        else:
            current = round(self.torque / self._constant / self._model.ampere)
        self._set(t.CURRENT, max(-32768, min(32767, current)))
        self._set(t.VELOCITY, round(self._velocity / t.SPEED))
        self._set(t.POSITION, self._count())
        self._set(t.VOLTAGE, round(self.supply / t.VOLT))
        self._set(t.TEMPERATURE, 30)

    def _count(self) -> int:
        return round(self._position / t.COUNT) + t.CENTRE

    def _get(self, item: Item) -> int:
        data = self.table[item.address : item.address + item.length]
        signed = item in (t.GOAL_PWM, t.GOAL_CURRENT) or item.length == 4
        return int.from_bytes(data, "little", signed=signed)

    def _set(self, item: Item, value: int) -> None:
        data = (value % (1 << 8 * item.length)).to_bytes(item.length, "little")
        self.table[item.address : item.address + item.length] = data

    # --- the loops --------------------------------------------------------------------------

    def step(self, seconds: float, position: float, velocity: float) -> float:
        """The torque at its output, N·m; see ``virtual.world.VirtualDrive``."""
        self._position, self._velocity = position, velocity
        self._away = max(0.0, self._away - seconds)
        self._quiet += seconds
        watch = self._get(t.WATCHDOG)
        on = self._get(t.TORQUE)
        if on and 0 < watch < t.TRIPPED and self._quiet > watch * t.WATCHDOG_STEP:
            self._set(t.WATCHDOG, t.TRIPPED)
            self._hold = position
        most = self._get(t.CURRENT_LIMIT) * (self._model.ampere or 1e-2) * self._constant
        torque = self._torque() if on else 0.0
        self.torque = max(-most, min(most, torque))
        return self.torque

    def _torque(self) -> float:
        mode, stopped = self._get(t.MODE), self._get(t.WATCHDOG) == t.TRIPPED
        if mode == t.CURRENT_MODE:
            return (
                0.0 if stopped else self._get(t.GOAL_CURRENT) * self._model.ampere * self._constant
            )
        if mode == t.PWM_MODE:
            if stopped:
                return 0.0
            volts = self._get(t.GOAL_PWM) / t.FULL_PWM * self.supply
            amps = (volts - self._constant * self._velocity) / self._resistance
            return self._constant * amps
        if mode == t.VELOCITY_MODE:
            goal = 0.0 if stopped else self._get(t.GOAL_VELOCITY) * t.SPEED
            return self.damping * (goal - self._velocity)
        goal = self._hold if stopped else (self._get(t.GOAL_POSITION) - t.CENTRE) * t.COUNT
        return self.stiffness * (goal - self._position) - self.damping * self._velocity


def _places(data: bytes) -> tuple[int, int]:
    return int.from_bytes(data[:2], "little"), int.from_bytes(data[2:4], "little")


def virtual_drive(axis: Axis, joint: JointConfig | None) -> VirtualDynamixel:
    """A servo that fits a joint, tuned by the joint's own gains."""
    if joint is None:
        return VirtualDynamixel(axis.id)
    motor, ratio = joint.motor, axis.ratio
    made = VirtualDynamixel(
        axis.id,
        torque_constant=motor.torque_per_ampere / ratio,
        resistance=motor.resistance,
        supply=motor.supply_voltage,
    )
    made.stiffness = joint.position_pid.kp / ratio**2
    made.damping = joint.position_pid.kd / ratio**2
    made._set(t.CURRENT_LIMIT, min(32767, int(joint.limits.peak_current / 2.69e-3)))
    made._set(t.VELOCITY_LIMIT, int(1.5 * joint.limits.velocity * ratio / t.SPEED))
    return made


def virtual_bus(world: World, drives: Sequence[VirtualDynamixel]) -> VirtualSerialBus:
    """The servos on a pseudo terminal."""
    return VirtualSerialBus(world, drives, Framer())

# SPDX-License-Identifier: Apache-2.0
"""A virtual Feetech STS: its protocol, memory table, operating modes, protections.

Written from the published protocol and memory table, the driver's library left aside.
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

HEADER = b"\xff\xff"
PING, READ, WRITE, SYNC_READ, SYNC_WRITE = 0x01, 0x02, 0x03, 0x82, 0x83
BROADCAST = 254
STORED = 40


class Packet(NamedTuple):
    """An instruction: whom it is for, what, and its parameters."""

    drive: int
    instruction: int
    parameters: bytes


def packed(drive: int, code: int, parameters: bytes) -> bytes:
    """A packet as it goes over the wire."""
    body = bytes([drive, len(parameters) + 2, code]) + parameters
    return HEADER + body + bytes([~sum(body) & 0xFF])


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
            if len(found) < 4 or len(found) < (end := 4 + found[3]):
                self._bytes = found if len(found) < 512 else b""
                return
            if end >= 6 and ~sum(found[2 : end - 1]) & 0xFF == found[end - 1]:
                yield Packet(found[2], found[4], found[5 : end - 1])
                self._bytes = found[end:]
            else:
                self._bytes = found[1:]
        self._bytes = self._bytes[-1:]


class VirtualFeetech:
    """One servo.

    Args:
        drive: Its id.
        torque_constant: At its output, N·m/A.
        resistance: Of its winding, Ω.
        supply: V.

    Attributes:
        table: Its memory table.
        stiffness, damping: Of its position loop, N·m/rad and N·m·s/rad; its velocity loop has
            the damping.
        silent: It answers to nothing.
        torque: At its output now, N·m.
    """

    SOME_FAULT = 32

    def __init__(
        self,
        drive: int,
        torque_constant: float = 1.2,
        resistance: float = 3.0,
        supply: float = 12.0,
    ) -> None:
        self.id, self.silent, self.persists = drive, False, 0
        self._constant, self._resistance, self.supply = torque_constant, resistance, supply
        self.stiffness, self.damping = 60.0, 3.0
        self.table = bytearray(256)
        for item, value in (
            (t.FIRMWARE, 3 | 10 << 8),
            (t.MODEL, 777),
            (t.ID, drive),
            (t.CURRENT_LIMIT, 500),
            (t.SPEED_LIMIT, 254),
        ):
            self._set(item, value)
        self._stored = bytes(self.table[:STORED])
        self.torque = self._position = self._velocity = 0.0
        self.reboot()

    def reboot(self) -> None:
        """Its supply was gone for a moment: what is stored is there again, and no torque."""
        speed = self.table[t.SPEED_LIMIT.address]
        self.table[:STORED] = self._stored
        self.table[STORED:] = bytes(len(self.table) - STORED)
        self.table[t.SPEED_LIMIT.address] = speed
        self._set(t.STATUS, self.persists)

    def fail(self, code: int, *, persists: bool = False) -> None:
        """A protection disables it; one that persists is there again after each reset."""
        self.persists = code if persists else 0
        self._set(t.STATUS, code)
        self._set(t.TORQUE, 0)

    def heal(self) -> None:
        """The cause is gone; the error stays until its torque is switched off."""
        self.persists = 0

    # --- the wire ---------------------------------------------------------------------------

    def on_packet(self, packet: Packet) -> Iterator[bytes]:
        """The status packets that it answers with."""
        drive, instruction, data = packet
        if self.silent or drive not in (self.id, BROADCAST):
            return
        if instruction == PING:
            yield self._answer()
        elif instruction == READ and drive == self.id and len(data) == 2:
            yield self._answer(self._read(data[0], data[1]))
        elif instruction == WRITE and len(data) > 1:
            self._write(data[0], data[1:])
            if drive == self.id:
                yield self._answer()
        elif instruction == SYNC_READ and self.id in data[2:]:
            yield self._answer(self._read(data[0], data[1]))
        elif instruction == SYNC_WRITE and len(data) > 2:
            address, length = data[0], data[1]
            for place in range(2, len(data) - length, length + 1):
                if data[place] == self.id:
                    self._write(address, data[place + 1 : place + 1 + length])

    def _answer(self, data: bytes = b"") -> bytes:
        return packed(self.id, self._get(t.STATUS), data)

    def _read(self, address: int, length: int) -> bytes:
        for item, value in (
            (t.POSITION, t.magnitude(self._position / t.COUNT + t.CENTRE)),
            (t.VELOCITY, t.magnitude(self._velocity / t.COUNT)),
            (t.CURRENT, t.magnitude(self.torque / self._constant / t.AMPERE)),
            (t.VOLTAGE, round(self.supply / t.VOLT) & 0xFF),
            (t.TEMPERATURE, 30),
        ):
            self._set(item, value)
        return bytes(self.table[address : address + length])

    def _write(self, address: int, data: bytes) -> None:
        if address == t.TORQUE.address:
            if data[0] and self._get(t.STATUS):
                return
            if not data[0]:
                self._set(t.STATUS, self.persists)
        self.table[address : address + len(data)] = data
        if address < STORED and not self._get(t.LOCK):
            self._stored = bytes(self.table[:STORED])

    def _get(self, item: Item) -> int:
        return int.from_bytes(self.table[item.address : item.address + item.length], "little")

    def _set(self, item: Item, value: int) -> None:
        data = value.to_bytes(item.length, "little")
        self.table[item.address : item.address + item.length] = data

    # --- the loops --------------------------------------------------------------------------

    def step(self, _seconds: float, position: float, velocity: float) -> float:
        """The torque at its output, N·m; see ``virtual.world.VirtualDrive``."""
        self._position, self._velocity = position, velocity
        most = self._get(t.CURRENT_LIMIT) * t.AMPERE * self._constant
        torque = self._torque() if self._get(t.TORQUE) else 0.0
        self.torque = max(-most, min(most, torque))
        return self.torque

    def _torque(self) -> float:
        goals = self._get(t.GOALS).to_bytes(6, "little")
        position, pwm, speed = (int.from_bytes(goals[k : k + 2], "little") for k in (0, 2, 4))
        mode = self._get(t.MODE)
        if mode == t.PWM_MODE:
            volts = t.signed(pwm, t.PWM_SIGN) / t.FULL_PWM * self.supply
            amps = (volts - self._constant * self._velocity) / self._resistance
            return self._constant * amps
        if mode == t.VELOCITY_MODE:
            return self.damping * (t.signed(speed) * t.COUNT - self._velocity)
        goal = (t.signed(position) - t.CENTRE) * t.COUNT
        return self.stiffness * (goal - self._position) - self.damping * self._velocity


def virtual_drive(axis: Axis, joint: JointConfig | None) -> VirtualFeetech:
    """A servo that fits a joint, tuned by the joint's own gains."""
    if joint is None:
        return VirtualFeetech(axis.id)
    motor, ratio = joint.motor, axis.ratio
    made = VirtualFeetech(
        axis.id, motor.torque_per_ampere / ratio, motor.resistance, min(25.5, motor.supply_voltage)
    )
    made.stiffness = joint.position_pid.kp / ratio**2
    made.damping = joint.position_pid.kd / ratio**2
    made._set(t.CURRENT_LIMIT, min(0xFFFF, int(joint.limits.peak_current / t.AMPERE)))
    made._stored = bytes(made.table[:STORED])
    return made


def virtual_bus(world: World, drives: Sequence[VirtualFeetech]) -> VirtualSerialBus:
    """The servos on a pseudo terminal."""
    return VirtualSerialBus(world, drives, Framer())

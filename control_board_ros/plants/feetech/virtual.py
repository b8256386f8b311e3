# SPDX-License-Identifier: Apache-2.0
"""A virtual Feetech STS: its protocol, memory table, operating modes, protections.

Written from the published protocol and memory table, the driver's library left aside.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ...core.config.config import JointConfig
from ..drives.axes import Axis
from ..virtual.pty_bus import VirtualSerialBus
from ..virtual.servo import BROADCAST, Framer, Packet, ServoMotor, Table
from ..virtual.world import World
from . import table as t

HEADER = b"\xff\xff"
PING, READ, WRITE, SYNC_READ, SYNC_WRITE = 0x01, 0x02, 0x03, 0x82, 0x83
STORED = 40


def packed(drive: int, code: int, parameters: bytes) -> bytes:
    body = bytes([drive, len(parameters) + 2, code]) + parameters
    return HEADER + body + bytes([~sum(body) & 0xFF])


def length_of(head: bytes) -> int:
    return 4 + head[3]


def unpacked(data: bytes) -> Packet | None:
    """The packet of these bytes, or None where its checksum is wrong."""
    if len(data) < 6 or ~sum(data[2:-1]) & 0xFF != data[-1]:
        return None
    return Packet(data[2], data[4], data[5:-1])


class VirtualFeetech:
    """One servo; see ``virtual.world.VirtualDrive``.

    Attributes: table (its memory), motor (with its loops).
    """

    def __init__(self, drive: int) -> None:
        self.id, self.silent, self.persists = drive, False, 0
        self.motor = ServoMotor(constant=1.2, resistance=3.0, supply=12.0)
        self.table = Table(256)
        for item, value in (
            (t.FIRMWARE, 3 | 10 << 8),
            (t.MODEL, 777),
            (t.ID, drive),
            (t.ANGULAR_RESOLUTION, 1),
            (t.CURRENT_LIMIT, 500),
            (t.SPEED_LIMIT, 254),
        ):
            self.table.set(item, value)
        self._stored = bytes(self.table.bytes[:STORED])
        self.torque = 0.0
        self.reboot()

    def reboot(self) -> None:
        speed = self.table.bytes[t.SPEED_LIMIT.address]
        self.table.bytes[:STORED] = self._stored
        self.table.bytes[STORED:] = bytes(len(self.table.bytes) - STORED)
        self.table.bytes[t.SPEED_LIMIT.address] = speed
        self.table.set(t.STATUS, self.persists)

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.persists = code if persists else 0
        self.table.set(t.STATUS, code)
        self.table.set(t.TORQUE, 0)

    def on_packet(self, packet: Packet) -> Iterator[bytes]:
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
        return packed(self.id, self.table.get(t.STATUS), data)

    def _read(self, address: int, length: int) -> bytes:
        for item, value in (
            (t.POSITION, t.magnitude(self.motor.position / t.COUNT + t.CENTRE)),
            (t.VELOCITY, t.magnitude(self.motor.velocity / t.COUNT)),
            (t.CURRENT, t.magnitude(self.torque / self.motor.constant / t.AMPERE)),
            (t.VOLTAGE, round(self.motor.supply / t.VOLT) & 0xFF),
            (t.TEMPERATURE, 30),
        ):
            self.table.set(item, value)
        return bytes(self.table.bytes[address : address + length])

    def _write(self, address: int, data: bytes) -> None:
        if address == t.TORQUE.address:
            if data[0] and self.table.get(t.STATUS):
                return
            if not data[0]:
                self.table.set(t.STATUS, self.persists)
        self.table.bytes[address : address + len(data)] = data
        if address < STORED and not self.table.get(t.LOCK):
            self._stored = bytes(self.table.bytes[:STORED])

    def step(self, _seconds: float, position: float, velocity: float) -> float:
        self.motor.position, self.motor.velocity = position, velocity
        most = self.table.get(t.CURRENT_LIMIT) * t.AMPERE * self.motor.constant
        torque = self._torque() if self.table.get(t.TORQUE) else 0.0
        self.torque = max(-most, min(most, torque))
        return self.torque

    def _torque(self) -> float:
        goals = self.table.get(t.GOALS).to_bytes(6, "little")
        position, pwm, speed = (int.from_bytes(goals[k : k + 2], "little") for k in (0, 2, 4))
        mode = self.table.get(t.MODE)
        if mode == t.PWM_MODE:
            return self.motor.at_output(t.signed(pwm, t.PWM_SIGN) / t.FULL_PWM)
        if mode == t.VELOCITY_MODE:
            return self.motor.towards_velocity(t.signed(speed) * t.COUNT)
        return self.motor.towards_position((t.signed(position) - t.CENTRE) * t.COUNT)


def virtual_drive(axis: Axis, joint: JointConfig | None) -> VirtualFeetech:
    made = VirtualFeetech(axis.id)
    if joint is not None:
        made.motor.fit(joint, axis.ratio)
        made.motor.supply = min(25.5, made.motor.supply)
        most = min(0xFFFF, int(joint.limits.peak_current / t.AMPERE))
        made.table.set(t.CURRENT_LIMIT, most)
        made._stored = bytes(made.table.bytes[:STORED])
    return made


def virtual_bus(world: World, drives: Sequence[VirtualFeetech]) -> VirtualSerialBus:
    return VirtualSerialBus(world, drives, Framer(HEADER, 4, length_of, unpacked))

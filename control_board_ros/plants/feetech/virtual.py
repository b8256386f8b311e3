# SPDX-License-Identifier: Apache-2.0
"""A virtual Feetech STS: its protocol, memory table, operating modes, protections.

Written from the published protocol and memory table, the driver's library left aside.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from ...core.config.config import JointConfig
from ..drives.axes import Axis
from ..virtual.pty_bus import VirtualSerialBus
from ..virtual.servo import BROADCAST, Framer, Loop, Packet, ServoMotor, Table
from ..virtual.world import World
from . import memory as m
from . import table as t

HEADER = b"\xff\xff"
PING, READ, WRITE, REG_WRITE, ACTION, FACTORY_RESET = 1, 2, 3, 4, 5, 6
SYNC_READ, SYNC_WRITE = 0x82, 0x83
TURN = 4096
#: Bit of its status for a supply beyond its limits.
VOLTAGE = 1
#: rad/s below which it reports that it does not move.
RESTING = 0.01
#: N·m/A and Ω of an STS3215 at 7.4 V, its dry friction, N·m, and its viscous, N·m·s/rad: Rhoban's
#: BAM, params/feetech_sts3215_7_4V/m1.json at 1b5a1ce.
CONSTANT, RESISTANCE, SUPPLY = 1.21164, 2.67617, 7.4
DRY, VISCOUS, SLIP = 0.0523930, 0.0590852, 0.02
#: Of the velocity loop, duty per rad/s and unit of P, and per rad and unit of I: assumed. What D,
#: I, dead zone and least force of that of positions do is not published.
VELOCITY_P, VELOCITY_I = 0.01, 0.01


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
    """An STS3215, as delivered but for its id; see ``virtual.world.VirtualDrive``.

    Attributes:
        table: Its memory.
        motor: At its output.
        dry, viscous: Friction of its gear, N·m and N·m·s/rad.
        goal_takes_power: A goal switches the torque on, as the author of feetech-cli 0.1.8
            measured on a servo (simulator.py); the memory table does not say it.
        storing: s for which it hears nothing after it stored a value; nobody publishes it.
    """

    def __init__(self, drive: int) -> None:
        self.silent, self.persists, self.goal_takes_power = False, 0, False
        self.storing = 0.0
        self.motor, self._loop = ServoMotor(CONSTANT, RESISTANCE, SUPPLY), Loop()
        self.dry, self.viscous = DRY, VISCOUS
        self.table = Table(256)
        self.torque = 0.0
        self._forget()
        self.table.set(t.ID, drive)
        self.store()
        self.reboot()

    @property
    def id(self) -> int:
        return self.table.get(t.ID)

    @property
    def baudrate(self) -> int:
        """At which it listens, bit/s."""
        return m.BAUDRATES[self.table.get(m.BAUD_RATE) & 7]

    def _forget(self) -> None:
        """The values of delivery."""
        self.table.bytes[:] = bytes(len(self.table.bytes))
        for item, value in m.DELIVERED.values():
            self.table.set(item, value)

    def store(self) -> None:
        """What it has in its stored area returns with the supply."""
        self._stored = bytes(self.table.bytes[: m.RAM])

    def reboot(self) -> None:
        speed = self.table.bytes[t.SPEED_LIMIT.address]
        self.table.bytes[: m.RAM] = self._stored
        self.table.bytes[m.RAM :] = bytes(len(self.table.bytes) - m.RAM)
        self.table.bytes[t.SPEED_LIMIT.address] = speed
        self.table.set(t.TORQUE_LIMIT, self.table.get(m.MAX_TORQUE))
        self.table.set(t.STATUS, self.persists)
        self._registered: tuple[int, bytes] | None = None
        self._profile, self._away = math.nan, 0.0
        self._loop.rest()

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.persists = code if persists else 0
        self.table.set(t.STATUS, code)
        self.table.set(t.TORQUE, 0)

    def turn(self, packet: Packet) -> int:
        """Its place among those that answer to a packet."""
        return packet.parameters[2:].find(self.id) if packet.instruction == SYNC_READ else self.id

    def on_packet(self, packet: Packet) -> Iterator[bytes]:
        drive, instruction, data = packet
        mine = drive == self.id
        if self.silent or self._away > 0.0 or not (mine or drive == BROADCAST):
            return
        if instruction == PING:
            yield self._answer()
        elif (instruction == READ and mine and len(data) == 2) or (
            instruction == SYNC_READ and self.id in data[2:]
        ):
            yield self._answer(self._read(data[0], data[1]))
        elif instruction == SYNC_WRITE and len(data) > 2:
            address, length = data[0], data[1]
            for place in range(2, len(data) - length, length + 1):
                if data[place] == self.id:
                    self._write(address, data[place + 1 : place + 1 + length])
        elif instruction in (WRITE, REG_WRITE, ACTION, FACTORY_RESET):
            answer = self._answer()  # of the id that was asked
            self._obey(instruction, data)
            if mine and self.table.get(m.RETURN_LEVEL):
                yield answer

    def _obey(self, instruction: int, data: bytes) -> None:
        if instruction == WRITE and len(data) > 1:
            self._write(data[0], data[1:])
        elif instruction == REG_WRITE and len(data) > 1:
            self._registered = data[0], data[1:]
        elif instruction == ACTION and self._registered is not None:
            self._write(*self._registered)
            self._registered = None
        elif instruction == FACTORY_RESET:
            self._forget()
            self.store()
            self.reboot()

    def _answer(self, data: bytes = b"") -> bytes:
        return packed(self.id, self.table.get(t.STATUS), data)

    def _read(self, address: int, length: int) -> bytes:
        for item, value in (
            (t.POSITION, t.magnitude(self._count())),
            (t.VELOCITY, t.magnitude(self.motor.velocity / t.COUNT)),
            (m.LOAD, t.magnitude(1000.0 * self.motor.duty, t.PWM_SIGN)),
            (t.CURRENT, t.magnitude(self.torque / self.motor.constant / t.AMPERE)),
            (m.MOVING, int(abs(self.motor.velocity) > RESTING)),
            (m.REGISTERED, int(self._registered is not None)),
            (t.VOLTAGE, round(self.motor.supply / t.VOLT) & 0xFF),
            (t.TEMPERATURE, 30),
        ):
            self.table.set(item, value)
        return bytes(self.table.bytes[address : address + length])

    def _raw(self) -> float:
        """The count of its encoder."""
        return self.motor.position / t.COUNT + t.CENTRE

    def _offset(self) -> int:
        return t.signed(self.table.get(t.HOMING), t.HOMING_SIGN)

    def _count(self) -> float:
        """What it reports: one turn, as soon as it has an offset."""
        offset = self._offset()
        return (self._raw() - offset) % TURN if offset else self._raw()

    def _write(self, address: int, data: bytes) -> None:
        table, places = self.table, range(address, address + len(data))
        wanted, on = dict(zip(places, data, strict=True)), table.get(t.TORQUE)
        switch = wanted.get(t.TORQUE.address)
        if switch == m.CALIBRATE:
            offset = round(self._raw() - t.CENTRE) % TURN
            offset -= TURN if offset > TURN // 2 else 0
            table.set(t.HOMING, t.magnitude(offset, t.HOMING_SIGN))
            self.store()
        elif switch == 0:
            table.set(t.STATUS, self.persists)
        for place, byte in wanted.items():
            if place in m.WRITABLE and (place, byte) != (t.TORQUE.address, m.CALIBRATE):
                table.bytes[place] = byte
        if self.goal_takes_power and t.GOALS.address in places:
            table.set(t.TORQUE, 1)
        if table.get(t.STATUS):
            table.set(t.TORQUE, 0)
        if table.get(t.TORQUE) and not on:
            self._profile = self._count()
        if address < m.RAM and not table.get(t.LOCK):
            self.store()
            self._away = self.storing

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self.motor.position, self.motor.velocity = position, velocity
        self._away = max(0.0, self._away - seconds)
        self._check_supply()
        most = min(t.MOST_DUTY, 1e-3 * self.table.get(t.TORQUE_LIMIT))
        duty = self._duty(seconds)
        if duty is None:
            self._loop.rest()
            self.motor.duty = self.torque = 0.0
        else:
            self.torque = self.motor.torque(duty, most)
        return self.torque - self.dry * math.tanh(velocity / SLIP) - self.viscous * velocity

    def _check_supply(self) -> None:
        """Memory table, 14, 15, 19 and 65: beyond its limits its status has bit 0; as delivered it
        keeps its torque.
        """
        volts, table = round(self.motor.supply / t.VOLT), self.table
        status = table.get(t.STATUS) & ~VOLTAGE | self.persists
        if not table.get(m.MIN_VOLTAGE) <= volts <= table.get(m.MAX_VOLTAGE):
            status |= VOLTAGE
            if table.get(m.UNLOADING) & VOLTAGE:
                table.set(t.TORQUE, 0)
        if status != table.get(t.STATUS):
            table.set(t.STATUS, status)

    def _duty(self, seconds: float) -> float | None:
        """What its loop asks for; None: its bridge is open."""
        table, motor = self.table, self.motor
        goals = table.get(t.GOALS).to_bytes(6, "little")
        position, pwm, speed = (int.from_bytes(goals[k : k + 2], "little") for k in (0, 2, 4))
        mode = table.get(t.MODE)
        if not table.get(t.TORQUE):
            return None
        if mode == t.PWM_MODE:
            return t.signed(pwm, t.PWM_SIGN) / t.FULL_PWM
        if mode == t.VELOCITY_MODE:
            error = t.signed(speed) * t.COUNT - motor.velocity
            p, i = VELOCITY_P * table.get(m.VELOCITY_P), VELOCITY_I * table.get(m.VELOCITY_I)
            return self._loop.duty(error, p, i * seconds)
        self._loop.rest()
        error = self._goal(t.signed(position), speed, seconds) - motor.position
        return t.GAIN * table.get(t.P) * error

    def _goal(self, goal: float, speed: int, seconds: float) -> float:
        """Where its profile is on the way to a goal within its limits, rad."""
        low, high = self.table.get(t.MIN_POSITION), self.table.get(t.MAX_POSITION)
        goal = max(low, min(high, goal)) if low < high else goal
        step = (speed or math.inf) * seconds
        self._profile += max(-step, min(step, goal - self._profile))
        offset = self._offset()
        turns = (self._raw() - offset) // TURN if offset else 0
        return (self._profile + TURN * turns + offset - t.CENTRE) * t.COUNT


def virtual_drive(axis: Axis, joint: JointConfig | None) -> VirtualFeetech:
    made = VirtualFeetech(axis.id)
    if joint is not None:
        made.motor.fit(joint, axis.ratio)
        made.motor.supply = min(25.5, made.motor.supply)
        made.table.set(m.MAX_VOLTAGE, 255)
        most = min(0xFFFF, int(joint.limits.peak_current / t.AMPERE))
        made.table.set(t.CURRENT_LIMIT, most)
        made.dry = made.viscous = 0.0  # those of the joint
        made.store()
    return made


def virtual_bus(world: World, drives: Sequence[VirtualFeetech]) -> VirtualSerialBus:
    return VirtualSerialBus(world, drives, Framer(HEADER, 4, length_of, unpacked))

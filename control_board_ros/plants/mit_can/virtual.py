# SPDX-License-Identifier: Apache-2.0
"""Virtual Damiao motors: MIT frames, registers, states, watchdog, faults."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator

from ...core.config.config import JointConfig
from ..virtual.can_bus import VirtualCanBus
from . import damiao as d
from . import frames as f
from . import robstride as r
from .registers import (
    BRIDGE_HEAT,
    GEAR,
    LEAST_SUPPLY,
    MOTOR_POSITION,
    OUTPUT_POSITION,
    POSITION_GAIN,
    REGISTERS,
    SPEED_GAIN,
    SUPPLY,
    WINDING_HEAT,
)  # fmt: skip
from .virtual_robstride import DELIVERED, SWITCHED, VirtualRobStride

LOST, UNDER_VOLTAGE = 0xD, 0x9
#: Laws beside MIT, each with frames of its own, 0x100 further than those of the law before; what
#: they hold: position, rad, and speed limit, rad/s; speed; position, speed limit, 0.01 rad/s, and
#: torque limit, 1e-4 of the range. MIT frames and orders have eight bytes.
VELOCITY, FORCE = 3, 4
FORMS = {d.MIT_MODE: "<8s", 2: "<ff", VELOCITY: "<f", FORCE: "<fHH"}
#: rad, of the encoder at its output.
TURN = 2.0 * math.pi
#: Before the first command with power: none.
STILL: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
#: N·m per rad/s at a gain of 1 of the speed loop.
DAMPING = 2500.0
USUAL = f.Ranges(12.5, 30.0, 10.0)


class VirtualMit:
    """A Damiao motor, as delivered but for its ranges; see ``virtual.world.VirtualDrive``.

    Attributes:
        state: As in its answers: disabled, enabled, or a fault.
        registers: By number, as they act now.
        stored: What of them returns with the supply.
    """

    def __init__(self, drive: int, ranges: f.Ranges = USUAL) -> None:
        self.silent, self.persists = False, 0
        self.stored = {number: register.value for number, register in REGISTERS.items()}
        own = (0x10 + drive, drive, *ranges[:3])
        self.stored |= zip((d.MST_ID, d.ESC_ID, *d.RANGES), own, strict=True)
        self._position = self._velocity = self._zero = 0.0
        self.reboot()

    @property
    def id(self) -> int:
        return int(self.registers[d.ESC_ID])

    @property
    def ranges(self) -> f.Ranges:
        """Those of its frames."""
        return f.Ranges(*(self.registers[register] for register in d.RANGES))

    def reboot(self) -> None:
        self.state = self.persists or d.DISABLED
        self.registers = dict(self.stored)
        self._zero += TURN * round(self._position / TURN)  # turns are not counted without supply
        self._command: tuple[float, ...] = STILL
        self._quiet = self.torque = 0.0

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.state, self.persists = code, code if persists else 0

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        if self.silent or len(data) > 8:
            return
        master, law = int(self.registers[d.MST_ID]), (frame_id >> 8) + 1
        if frame_id == d.REGISTERS:
            if len(data) >= 4 and int.from_bytes(data[:2], "little") == self.id:
                for answer in self._register(data[2], data[3], data[4:]):
                    yield master, answer
        elif (
            frame_id & 0xFF == self.id
            and law in FORMS
            and len(data) >= struct.calcsize(FORMS[law])
        ):
            self._quiet = 0.0
            self._obey(law, data)
            yield master, self._motion()

    def _register(self, order: int, number: int, data: bytes) -> Iterator[bytes]:
        """Answer to a frame of registers, with its order in place of a motion's position."""
        register = REGISTERS.get(number)
        if order == d.REFRESH:
            yield self._motion()
        elif order == d.STORE:
            if self.state == d.DISABLED:
                self.stored = dict(self.registers)
            yield self.id.to_bytes(2, "little") + bytes([d.STORE, 1, 0, 0, 0, 0])
        elif order in (d.GET, d.SET) and register is not None:
            head = self.id.to_bytes(2, "little") + bytes([order, number])
            if order == d.SET and register.writable and len(data) == 4:
                value = struct.unpack(f"<{register.form}", data)[0]
                if register.low <= value <= register.high:
                    self.registers[number] = value
                    self._command = STILL if number == d.CTRL_MODE else self._command
            value = self._value(number)
            number_of = int if register.form == "I" else float
            yield head + struct.pack(f"<{register.form}", number_of(value))

    def _value(self, number: int) -> float:
        if number == MOTOR_POSITION:
            return self._position * self.registers[GEAR]
        return self._position if number == OUTPUT_POSITION else self.registers[number]

    def _motion(self) -> bytes:
        moves = self._position, self._velocity, self.torque
        head = self.id & 0xF | self.state << 4
        heat = (int(self.registers[part]) for part in (BRIDGE_HEAT, WINDING_HEAT))
        return f.answer(self.ranges, head, *moves, bytes(heat))

    def _obey(self, law: int, data: bytes) -> None:
        fault = self.state not in (d.DISABLED, d.ENABLED)
        if data == f.ENABLE:
            if not fault:
                self.state, self._command = d.ENABLED, STILL
        elif data == f.DISABLE:
            if not fault:
                self.state = d.DISABLED
        elif data == f.CLEAR:
            if fault:
                self.state = self.persists or d.DISABLED
        elif data == f.ZERO:
            self._zero += self._position
            self._position = 0.0
        elif self.registers[d.CTRL_MODE] == law:
            if law == d.MIT_MODE:
                self._command = f.commanded(self.ranges, data)
            else:
                self._command = struct.unpack_from(FORMS[law], data)

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self._position, self._velocity = position - self._zero, velocity
        self._quiet += seconds
        if self.registers[SUPPLY] < self.registers[LEAST_SUPPLY] and self.state <= d.ENABLED:
            self.state = UNDER_VOLTAGE
        watch = self.registers[d.TIMEOUT] * d.TIMEOUT_STEP
        if self.state == d.ENABLED and 0.0 < watch < self._quiet:
            self.state = LOST
        self.torque = self._torque() if self.state == d.ENABLED else 0.0
        return self.torque

    def _torque(self) -> float:
        law, most = self.registers[d.CTRL_MODE], self.ranges.torque
        if self._command is STILL:
            return 0.0
        if law == d.MIT_MODE:
            return f.given(self.ranges, self._command, self._position, self._velocity)
        speed = self._command[0]
        if law != VELOCITY:
            error, limit = self._command[0] - self._position, self._command[1]
            limit = 0.01 * limit if law == FORCE else limit
            speed = max(-limit, min(limit, self.registers[POSITION_GAIN] * error))
        if law == FORCE:
            most *= min(1.0, 1e-4 * self._command[2])
        torque = DAMPING * self.registers[SPEED_GAIN] * (speed - self._velocity)
        return max(-most, min(most, torque))


def virtual_drive(axis: f.MitAxis, joint: JointConfig | None) -> VirtualMit | VirtualRobStride:
    """A motor of the joint's make; that of Damiao has ranges that fit the joint."""
    if axis.model != f.DAMIAO:
        mit = axis.protocol == f.MIT
        return VirtualRobStride(axis.id, r.ranges(axis), SWITCHED if mit else DELIVERED)
    if joint is None:
        return VirtualMit(axis.id)
    limits = joint.limits
    reach = max(abs(limits.hard_lower - axis.offset), abs(limits.hard_upper - axis.offset))
    return VirtualMit(
        axis.id,
        f.Ranges(
            1.2 * reach * axis.ratio,
            1.5 * limits.velocity * axis.ratio,
            1.2 * limits.torque / axis.ratio,
        ),
    )


virtual_bus = VirtualCanBus

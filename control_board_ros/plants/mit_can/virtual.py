# SPDX-License-Identifier: Apache-2.0
"""Virtual Damiao and RobStride motors: MIT frames, registers, states, watchdog, faults."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence

from ...core.config.config import JointConfig
from ..drives.axes import Axis
from ..virtual.can_bus import VirtualCanBus
from . import damiao as d
from . import frames as f
from . import robstride as r

LOST = 0xD
#: s of silence after which it stops, as it is stored by the maker's tool.
CAN_TIMEOUT = 1.0
USUAL = f.Ranges(12.5, 30.0, 10.0)


def given(ranges: f.Ranges, command: Sequence[float], position: float, velocity: float) -> float:
    """Torque of a motor that follows a command, N·m: τ + k (q - position) + d (q̇ - velocity)."""
    q, dq, k, damping, torque = command
    wanted = torque + k * (q - position) + damping * (dq - velocity)
    return max(-ranges.torque, min(ranges.torque, wanted))


class VirtualMit:
    """A Damiao motor; see ``virtual.world.VirtualDrive``.

    Attributes: state (as in its answers: disabled, enabled, or a fault).
    """

    def __init__(self, drive: int, ranges: f.Ranges = USUAL) -> None:
        self.id, self.ranges, self.silent, self.persists = drive, ranges, False, 0
        self._position = self._velocity = 0.0
        self.reboot()

    def reboot(self) -> None:
        self.state = self.persists or d.DISABLED
        self.registers: dict[int, float] = {
            d.MST_ID: 0x10 + self.id,
            d.ESC_ID: self.id,
            d.TIMEOUT: 0,
            d.CTRL_MODE: 2,
            d.SW_VER: 5013,
            d.PMAX: self.ranges.position,
            d.VMAX: self.ranges.velocity,
            d.TMAX: self.ranges.torque,
        }
        self._command = (0.0, 0.0, 0.0, 0.0, 0.0)
        self._quiet = self.torque = 0.0

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.state, self.persists = code, code if persists else 0

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        if self.silent or len(data) != 8:
            return
        master = int(self.registers[d.MST_ID])
        if frame_id == d.REGISTERS and data[:3] == d.refresh(self.id)[:3]:
            yield master, self._motion()
        elif frame_id == d.REGISTERS and data[0] == self.id and data[1] == 0:
            number = data[3]
            if number not in self.registers:
                return
            if data[2] == d.SET:
                kind = "<I" if number in d.WHOLE else "<f"
                self.registers[number] = struct.unpack(kind, data[4:])[0]
            value = self.registers[number]
            whole = number in d.WHOLE
            content = struct.pack("<I", int(value)) if whole else struct.pack("<f", value)
            yield master, data[:4] + content
        elif frame_id == self.id:
            self._quiet = 0.0
            self._obey(data)
            yield master, self._motion()

    def _motion(self) -> bytes:
        moves = self._position, self._velocity, self.torque
        head = self.id & 0xF | self.state << 4
        return f.answer(self.ranges, head, *moves, bytes([30, 35]))

    def _obey(self, data: bytes) -> None:
        fault = self.state not in (d.DISABLED, d.ENABLED)
        if data == f.ENABLE:
            if not fault:
                self.state, self._command = d.ENABLED, (0.0, 0.0, 0.0, 0.0, 0.0)
        elif data == f.DISABLE:
            if not fault:
                self.state = d.DISABLED
        elif data == f.CLEAR:
            if fault:
                self.state = self.persists or d.DISABLED
        elif self.registers[d.CTRL_MODE] == d.MIT_MODE:
            self._command = f.commanded(self.ranges, data)

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self._position, self._velocity = position, velocity
        self._quiet += seconds
        watch = self.registers[d.TIMEOUT] * d.TIMEOUT_STEP
        if self.state == d.ENABLED and 0.0 < watch < self._quiet:
            self.state = LOST
        on = self.state == d.ENABLED
        self.torque = given(self.ranges, self._command, position, velocity) if on else 0.0
        return self.torque


class VirtualRobStride:
    """A RobStride motor; see ``virtual.world.VirtualDrive``.

    Attributes: state (1 with power, else 0), faults (its word of faults).
    """

    def __init__(self, drive: int, ranges: f.Ranges) -> None:
        self.id, self.ranges, self.silent, self.persists = drive, ranges, False, 0
        self._position = self._velocity = 0.0
        self.reboot()

    def reboot(self) -> None:
        self.state, self.faults, self._mode = d.DISABLED, self.persists, 0
        self._command = (0.0, 0.0, 0.0, 0.0, 0.0)
        self._quiet = self.torque = 0.0

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.state, self.faults, self.persists = d.DISABLED, code, code if persists else 0

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        if self.silent or frame_id != self.id or len(data) != 8:
            return
        self._quiet = 0.0
        if data[:6] == b"\xff" * 6 and data[7] == f.CLEAR[7] and data[6] != 0xFF:
            yield r.MASTER, bytes([self.id]) + self.faults.to_bytes(4, "little") + bytes(3)
            return
        self._obey(data)
        moves = self._position, self._velocity, self.torque
        yield r.MASTER, f.answer(self.ranges, self.id, *moves, (300).to_bytes(2, "big"))

    def _obey(self, data: bytes) -> None:
        if data == f.ENABLE:
            if not self.faults:
                self.state, self._command = d.ENABLED, (0.0, 0.0, 0.0, 0.0, 0.0)
        elif data == f.DISABLE:
            self.state = d.DISABLED
        elif data == f.CLEAR:
            self.faults = self.persists
        elif data[:6] == b"\xff" * 6 and data[7] == f.ENABLE[7] and data[6] < 3:
            self._mode = data[6]
        elif self._mode == 0:
            self._command = f.commanded(self.ranges, data)

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self._position, self._velocity = position, velocity
        self._quiet += seconds
        if self._quiet > CAN_TIMEOUT:
            self.state = d.DISABLED
        on = self.state == d.ENABLED
        self.torque = given(self.ranges, self._command, position, velocity) if on else 0.0
        return self.torque


def virtual_drive(axis: Axis, joint: JointConfig | None) -> VirtualMit | VirtualRobStride:
    """A motor of the joint's make; that of Damiao has ranges that fit the joint."""
    if axis.own["model"] != f.DAMIAO:
        return VirtualRobStride(axis.id, r.ranges(axis))
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

# SPDX-License-Identifier: Apache-2.0
"""A virtual ODrive: CAN Simple, its states, cascaded loops, watchdog, limits, errors.

Written from the published protocol and controller; positions are in revolutions, as in the drive.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator

from ...core.config.config import JointConfig
from ..drives.axes import Axis
from ..drives.can_line import REMOTE
from ..virtual.can_bus import VirtualCanBus
from . import frames as f

REV = 2.0 * math.pi
FIRMWARE, HARDWARE = (0, 6, 11), (4, 4, 58)
PARAMETERS = f.KNOWN["0.6.11", "4.4"]
#: s between two heartbeats; s of a velocity over its limit until an error.
BEAT, TOLERANCE = 0.1, 1.2


class VirtualOdrive:
    """One axis; see ``virtual.world.VirtualDrive``.

    Args:
        drive: Its node id.
        torque_constant: At its output, N·m/A.

    Attributes:
        state, error: As its heartbeat reports them.
        conf: Its parameters by name.
        position_gain: 1/s.
        velocity_gain, integrator_gain: N·m/(rev/s), N·m/rev.
    """

    def __init__(self, drive: int, torque_constant: float = 0.5) -> None:
        self.id, self.silent, self.persists, self.supply = drive, False, 0, 24.0
        self.position_gain, self.velocity_gain, self.integrator_gain = 20.0, 18.0, 0.0
        self.stored = {
            f.WATCHDOG_TIMEOUT: 0.0,
            f.WATCHDOG_ENABLED: 0.0,
            f.SPEED_LIMIT: 20.0,
            f.CURRENT_LIMIT: 20.0,
            f.TORQUE_CONSTANT: torque_constant,
        }
        self._position = self._velocity = 0.0
        self.reboot()

    def reboot(self) -> None:
        self.conf = dict(self.stored)
        self.state, self.error, self._control = f.IDLE, self.persists, f.POSITION_CONTROL
        self._goal = self._speed = self._forward = self._integral = 0.0
        self._quiet = self._since = self.torque = 0.0

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.state, self.error, self.persists = f.IDLE, code, code if persists else 0

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        if self.silent:
            return
        if self._since >= BEAT:
            self._since = 0.0
            yield self.id << 5 | f.BEAT, self._answer(f.BEAT)
        remote, command = bool(frame_id & REMOTE), frame_id & 0x1F
        if (frame_id & 0x7FF) >> 5 != self.id:
            return
        if remote:
            if command in (f.VERSION, f.BEAT, f.ERROR, f.ESTIMATES, f.SUPPLY, f.TORQUES):
                yield self.id << 5 | command, self._answer(command)
        elif command == f.RX_SDO and len(data) >= 4:
            yield from self._parameter(data)
        else:
            self._obey(command, data)

    def _answer(self, command: int) -> bytes:
        if command == f.VERSION:
            return bytes([f.PROTOCOL, *HARDWARE, *FIRMWARE, 0])
        if command == f.BEAT:
            return struct.pack("<IBBBB", self.error, self.state, 0, 0, 0)
        if command == f.ERROR:
            return struct.pack("<II", self.persists, self.error)
        if command == f.ESTIMATES:
            return struct.pack("<ff", self._position, self._velocity)
        if command == f.SUPPLY:
            return struct.pack("<ff", self.supply, 0.0)
        return struct.pack("<ff", self.torque, self.torque)

    def _parameter(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        number = data[1] | data[2] << 8
        for name, endpoint in PARAMETERS.items():
            if endpoint.id != number:
                continue
            if data[0] == f.WRITE:
                self.conf[name] = float(struct.unpack_from(endpoint.form, data[4:])[0])
                self._quiet = 0.0
                return
            kind = float if endpoint.form == "<f" else int
            now = self._control if name == f.LAW else self.conf[name]
            value = struct.pack(endpoint.form, kind(now))
            yield self.id << 5 | f.TX_SDO, struct.pack("<BHB", 0, number, 0) + value

    def _obey(self, command: int, data: bytes) -> None:
        form = {f.STATE: "<I", f.MODE: "<II", f.INPUT_POSITION: "<fhh", f.INPUT_VELOCITY: "<ff",
                f.INPUT_TORQUE: "<f", f.CLEAR: "<B", f.REBOOT: "<B"}.get(command)  # fmt: skip
        if form is None or len(data) < struct.calcsize(form):
            return
        values = struct.unpack_from(form, data)
        if command == f.STATE:
            self._enter(values[0])
        elif command == f.MODE:
            self._control = values[0]
        elif command == f.CLEAR:
            self.error = self.persists
        elif command == f.REBOOT:
            self.reboot()
        else:
            self._quiet = 0.0
            if command == f.INPUT_POSITION:
                self._goal = values[0]
                self._speed, self._forward = (value / f.FEED_FORWARD for value in values[1:])
            elif command == f.INPUT_VELOCITY:
                self._speed, self._forward = values
            else:
                self._forward = values[0]

    def _enter(self, state: int) -> None:
        if state == f.IDLE:
            self.state = f.IDLE
        elif state == f.CLOSED_LOOP != self.state and not self.error:
            self.state, self._integral, self._quiet = state, 0.0, 0.0
            self._goal, self._speed, self._forward = self._position, 0.0, 0.0

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self._position, self._velocity = position / REV, velocity / REV
        self._since += seconds
        self._quiet += seconds
        if self.state == f.CLOSED_LOOP:
            if self.conf[f.WATCHDOG_ENABLED] and self._quiet > self.conf[f.WATCHDOG_TIMEOUT]:
                self.fail(f.WATCHDOG_EXPIRED)
            elif abs(self._velocity) > TOLERANCE * self.conf[f.SPEED_LIMIT]:
                self.fail(0x8000)
        most = self.conf[f.CURRENT_LIMIT] * self.conf[f.TORQUE_CONSTANT]
        wanted = self._loops(seconds) if self.state == f.CLOSED_LOOP else 0.0
        self.torque = max(-most, min(most, wanted))
        return self.torque

    def _loops(self, seconds: float) -> float:
        if self._control == f.TORQUE_CONTROL:
            return self._forward
        speed, most = self._speed, self.conf[f.SPEED_LIMIT]
        if self._control == f.POSITION_CONTROL:
            speed += self.position_gain * (self._goal - self._position)
        error = max(-most, min(most, speed)) - self._velocity
        self._integral += self.integrator_gain * error * seconds
        return self._forward + self.velocity_gain * error + self._integral


def virtual_drive(axis: Axis, joint: JointConfig | None) -> VirtualOdrive:
    if joint is None:
        return VirtualOdrive(axis.id)
    motor, ratio, gains, limits = joint.motor, axis.ratio, joint.position_pid, joint.limits
    made = VirtualOdrive(axis.id, motor.torque_per_ampere / ratio)
    made.supply = motor.supply_voltage
    made.velocity_gain = gains.kd * REV / ratio**2
    made.position_gain = gains.kp / gains.kd if gains.kd else 20.0
    made.integrator_gain = gains.ki * REV / ratio**2 / made.position_gain
    made.stored |= {
        f.SPEED_LIMIT: 1.5 * limits.velocity * ratio / REV,
        f.CURRENT_LIMIT: limits.peak_current,
    }
    made.reboot()
    return made


virtual_bus = VirtualCanBus

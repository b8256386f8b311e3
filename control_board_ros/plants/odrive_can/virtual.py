# SPDX-License-Identifier: Apache-2.0
"""A virtual ODrive: CAN Simple, its states, cascaded loops, watchdog, limits, errors.

Written from the maker's manual for firmware 0.6: "CAN Protocol" (manual/can-protocol), and its
types ODrive, Controller and Can. Positions are in revolutions, as in the drive.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator

from ...core.config.config import JointConfig
from ..drives.axes import Axis
from ..drives.can_frame import REMOTE
from ..virtual.can_bus import VirtualCanBus
from . import frames as f

REV = 2.0 * math.pi
FIRMWARE, HARDWARE = (0, 6, 11), (4, 4, 58)
PARAMETERS = f.KNOWN["0.6.11", "4.4"]
#: Times its limit a velocity is an error: ``controller.config.vel_limit_tolerance``, as delivered.
TOLERANCE = 1.2
#: V below which it trips, as delivered: ``config.dc_bus_undervoltage_trip_level``.
UNDER_VOLTAGE, DC_BUS_UNDER_VOLTAGE = 10.5, 0x200
#: s between two messages that nobody asks for, as delivered: heartbeat_msg_rate_ms 100 and
#: encoder_msg_rate_ms 10 of ``axis0.config.can``; the other rates are 0.
CYCLIC = {f.BEAT: 0.1, f.ESTIMATES: 0.01}
#: Commands that only this side knows: docs of CAN Simple, "Messages".
ESTOP, ADDRESS, LIMITS, CURRENTS, TEMPERATURES, ABSOLUTE = 0x02, 0x06, 0x0F, 0x14, 0x15, 0x19
POSITION_GAIN, VELOCITY_GAINS, POWERS = 0x1A, 0x1B, 0x1D
#: Those that a remote frame, or one without data, asks for.
READABLE = (f.VERSION, f.BEAT, f.ERROR, f.ESTIMATES, f.SUPPLY, f.TORQUES, ADDRESS, CURRENTS,
            TEMPERATURES, POWERS)  # fmt: skip
#: What commands hold; a state, a mode and gains are numbers, the other three are orders.
FORMS = {f.STATE: "<I", f.MODE: "<II", f.INPUT_POSITION: "<fhh", f.INPUT_VELOCITY: "<ff",
         f.INPUT_TORQUE: "<f", f.CLEAR: "<", f.REBOOT: "<", ESTOP: "<", LIMITS: "<ff",
         ABSOLUTE: "<f", POSITION_GAIN: "<f", VELOCITY_GAINS: "<ff"}  # fmt: skip
#: Node number of all, and of one that has none.
ALL = 0x3F
#: What a reboot can do beside: store the configuration, or forget it.
SAVE, ERASE = 1, 2
ESTOP_REQUESTED = 0x0200_0000


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
        supply, least_supply: V; below the least it trips.
    """

    def __init__(self, drive: int, torque_constant: float = 0.5) -> None:
        self.id, self.silent, self.persists = drive, False, 0
        self.supply, self.least_supply = 24.0, UNDER_VOLTAGE
        self.serial, self._shift = 0x3000_0000_0000 + drive, 0.0
        self.position_gain, self.velocity_gain, self.integrator_gain = 20.0, 18.0, 0.0
        self._number = drive
        self.stored = {
            f.WATCHDOG_TIMEOUT: 0.0,
            f.WATCHDOG_ENABLED: 0.0,
            f.SPEED_LIMIT: 20.0,
            f.CURRENT_LIMIT: 20.0,
            f.TORQUE_CONSTANT: torque_constant,
        }
        self._delivered = dict(self.stored)
        self._position = self._velocity = 0.0
        self.reboot()

    def reboot(self) -> None:
        self.conf, self.id = dict(self.stored), self._number
        self._shift -= round(self._position)  # turns are not counted without supply
        self.state, self.error, self._control = f.IDLE, self.persists, f.POSITION_CONTROL
        self._goal = self._speed = self._forward = self._integral = 0.0
        self._quiet = self.torque = 0.0
        self._since = dict.fromkeys(CYCLIC, 0.0)

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.state, self.error, self.persists = f.IDLE, code, code if persists else 0

    def unasked(self) -> Iterator[tuple[int, bytes]]:
        for command, period in CYCLIC.items():
            if self._since[command] >= period and not self.silent:
                self._since[command] = 0.0
                yield self.id << 5 | command, self._answer(command)

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        command, node = frame_id & 0x1F, (frame_id & 0x7FF) >> 5
        if self.silent or node not in (self.id, ALL):
            return
        if frame_id & REMOTE or (not data and command in READABLE):
            if command in READABLE and (node == self.id or command == ADDRESS):
                yield self.id << 5 | command, self._answer(command)
        elif command == ADDRESS and len(data) >= 7:
            if int.from_bytes(data[1:7], "little") == self.serial:
                self.id = data[0]
            elif self.id == data[0]:
                self.id = ALL  # it makes room
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
        if command == ADDRESS:
            return bytes([self.id]) + self.serial.to_bytes(6, "little") + bytes(1)
        amps = self.torque / self.conf[f.TORQUE_CONSTANT]
        watts = self.torque * self._velocity * REV
        numbers = {
            f.ESTIMATES: (self._position, self._velocity),
            f.SUPPLY: (self.supply, 0.0),
            f.TORQUES: (self.torque, self.torque),
            CURRENTS: (amps, amps),
            TEMPERATURES: (30.0, 30.0),
            POWERS: (watts, watts),
        }
        return struct.pack("<ff", *numbers[command])

    def _parameter(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        number = data[1] | data[2] << 8
        for name, endpoint in PARAMETERS.items():
            if endpoint.id != number:
                continue
            if data[0] == f.WRITE:
                self.conf[name] = float(struct.unpack_from(endpoint.form, data[4:])[0])
                self._quiet = 0.0
                # 0.6.11 confirms it (can_param_access.py at 8a05cf1e): a call without results.
                yield self.id << 5 | f.TX_SDO, struct.pack("<BHB", 0, number, 0)
                return
            kind = float if endpoint.form == "<f" else int
            now = self._control if name == f.LAW else self.conf[name]
            value = struct.pack(endpoint.form, kind(now))
            yield self.id << 5 | f.TX_SDO, struct.pack("<BHB", 0, number, 0) + value

    def _obey(self, command: int, data: bytes) -> None:
        form = FORMS.get(command)
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
            self._restart(data[:1])
        elif command == ESTOP:
            self.fail(ESTOP_REQUESTED)
        elif command in (LIMITS, ABSOLUTE, POSITION_GAIN, VELOCITY_GAINS):
            self._configure(command, values)
        else:
            self._quiet = 0.0
            if command == f.INPUT_POSITION:
                self._goal = values[0]
                self._speed, self._forward = (value / f.FEED_FORWARD for value in values[1:])
            elif command == f.INPUT_VELOCITY:
                self._speed, self._forward = values
            else:
                self._forward = values[0]

    def _restart(self, action: bytes) -> None:
        """Restart; with what acts now stored before, or with what was delivered."""
        if action == bytes([SAVE]):
            self.stored, self._number = dict(self.conf), self.id
        elif action == bytes([ERASE]):
            self.stored, self._number = dict(self._delivered), ALL
        self.reboot()

    def _configure(self, command: int, values: tuple[float, ...]) -> None:
        if command == LIMITS:
            self.conf |= zip((f.SPEED_LIMIT, f.CURRENT_LIMIT), values, strict=True)
        elif command == ABSOLUTE:
            self._shift += values[0] - self._position
            self._position = values[0]
        elif command == POSITION_GAIN:
            self.position_gain = values[0]
        else:
            self.velocity_gain, self.integrator_gain = values

    def _enter(self, state: int) -> None:
        if state == f.IDLE:
            self.state = f.IDLE
        elif state == f.CLOSED_LOOP != self.state and not self.error:
            self.state, self._integral, self._quiet = state, 0.0, 0.0
            self._goal, self._speed, self._forward = self._position, 0.0, 0.0

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self._position, self._velocity = position / REV + self._shift, velocity / REV
        for command in CYCLIC:
            self._since[command] += seconds
        self._quiet += seconds
        if self.supply < self.least_supply and not self.error:
            self.fail(DC_BUS_UNDER_VOLTAGE)
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
    made.least_supply = min(UNDER_VOLTAGE, 0.8 * made.supply)
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

# SPDX-License-Identifier: Apache-2.0
"""A virtual moteus: its register protocol on CAN FD, its modes, position loop, watchdog, faults.

Written from the published register reference and CAN format; frames are parsed by the maker's
library. Positions are in revolutions here, as in the drive.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial

from ...core.config.config import JointConfig
from ..drives.axes import Axis
from ..virtual.can_bus import VirtualCanBus
from . import frames as f
from . import virtual_frames as v
from .virtual_frames import R

ENABLING, CURRENT, POSITION, ZERO_VELOCITY, BRAKE = 2, 9, 10, 12, 15
#: s that a drive prepares its bridge after it was stopped.
ENABLE_TIME = 5e-3
#: What a command that does not name a register means.
UNNAMED = {
    R.COMMAND_POSITION: 0.0,
    R.COMMAND_VELOCITY: 0.0,
    R.COMMAND_FEEDFORWARD_TORQUE: 0.0,
    R.COMMAND_KP_SCALE: 1.0,
    R.COMMAND_KD_SCALE: 1.0,
    R.COMMAND_POSITION_MAX_TORQUE: math.nan,
    R.COMMAND_TIMEOUT: 0.0,
    R.COMMAND_ILIMIT_SCALE: 1.0,
    R.COMMAND_Q_CURRENT: 0.0,
    R.COMMAND_D_CURRENT: 0.0,
    R.VOLTAGEDQ_Q: 0.0,
    R.VOLTAGEDQ_D: 0.0,
}


class VirtualMoteus:
    """One drive; see ``virtual.world.VirtualDrive``.

    Args:
        drive: Its id.
        torque_constant: At its output, N·m/A.
        resistance: Of its winding, Ω.

    Attributes:
        mode, fault: Registers 0 and 15.
        conf: Its configuration by name.
        supply: V.
    """

    def __init__(self, drive: int, torque_constant: float = 0.5, resistance: float = 0.1) -> None:
        self.id, self.mode, self.fault, self.persists = drive, f.STOPPED, 0, 0
        self.supply, self.silent = 24.0, False
        self.version, self.register_map = 0x010100, 5
        self._constant, self._resistance = torque_constant, resistance
        self.stored = {
            f.ROTOR_RATIO: 1.0,
            f.OUTPUT_SOURCE: -1.0,
            "servo.pid_position.kp": 100.0,
            "servo.pid_position.ki": 0.0,
            "servo.pid_position.kd": 5.0,
            "servo.pid_position.ilimit": 0.0,
            "servo.timeout_mode": float(ZERO_VELOCITY),
            "servo.default_timeout_s": 0.1,
            "servo.timeout_max_torque_Nm": 5.0,
            "servo.max_current_A": 40.0,
            "servo.max_velocity": 100.0,
            "servopos.position_min": math.nan,
            "servopos.position_max": math.nan,
        }
        self._position = self._velocity = 0.0
        self.reboot()

    def reboot(self) -> None:
        self.conf: dict[str, float] = dict(self.stored)
        self.mode, self.fault = f.STOPPED, 0
        self._stream = b""
        self._enabling = self._left = self._integral = 0.0
        self._next, self._control = f.STOPPED, math.nan
        self._command: dict[int, float] = dict(UNNAMED)
        self.torque = self.current = 0.0

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.mode, self.fault, self.persists = f.FAULT, code, code if persists else 0

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        if frame_id & 0x7F != self.id or frame_id & 0x80 or self.silent:
            return
        try:
            found = v.read(data)
            for line in found.said:
                self._read_line(line)
            if R.MODE in found.writes:
                self._order(int(found.writes[R.MODE]), found.writes)
            reply = v.answer(found.reads, self._registers()) if found.reads else b""
            for channel, most in found.wanted:
                piece, self._stream = self._stream[:most], self._stream[most:]
                reply += bytes([0x41, channel, len(piece)]) + piece
        except Exception:  # noqa: BLE001 - no frame of its protocol: it does nothing
            return
        if frame_id & 0x8000 and 0 < len(reply) <= 64:
            yield self.id << 8 | frame_id >> 8 & 0x7F, f.padded(reply)

    def _order(self, mode: int, writes: Mapping[int, float]) -> None:
        if mode == f.STOPPED:
            self.mode, self.fault = (f.FAULT, self.persists) if self.persists else (f.STOPPED, 0)
            self._control = math.nan
            return
        if self.mode in (f.FAULT, f.TIMEOUT):  # left by a stop only
            return
        self._command = UNNAMED | {key: value for key, value in writes.items() if key in UNNAMED}
        timeout = self._command[R.COMMAND_TIMEOUT]
        self._left = timeout if timeout != 0.0 else self.conf["servo.default_timeout_s"]
        if self.mode == mode:
            self._place(self._command[R.COMMAND_POSITION])
            return
        if self.mode == f.STOPPED:
            self.mode, self._enabling = ENABLING, ENABLE_TIME
        elif self.mode != ENABLING:
            self._enter(mode)
        self._next = mode

    def _enter(self, mode: int) -> None:
        low, high = (self.conf[f"servopos.position_{end}"] for end in ("min", "max"))
        if mode == POSITION and (self._position < low or self._position > high):
            self.fail(39)
            return
        self.mode, self._integral, self._control = mode, 0.0, math.nan
        if mode == POSITION:
            self._place(self._command[R.COMMAND_POSITION])

    def _place(self, position: float) -> None:
        if not math.isnan(position):
            self._control = position
        elif math.isnan(self._control):
            self._control = self._position

    def _registers(self) -> dict[int, float]:
        return {
            R.MODE: self.mode,
            R.POSITION: self._position,
            R.VELOCITY: self._velocity,
            R.TORQUE: self.torque,
            R.Q_CURRENT: self.current,
            R.VOLTAGE: self.supply,
            R.TEMPERATURE: 30.0,
            R.FAULT: self.fault,
            R.FIRMWARE_VERSION: self.version,
            R.REGISTER_MAP_VERSION: self.register_map,
            R.MULTIPLEX_ID: self.id,
        }

    def _read_line(self, data: bytes) -> None:
        words = data.decode("latin1").split()
        answer = "ERR unknown command"
        if words[:2] == ["conf", "get"] and len(words) == 3 and words[2] in self.conf:
            answer = f"{self.conf[words[2]]:g}"
        elif words[:2] == ["conf", "set"] and len(words) == 4 and words[2] in self.conf:
            self.conf[words[2]] = float(words[3])
            answer = "OK"
        self._stream += answer.encode() + b"\r\n"

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self._position, self._velocity = position / f.REV, velocity / f.REV
        if self.mode == ENABLING:
            self._enabling -= seconds
            if self._enabling <= 0.0:
                self._enter(self._next)
        if self.mode not in (f.STOPPED, f.FAULT) and self.supply < 4.0:
            self.fail(40)
        if self.mode == POSITION:
            self._left -= seconds  # NaN: without a watchdog
            if self._left <= 0.0:
                self.mode = f.TIMEOUT
                self._control = self._position
        self.torque = self._torque(seconds)
        self.current = self.torque / self._constant
        return self.torque

    def _torque(self, seconds: float) -> float:
        command, most = self._command, self.conf["servo.max_current_A"] * self._constant
        if self.mode == POSITION:
            bound = command[R.COMMAND_POSITION_MAX_TORQUE]
            most = most if math.isnan(bound) else min(most, bound)
            torque = self._position_loop(seconds) + command[R.COMMAND_FEEDFORWARD_TORQUE]
        elif self.mode == CURRENT:
            torque = command[R.COMMAND_Q_CURRENT] * self._constant
        elif self.mode == f.VOLTAGE_DQ:
            torque = self._shorted(command[R.VOLTAGEDQ_Q])
        elif self.mode == BRAKE or (
            self.mode == f.TIMEOUT and self.conf["servo.timeout_mode"] == BRAKE
        ):
            torque = self._shorted(0.0)
        elif self.mode == f.TIMEOUT and self.conf["servo.timeout_mode"] == POSITION:
            command = self._command = dict(UNNAMED)
            torque = self._position_loop(seconds)
        elif self.mode == f.TIMEOUT and self.conf["servo.timeout_mode"] == ZERO_VELOCITY:
            most = min(most, self.conf["servo.timeout_max_torque_Nm"])
            torque = -self.conf["servo.pid_position.kd"] * self._velocity
        else:
            return 0.0
        return max(-most, min(most, torque))

    def _shorted(self, volts: float) -> float:
        """Torque of the winding behind a voltage."""
        emf = self._constant * self._velocity * f.REV
        return self._constant * (volts - emf) / self._resistance

    def _position_loop(self, seconds: float) -> float:
        command, conf = self._command, self.conf
        low, high = conf["servopos.position_min"], conf["servopos.position_max"]
        rate = command[R.COMMAND_VELOCITY]
        rate = 0.0 if math.isnan(rate) else rate
        self._control += rate * seconds
        if not (low <= self._control or math.isnan(low)):
            self._control, rate = low, 0.0
        if not (self._control <= high or math.isnan(high)):
            self._control, rate = high, 0.0
        error = self._control - self._position
        scale, limit = command[R.COMMAND_ILIMIT_SCALE], conf["servo.pid_position.ilimit"]
        self._integral += conf["servo.pid_position.ki"] * error * seconds
        self._integral = scale * max(-limit, min(limit, self._integral))
        stiffness = conf["servo.pid_position.kp"] * command[R.COMMAND_KP_SCALE]
        damping = conf["servo.pid_position.kd"] * command[R.COMMAND_KD_SCALE]
        return stiffness * error + damping * (rate - self._velocity) + self._integral


def virtual_drive(axis: Axis, joint: JointConfig | None) -> VirtualMoteus:
    if joint is None:
        return VirtualMoteus(axis.id)
    motor, ratio, gains = joint.motor, axis.ratio, joint.position_pid
    made = VirtualMoteus(axis.id, motor.torque_per_ampere / ratio, motor.resistance)
    made.supply = motor.supply_voltage
    made.stored |= {
        "servo.pid_position.kp": gains.kp * f.REV / ratio**2,
        "servo.pid_position.kd": gains.kd * f.REV / ratio**2,
        "servo.pid_position.ki": gains.ki * f.REV / ratio**2,
        "servo.pid_position.ilimit": min(gains.integral_limit, joint.limits.torque) / ratio,
        "servo.max_current_A": joint.limits.peak_current,
        "servo.max_velocity": 1.5 * joint.limits.velocity * ratio / f.REV,
    }
    made.reboot()
    return made


virtual_bus = partial(VirtualCanBus, fd=True)

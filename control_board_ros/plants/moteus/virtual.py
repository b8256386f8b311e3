# SPDX-License-Identifier: Apache-2.0
"""A virtual moteus: its register protocol on CAN FD, its modes, position loop, watchdog, faults.

Written from the maker's docs/reference/registers.md and can.md; frames are parsed by its
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
from .console import Console
from .planner import Planner, limit
from .virtual_frames import R

ENABLING, CURRENT, POSITION, ZERO_VELOCITY, STAY_WITHIN, BRAKE = 2, 9, 10, 12, 13, 15
BROADCAST = 0x7F
#: s that a drive prepares its bridge after it was stopped, in mode 2; how long is ours.
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
    R.COMMAND_VELOCITY_LIMIT: math.nan,
    R.COMMAND_ACCEL_LIMIT: math.nan,
    R.COMMAND_ILIMIT_SCALE: 1.0,
    R.COMMAND_WITHIN_LOWER_BOUND: math.nan,
    R.COMMAND_WITHIN_UPPER_BOUND: math.nan,
    R.COMMAND_Q_CURRENT: 0.0,
    R.COMMAND_D_CURRENT: 0.0,
    R.VOLTAGEDQ_Q: 0.0,
    R.VOLTAGEDQ_D: 0.0,
}
#: Registers of the mode that stays within bounds, and those of the position mode of like meaning.
WITHIN = {
    R.COMMAND_WITHIN_FEEDFORWARD_TORQUE: R.COMMAND_FEEDFORWARD_TORQUE,
    R.COMMAND_WITHIN_KP_SCALE: R.COMMAND_KP_SCALE,
    R.COMMAND_WITHIN_KD_SCALE: R.COMMAND_KD_SCALE,
    R.COMMAND_WITHIN_MAX_TORQUE: R.COMMAND_POSITION_MAX_TORQUE,
    R.COMMAND_WITHIN_TIMEOUT: R.COMMAND_TIMEOUT,
    R.COMMAND_WITHIN_ILIMIT_SCALE: R.COMMAND_ILIMIT_SCALE,
}
UUIDS = (R.UUID1, R.UUID2, R.UUID3, R.UUID4)
MASKS = (R.UUID_MASK1, R.UUID_MASK2, R.UUID_MASK3, R.UUID_MASK4)


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
        self.mode, self.fault, self.persists = f.STOPPED, 0, 0
        self.supply, self.silent = 24.0, False
        self.uuid = bytes([0x6D, 0x6A, *range(13), drive])
        self.version, self.register_map = 0x010100, 5
        self._constant, self._resistance = torque_constant, resistance
        self.stored = {
            f.ROTOR_RATIO: 1.0,
            f.OUTPUT_SOURCE: -1.0,
            "id.id": float(drive),
            "servo.default_velocity_limit": math.nan,
            "servo.default_accel_limit": 50.0,
            "motor_position.output.offset": 0.0,
            "servo.pid_position.kp": 100.0,
            "servo.pid_position.ki": 0.0,
            "servo.pid_position.kd": 5.0,
            "servo.pid_position.ilimit": 0.0,
            "servo.timeout_mode": float(ZERO_VELOCITY),
            "servo.default_timeout_s": 0.1,
            "servo.timeout_max_torque_Nm": 5.0,
            "servo.max_current_A": 40.0,
            "servo.max_velocity": 500.0,
            "servopos.position_min": math.nan,
            "servopos.position_max": math.nan,
            **{f"uuid.uuid.{k}": float(byte) for k, byte in enumerate(self.uuid)},
        }
        self._raw = self._velocity = 0.0
        self.reboot()

    @property
    def id(self) -> int:
        number = int(self.conf["id.id"])
        return number if 1 <= number < BROADCAST else 1

    @property
    def _position(self) -> float:
        return self._raw + self._shift

    def reboot(self) -> None:
        self.conf: dict[str, float] = dict(self.stored)
        self.mode, self._next, self.fault = f.STOPPED, f.STOPPED, 0
        self._console, self._plan = Console(self), Planner()
        self._shift = self.conf["motor_position.output.offset"]
        turn = 1.0 if self.conf[f.OUTPUT_SOURCE] >= 0.0 else abs(self.conf[f.ROTOR_RATIO])
        self._shift -= turn * round(self._position / turn)  # not counted without supply
        self._enabling = self._left = self._integral = 0.0
        self._command: dict[int, float] = dict(UNNAMED)
        self.torque = self.current = 0.0

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.mode, self.fault, self.persists = f.FAULT, code, code if persists else 0

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        if frame_id & 0x7F not in (self.id, BROADCAST) or frame_id & 0x80 or self.silent:
            return
        me = self.id
        try:
            content = v.read(data)
        except Exception:  # noqa: BLE001 - no frame of its protocol: it does nothing
            return
        if not self._is_meant(content.writes):
            return
        for said in content.said:
            self._console.hear(said)
        self._write(content.writes)
        reply = v.answer(content.reads, self._registers()) if content.reads else b""
        for channel, most in content.wanted:
            piece = self._console.say(most)
            reply += bytes([0x41, channel, len(piece)]) + piece
        if frame_id & 0x8000 and 0 < len(reply) <= 64:
            yield me << 8 | frame_id >> 8 & 0x7F, f.padded(reply)

    def _is_meant(self, writes: Mapping[int, float]) -> bool:
        """Whether a frame is for its unique id, or for any."""
        parts = (self.uuid[4 * k : 4 * k + 4] for k in range(4))
        return all(
            int(writes[mask]) & 0xFFFFFFFF == int.from_bytes(part, "little")
            for mask, part in zip(MASKS, parts, strict=True)
            if mask in writes
        )

    def _write(self, writes: Mapping[int, float]) -> None:
        if R.MODE in writes:
            self._order(int(writes[R.MODE]), writes)
        if R.SET_OUTPUT_NEAREST in writes:
            self._shift += round(writes[R.SET_OUTPUT_NEAREST] - self._position)
        if R.SET_OUTPUT_EXACT in writes:
            self._shift += writes[R.SET_OUTPUT_EXACT] - self._position
        if R.RECAPTURE_POSITION_VELOCITY in writes:
            self._plan.start(self._position, self._velocity)

    def order(self, words: list[str]) -> bool:
        """Obey a line of the diagnostic stream that begins with ``d``."""
        if words == ["stop"]:
            self._order(f.STOPPED, {})
            return True
        if len(words) != 2 or words[0] not in ("cfg-set-output", "exact", "nearest", "rezero"):
            return False
        way = float(words[1]) - self._position
        self._shift += way if words[0] in ("cfg-set-output", "exact") else round(way)
        if words[0] == "cfg-set-output":
            self.conf["motor_position.output.offset"] = self._shift
        return True

    def telemetry(self, channel: str) -> Mapping[str, float | list[int]]:
        """The values of a channel of the diagnostic stream."""
        if channel == "firmware":
            return {"version": self.version, "serial_number": [1, 2, self.id], "model": 0}
        if channel == "git":
            return {"hash": [0] * 20, "dirty": 0, "timestamp": 0}
        return {
            "mode": self.mode, "fault": self.fault, "position": self._position,
            "velocity": self._velocity, "torque_Nm": self.torque, "q_A": self.current,
            "filt_bus_V": self.supply, "fet_temp_C": 30.0, "trajectory_done": self._plan.complete,
        }  # fmt: skip

    def _order(self, mode: int, writes: Mapping[int, float]) -> None:
        if mode == f.STOPPED:
            self.mode, self.fault = (f.FAULT, self.persists) if self.persists else (f.STOPPED, 0)
            return
        if self.mode in (f.FAULT, f.TIMEOUT):  # left by a stop only
            return
        named = {WITHIN.get(key, key): value for key, value in writes.items()}
        self._command = UNNAMED | {key: value for key, value in named.items() if key in UNNAMED}
        timeout = self._command[R.COMMAND_TIMEOUT]
        self._left = timeout if timeout != 0.0 else self.conf["servo.default_timeout_s"]
        self._next = mode
        if self.mode == mode:
            self._aim()
        elif self.mode == f.STOPPED:
            self.mode, self._enabling = ENABLING, ENABLE_TIME
        elif self.mode != ENABLING:
            self._enter(mode)

    def _enter(self, mode: int) -> None:
        low, high = (self.conf[f"servopos.position_{end}"] for end in ("min", "max"))
        outside = self._position < low or self._position > high
        if mode in (POSITION, STAY_WITHIN) and outside:
            self.fail(39)
            return
        self.mode, self._integral = mode, 0.0
        self._plan.start(self._position, self._velocity)
        self._aim()

    def _aim(self) -> None:
        position = self._command[R.COMMAND_POSITION]
        if self.mode == POSITION and not (math.isnan(position) and self._plan.complete):
            self._plan.target = position

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
            R.TRAJECTORY_COMPLETE: self._plan.complete,
            R.CONTROL_POSITION: self._plan.position,
            R.CONTROL_VELOCITY: self._plan.velocity,
            R.UUID_MASK_CAPABLE: 1,
            **{
                register: int.from_bytes(self.uuid[4 * k : 4 * k + 4], "little", signed=True)
                for k, register in enumerate(UUIDS)
            },
        }

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self._raw, self._velocity = position / f.REV, velocity / f.REV
        if self.mode == ENABLING:
            self._enabling -= seconds
            if self._enabling <= 0.0:
                self._enter(self._next)
        if self.mode not in (f.STOPPED, f.FAULT) and self.supply < 4.0:
            self.fail(40)
        if self.mode in (POSITION, STAY_WITHIN):
            self._left -= seconds  # NaN: without a watchdog
            if self._left <= 0.0:
                self.mode = f.TIMEOUT
                self._plan.start(self._position, 0.0)
        self.torque = self._torque(seconds)
        self.current = self.torque / self._constant
        return self.torque

    def _torque(self, seconds: float) -> float:
        command, most = self._command, self.conf["servo.max_current_A"] * self._constant
        if self.mode in (POSITION, STAY_WITHIN):
            bound = command[R.COMMAND_POSITION_MAX_TORQUE]
            most = most if math.isnan(bound) else min(most, bound)
            loop = self._position_loop if self.mode == POSITION else self._bounds
            torque = loop(seconds) + command[R.COMMAND_FEEDFORWARD_TORQUE]
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
            scale = command[R.COMMAND_KD_SCALE]
            torque = -scale * self.conf["servo.pid_position.kd"] * self._velocity
        else:
            return 0.0
        return max(-most, min(most, torque))

    def _shorted(self, volts: float) -> float:
        """Torque of the winding behind a voltage."""
        emf = self._constant * self._velocity * f.REV
        return self._constant * (volts - emf) / self._resistance

    def _position_loop(self, seconds: float) -> float:
        command, conf, plan = self._command, self.conf, self._plan
        low, high = conf["servopos.position_min"], conf["servopos.position_max"]
        rate = command[R.COMMAND_VELOCITY]
        plan.step(
            seconds,
            0.0 if math.isnan(rate) else rate,
            limit(command[R.COMMAND_VELOCITY_LIMIT], conf["servo.default_velocity_limit"]),
            limit(command[R.COMMAND_ACCEL_LIMIT], conf["servo.default_accel_limit"]),
        )
        if not (low <= plan.position or math.isnan(low)):
            plan.position, plan.velocity = low, 0.0
        if not (plan.position <= high or math.isnan(high)):
            plan.position, plan.velocity = high, 0.0
        return self._pid(seconds, plan.position, plan.velocity)

    def _bounds(self, seconds: float) -> float:
        """Free between its bounds, held at them."""
        low, high = (
            self._command[R.COMMAND_WITHIN_LOWER_BOUND],
            self._command[R.COMMAND_WITHIN_UPPER_BOUND],
        )
        if self._position < low or self._position > high:
            return self._pid(seconds, low if self._position < low else high, 0.0)
        self._integral = 0.0
        return 0.0

    def _pid(self, seconds: float, position: float, velocity: float) -> float:
        command, conf = self._command, self.conf
        error = position - self._position
        most = command[R.COMMAND_ILIMIT_SCALE] * conf["servo.pid_position.ilimit"]
        self._integral += conf["servo.pid_position.ki"] * error * seconds
        self._integral = max(-most, min(most, self._integral))
        stiffness = conf["servo.pid_position.kp"] * command[R.COMMAND_KP_SCALE]
        damping = conf["servo.pid_position.kd"] * command[R.COMMAND_KD_SCALE]
        return stiffness * error + damping * (velocity - self._velocity) + self._integral


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

# SPDX-License-Identifier: Apache-2.0
"""moteus controllers over CAN FD, by the register protocol of their library.

Every set-point is a command of the drive's position mode, which is the one mode that its watchdog
guards: with the scales a of its gains, and the gains kp, kd that are configured in it::

    position    q, q̇, τ_ff      a_p = a_d = 1
    velocity    q̇, τ_ff         q of its own trajectory, a_p = a_d = 1
    impedance   q, q̇, τ_ff      a_p = 2π k / kp, a_d = 2π d / kd
    torque      τ                a_p = a_d = 0

``unwatched=1`` adds current and pwm: nothing ends those when this program is gone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.axes import Options
from ..drives.can_line import ATTEMPTS, PATIENCE, CanLine, budget
from ..drives.driver import Answers, Found, Traits, Wanted, only
from ..drives.faults import coded
from ..drives.plant import maker
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import frames as f

IDS = range(1, 128)
WATCHED = (SetPoint.POSITION, SetPoint.IMPEDANCE, SetPoint.VELOCITY, SetPoint.TORQUE)
UNWATCHED = (SetPoint.CURRENT, SetPoint.PWM)
#: What it does after its watchdog (servo.timeout_mode).
ON_SILENCE = {OnSilence.FREE: 0, OnSilence.DAMPED: 15, OnSilence.BRAKED: 10}


class Drive:
    """One drive, by its id.

    Attributes:
        controller: Of the library.
        template: Of its position command.
        kp, kd: Gains that are configured in it.
        torque: Its largest, N·m; NaN: as configured in it.
        running: Whether it reported a running mode since its last stop.
    """

    def __init__(self, drive: int) -> None:
        import moteus

        resolution = moteus.QueryResolution()
        resolution.q_current = moteus.F32
        self.controller = moteus.Controller(id=drive, query_resolution=resolution)
        self.template = f.template(self.controller)
        self.kp = self.kd = 1.0
        self.torque, self.running = math.nan, False


class MoteusDrives:
    """The controllers of one bus; see ``drives.driver.Driver``."""

    def __init__(self, options: Options) -> None:
        self._options, self._axes = options, options.axes
        kinds = (*WATCHED, *UNWATCHED) if options.own["unwatched"] else WATCHED
        self.traits = Traits(
            set_points=kinds,
            on_silence=tuple(ON_SILENCE),
            rate=15e3,
            resolution=f.REV / 2**14,
            torque=True,
            current=True,
            voltage=True,
        )
        self._line = CanLine(options.bus, fd=True)

    def open(self, setup: Setup, answers: Answers) -> None:
        self._line.open()
        self._setup, self._answers, self._wait = setup, answers, budget(setup.period)
        self._drives = [Drive(axis.id) for axis in self._axes]

    def set_up(self, k: int, attempts: int = ATTEMPTS) -> Found:
        """Stop a drive, set its watchdog and largest torque, and read its gains and limits."""
        line, axis, joint = self._line, self._axes[k], self._setup.joints[k]
        found = only(identify(line, axis.id, attempts), axis, self._options.bus, "moteus")
        drive = self._drives[k]
        line.send(axis.id, f.padded(drive.controller.make_stop().data))
        silence = OnSilence.FREE if joint is None else joint.on_silence
        ask(line, axis.id, f"conf set servo.timeout_mode {ON_SILENCE[silence]}")
        ask(line, axis.id, f"conf set servo.default_timeout_s {self._setup.timeout:.4f}")

        def number(name: str) -> float:
            return float(ask(line, axis.id, f"conf get {name}"))

        drive.kp, drive.kd = (number(f"servo.pid_position.{gain}") for gain in ("kp", "kd"))
        if joint is not None:  # S4: the smaller acts
            drive.torque = joint.limits.torque / axis.ratio
        drive.running = False
        lower, upper = (number(f"servopos.position_{end}") for end in ("min", "max"))
        limits = DriveLimits(
            lower=lower * f.REV if math.isfinite(lower) else None,
            upper=upper * f.REV if math.isfinite(upper) else None,
            velocity=number("servo.max_velocity") * f.REV,
            current=number("servo.max_current_A"),
        )
        return replace(found, limits=limits)

    def exchange(self, wanted: Wanted) -> None:
        line = self._line
        line.drain(self._take)
        for k, (kind, value) in wanted.items():
            line.send(0x8000 | self._axes[k].id, f.padded(self._command(k, kind, value)))
        line.gather(self._take, wanted, self._wait)

    def clear_fault(self, k: int) -> None:
        """A stop clears it."""
        self._line.send(self._axes[k].id, f.padded(self._drives[k].controller.make_stop().data))

    def close(self) -> None:
        self._line.close((axis.id, bytes([0x01, 0x00, f.STOPPED])) for axis in self._axes)

    def _command(self, k: int, kind: SetPoint, value: Sequence[float]) -> bytes:
        drive = self._drives[k]
        controller = drive.controller
        if kind is SetPoint.OFF:
            drive.running = False
            return bytes(controller.make_stop(query=True).data)
        if kind is SetPoint.CURRENT:
            amps = value[Value.CURRENT]
            return bytes(controller.make_current(d_A=0.0, q_A=amps, query=True).data)
        if kind is SetPoint.PWM:
            volts = f.MODULATION * value[Value.PWM] / 100.0 * self._answers.voltage[k]
            return f.voltage(controller, float(volts))
        kp = kd = 1.0
        if kind is SetPoint.IMPEDANCE:
            kp = value[Value.STIFFNESS] * f.REV / drive.kp
            kd = value[Value.DAMPING] * f.REV / drive.kd
        elif kind is SetPoint.TORQUE:
            kp = kd = 0.0
        places = kind in (SetPoint.POSITION, SetPoint.IMPEDANCE)
        begin, at_timeout, at_integral, query = drive.template
        packed = f.POSITIONS.pack(
            begin,
            value[Value.POSITION] / f.REV if places else math.nan,
            value[Value.VELOCITY] / f.REV,
            value[Value.TORQUE],
            kp,
            kd,
            drive.torque,
            at_timeout,
            self._setup.timeout,
            f.UNLIMITED,
            f.UNLIMITED,
            at_integral,
            1.0 if kind in (SetPoint.POSITION, SetPoint.VELOCITY) else 0.0,
        )
        return packed + query

    def _take(self, message: Any) -> int | None:
        answers = self._answers
        k = answers.places.get(message.arbitration_id >> 8 & 0x7F)
        if k is None or message.arbitration_id & 0xFF != 0:
            return None
        try:
            mode, q, dq, torque, amps, volts, fault = f.reading(bytes(message.data))
        except Exception:  # noqa: BLE001 - an invalid frame, whatever the reason
            return None
        if not math.isfinite(q + dq + torque + amps + volts):
            return None
        answers.position[k], answers.velocity[k] = q * f.REV, dq * f.REV
        answers.torque[k], answers.current[k], answers.voltage[k] = torque, amps, volts
        answers.faults[k] = self._judge(k, mode, fault)
        answers.came(k, message.data)
        return k

    def _judge(self, k: int, mode: int, fault: int) -> DriveFault | None:
        drive = self._drives[k]
        if mode in f.RUNNING:
            drive.running = True
        elif mode in f.STARTING and drive.running:
            self._answers.restarted[k], drive.running = True, False
        if mode == f.FAULT:
            return coded(fault, f.FAULTS)
        return f.WATCHDOG if mode == f.TIMEOUT else None


def identify(line: CanLine, drive: int, attempts: int = ATTEMPTS) -> list[Found]:
    import moteus
    from moteus.protocol import Register

    registers = {Register.MODEL_NUMBER: moteus.INT32, Register.FIRMWARE_VERSION: moteus.INT32}
    registers |= {Register.REGISTER_MAP_VERSION: moteus.INT32}
    who = moteus.Controller(id=drive)
    query = who.make_custom_query(registers).data + who.make_query().data

    def pick(message: Any) -> bytes | None:
        return bytes(message.data) if message.arbitration_id == drive << 8 else None

    found = line.answers(0x8000 | drive, f.padded(query), pick, attempts)
    return [_found(drive, data) for data in dict.fromkeys(found)]


def _found(drive: int, data: bytes) -> Found:
    from moteus.protocol import Register, parse_reply

    values = parse_reply(data)
    version = int(values.get(Register.FIRMWARE_VERSION, 0))
    registers = int(values.get(Register.REGISTER_MAP_VERSION, 0))
    if registers != f.REGISTER_MAP:
        raise PlantSettingsError(
            f"id {drive}: its register map is {registers}; {f.REGISTER_MAP} is supported; "
            "flash a firmware that has it with moteus_tool"
        )
    model = int(values.get(Register.MODEL_NUMBER, -1))
    fault = int(values.get(Register.FAULT, 0))
    return Found(
        id=drive,
        type=f"moteus model {model}" if model > 0 else "moteus",
        firmware=".".join(str(version >> shift & 0xFF) for shift in (16, 8, 0)),
        voltage=float(values.get(Register.VOLTAGE, math.nan)),
        fault=coded(fault, f.FAULTS) if fault else None,
    )


def ask(line: CanLine, drive: int, words: str) -> str:
    """One line to the diagnostic stream of a drive, and the line that it answers.

    Raises:
        ConnectionError: it does not answer.
        ValueError: it answers that it cannot.
    """
    import moteus

    who = moteus.Controller(id=drive)
    line.drain(lambda _: None)
    line.send(drive, f.padded(who.make_diagnostic_write(words.encode() + b"\n").data))
    text = b""
    for _ in range(20 * ATTEMPTS):
        line.send(0x8000 | drive, f.padded(who.make_diagnostic_read().data))
        came: list[bytes] = []

        def take(message: Any, came: list[bytes] = came) -> int | None:
            if message.arbitration_id != drive << 8:
                return None
            came.append(moteus.moteus.parse_diagnostic_message(message, 1) or b"")
            return drive

        line.gather(take, [drive], PATIENCE / 5)
        text += b"".join(came)
        if b"\n" in text:
            answer = text.decode("latin1").splitlines()[0].strip()
            if answer.startswith("ERR"):
                raise ValueError(f"id {drive}: {words!r}: {answer}; is its firmware too old?")
            return answer
    raise ConnectionError(f"id {drive} does not answer to {words!r}")


def scan(bus: str) -> list[Found]:
    import moteus
    from moteus.protocol import Register

    with CanLine(bus, fd=True) as line:
        query = (
            moteus.Controller(id=1).make_custom_query({Register.MODEL_NUMBER: moteus.INT32}).data
        )
        for drive in IDS:
            line.send(0x8000 | drive, f.padded(query))
        drives = {m.arbitration_id >> 8 for m in line.collect(0.1) if m.arbitration_id & 0xFF == 0}
        return [found for drive in sorted(drives) for found in identify(line, drive)]


make = maker(MoteusDrives, bus="socketcan:can0", ids=IDS, whole={"unwatched": 0.0})

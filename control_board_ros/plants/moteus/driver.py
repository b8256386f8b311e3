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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from ...core.terms.drives import OnSilence, SetPoint
from ..drives.axes import Options
from ..drives.can_drives import CanDrives
from ..drives.can_line import PATIENCE, CanLine, Frame
from ..drives.driver import ONE_TURN, Answers, Identity, Order, Traits
from ..drives.faults import coded
from ..drives.interview import ATTEMPTS, PAUSE, Question, Questions, converse, find, longer
from ..drives.plant import maker
from ..drives.reconcile import ACTING, ASK, CONFIRM
from ..drives.set_id import check, verify
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import frames as f

#: 127 is that of all drives.
IDS = range(1, 127)
#: s until an answer on the diagnostic stream is late, twice as long each time, and a time in which
#: it comes and is dropped.
SPOKEN = 0.04
LATE = replace(PAUSE, patience=0.3)
_, PWM, CURRENT, TORQUE, VELOCITY, POSITION, IMPEDANCE = SetPoint
PLACES = (POSITION, IMPEDANCE)
WATCHED, UNWATCHED = (*PLACES, VELOCITY, TORQUE), (CURRENT, PWM)
#: Modes of the drive by the kind of set-point.
LAWS = dict.fromkeys(WATCHED, f.POSITION) | {
    CURRENT: f.CURRENT,
    PWM: f.VOLTAGE_DQ,
}
#: What it does after its watchdog (servo.timeout_mode).
ON_SILENCE = {OnSilence.FREE: 0, OnSilence.DAMPED: 15, OnSilence.BRAKED: 10}
TIMEOUT_MODE = "servo.timeout_mode"


class Drive:
    """One drive, by its id.

    Attributes:
        controller: Of the library.
        template: Of its position command.
        stop, query: Its data, with a question for its readings.
        kp, kd: Gains that are configured in it, from its set-up on.
        torque: Its largest, N·m; NaN: as configured in it.
    """

    kp: float
    kd: float

    def __init__(self, drive: int) -> None:
        import moteus

        resolution = moteus.QueryResolution()
        resolution.q_current = moteus.F32
        self.controller = moteus.Controller(id=drive, query_resolution=resolution)
        self.template = f.template(self.controller)
        self.stop = f.padded(self.controller.make_stop(query=True).data)
        self.query = f.padded(self.controller.make_query().data)
        self.torque = math.nan


@dataclass(frozen=True, kw_only=True)
class MoteusOptions(Options):
    """``unwatched``: with set-points that continue when this computer stops."""

    unwatched: bool = False


class MoteusDrives(CanDrives[MoteusOptions]):
    """The controllers of one bus; see ``drives.driver.Driver``."""

    laws = LAWS

    def __init__(self, options: MoteusOptions) -> None:
        super().__init__(options, fd=True)
        kinds = (*WATCHED, *UNWATCHED) if options.unwatched else WATCHED
        self.traits = Traits(
            set_points=kinds,
            on_silence=tuple(ON_SILENCE),
            rate=15e3,
            resolution=f.REV / 2**14,
            torque=True,
            current=True,
            voltage=True,
            laws=f.MODES,
        )

    def open(self, setup: Setup, answers: Answers) -> None:
        super().open(setup, answers)
        self._drives = [Drive(axis.id) for axis in self._axes]

    def set_up(self, k: int) -> Questions[Identity]:
        """Set the watchdog and the largest torque of a drive, and read its gains and limits."""
        axis, joint, drive = self._axes[k], self._setup.joints[k], self._drives[k]
        data = yield from find(identity(axis.id), axis, self._options.bus, "moteus")
        facts = identity_of(axis.id, data)
        yield from self._put(k, TIMEOUT_MODE, f"{self._timeout_mode(k)}")
        yield from self._put(k, "servo.default_timeout_s", f"{self._setup.timeout:.4f}")
        numbers = {}
        for name in NUMBERS:
            numbers[name] = float((yield from said(axis.id, f"conf get {name}")))
        drive.kp, drive.kd = numbers["servo.pid_position.kp"], numbers["servo.pid_position.kd"]
        if not (drive.kp > 0.0 and drive.kd > 0.0):
            raise PlantSettingsError(
                f"{axis.name}: servo.pid_position of id {axis.id} has kp {drive.kp:g} and kd "
                f"{drive.kd:g}; above 0 are required, set them with moteus_tool"
            )
        if joint is not None:  # S4: the smaller acts
            drive.torque = joint.limits.torque / axis.ratio
        lower, upper = numbers["servopos.position_min"], numbers["servopos.position_max"]
        limits = DriveLimits(
            lower=lower * f.REV if math.isfinite(lower) else None,
            upper=upper * f.REV if math.isfinite(upper) else None,
            velocity=numbers["servo.max_velocity"] * f.REV,
            current=numbers["servo.max_current_A"],
        )
        return replace(facts, limits=limits, turn=(yield from self._turn(axis.id)))

    def _turn(self, number: int) -> Questions[float]:
        """A turn of its rotor, unless an encoder at the output tells them apart."""
        try:
            source = float((yield from said(number, f"conf get {f.OUTPUT_SOURCE}")))
            ratio = float((yield from said(number, f"conf get {f.ROTOR_RATIO}")))
        except ValueError:  # its firmware has none of them
            return ONE_TURN
        return ONE_TURN if source >= 0.0 else abs(ratio) * ONE_TURN

    def confirm(self, k: int) -> Questions[bool]:
        """Whether its timeout mode is ours: a restart forgets it."""
        mode = yield from said(self._axes[k].id, f"conf get {TIMEOUT_MODE}")
        return mode == f"{self._timeout_mode(k)}"

    def _timeout_mode(self, k: int) -> int:
        joint = self._setup.joints[k]
        return ON_SILENCE[OnSilence.FREE if joint is None else joint.on_silence]

    def _put(self, k: int, name: str, value: str) -> Questions[None]:
        number = self._axes[k].id
        answer = yield from said(number, f"conf set {name} {value}")
        if answer != "OK":
            raise ValueError(f"id {number}: conf set {name} {value}: {answer!r}; OK is expected")

    def _frames(self, orders: Mapping[int, Order]) -> Iterator[Frame]:
        for k, order in orders.items():
            number, drive = self._axes[k].id, self._drives[k]
            yield from order.request
            if order.action in ACTING:
                data = f.padded(self._command(k, order.kind, order.values))
            elif order.action in (ASK, CONFIRM):
                data = drive.query
            else:  # a stop clears a fault, too
                data = drive.stop
            self._answers.asked[k] += 1
            yield 0x8000 | number, data

    def close(self) -> None:
        self.line.close((axis.id, bytes([0x01, 0x00, f.STOPPED])) for axis in self._axes)

    def _command(self, k: int, kind: SetPoint, value: Sequence[float]) -> bytes:
        drive = self._drives[k]
        controller = drive.controller
        pwm, amps, torque, velocity, position, stiffness, damping = value
        if kind is CURRENT:
            return bytes(controller.make_current(d_A=0.0, q_A=amps, query=True).data)
        if kind is PWM:
            volts = f.MODULATION * pwm / 100.0 * self._answers.voltage[k]
            return f.voltage(controller, float(volts))
        kp = kd = integral = 1.0
        if kind is IMPEDANCE:
            kp, kd, integral = stiffness * f.REV / drive.kp, damping * f.REV / drive.kd, 0.0
        elif kind is TORQUE:
            kp = kd = integral = 0.0
        begin, at_timeout, at_integral, query = drive.template
        packed = f.POSITIONS.pack(
            begin,
            position / f.REV if kind in PLACES else math.nan,
            velocity / f.REV,
            torque,
            kp,
            kd,
            drive.torque,
            at_timeout,
            self._setup.timeout,
            f.UNLIMITED,
            f.UNLIMITED,
            at_integral,
            integral,
        )
        return packed + query

    def _take(self, message: Any) -> int | None:
        answers, data = self._answers, bytes(message.data)
        k = answers.places.get(message.arbitration_id >> 8 & 0x7F)
        if k is None or message.arbitration_id & 0xFF != 0:
            return None
        interview = self._interview(k)
        if interview is not None and interview.hear(data):
            return None
        try:
            mode, q, dq, torque, amps, volts, fault = f.reading(data)
        except Exception:  # noqa: BLE001 - an invalid frame, whatever the reason
            return None
        if not math.isfinite(q + dq + torque + amps + volts):
            return None
        answers.position[k], answers.velocity[k] = q * f.REV, dq * f.REV
        answers.torque[k], answers.current[k], answers.voltage[k] = torque, amps, volts
        reported = answers.reported[k]
        reported.power, reported.law = mode in f.POWERED, mode
        reported.fault = judged(mode, fault)
        answers.came(k, data)
        return None if interview is not None and interview.question.several else k


def judged(mode: int, fault: int) -> DriveFault | None:
    """The fault of a drive by its registers."""
    if mode == f.FAULT:
        return coded(fault, f.FAULTS)
    return f.WATCHDOG if mode == f.TIMEOUT else None


#: What is read of the configuration of a drive.
NUMBERS = (
    "servo.pid_position.kp",
    "servo.pid_position.kd",
    "servopos.position_min",
    "servopos.position_max",
    "servo.max_velocity",
    "servo.max_current_A",
)


def identity(drive: int) -> Question:
    """The question for model, firmware, register map, and state."""
    import moteus
    from moteus.protocol import Register

    registers = {Register.MODEL_NUMBER: moteus.INT32, Register.FIRMWARE_VERSION: moteus.INT32}
    registers |= {Register.REGISTER_MAP_VERSION: moteus.INT32}
    who = moteus.Controller(id=drive)
    query = who.make_custom_query(registers).data + who.make_query().data
    return Question([(0x8000 | drive, f.padded(query))], about, several=True)


def about(data: bytes) -> bytes | None:
    """An answer to the question for the identity."""
    from moteus.protocol import Register, parse_reply

    try:
        return data if Register.REGISTER_MAP_VERSION in parse_reply(data) else None
    except Exception:  # noqa: BLE001 - an invalid frame, whatever the reason
        return None


def identity_of(drive: int, data: bytes) -> Identity:
    """A drive by its answer.

    Raises:
        PlantSettingsError: its register map is another one.
    """
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
    return Identity(
        id=drive,
        type=f"moteus model {model}" if model > 0 else "moteus",
        firmware=".".join(str(version >> shift & 0xFF) for shift in (16, 8, 0)),
        voltage=float(values.get(Register.VOLTAGE, math.nan)),
        fault=coded(fault, f.FAULTS) if fault else None,
        turn=math.nan,  # its configuration has it
    )


def said(drive: int, words: str) -> Questions[str]:
    """What a drive answers to one line on its diagnostic stream; what it said before is dropped.

    Raises:
        ConnectionError: it does not answer.
        ValueError: it answers that it cannot.
    """
    import moteus

    who = moteus.Controller(id=drive)
    read = [(0x8000 | drive, f.padded(who.make_diagnostic_read().data))]
    line = (drive, f.padded(who.make_diagnostic_write(words.encode() + b"\n").data))
    late = False  # whether an answer is still to come, which would be taken for that to another
    for attempt in range(ATTEMPTS):
        if late:
            yield LATE
        poll = longer(Question(read, f.spoken, patience=SPOKEN), attempt)
        ask = replace(poll, request=[line, *poll.request])
        while any(heard := (yield poll)):
            pass
        if late := not heard:
            continue
        text, empty = b"".join(heard := (yield ask)), 0
        late = not heard
        while b"\n" not in text and empty < ATTEMPTS:
            more = b"".join(heard := (yield poll))
            text, empty, late = text + more, 0 if more else empty + 1, late or not heard
        if b"\n" in text:
            if late:
                yield LATE
            answer = text.decode("latin1").splitlines()[0].strip()
            if answer.startswith("ERR"):
                raise ValueError(f"id {drive}: {words!r}: {answer}; is its firmware too old?")
            return answer
    raise ConnectionError(f"id {drive} does not answer to {words!r}")


def scan(bus: str) -> list[Identity]:
    """The drives that answer on a bus."""
    with CanLine(bus, fd=True) as line:
        return [identity_of(*answer) for answer in line.survey(identity, IDS, words_of)]


def words_of(drive: int, message: Any) -> tuple[bytes] | None:
    """What a frame says, where it is of a drive, and for this host."""
    return (bytes(message.data),) if message.arbitration_id & 0x7FFF == drive << 8 else None


def set_id(bus: str, old: int, new: int) -> None:
    """Give a drive another id, which it stores.

    Raises:
        OSError, ValueError: it cannot be; see ``drives.set_id``.
    """
    import moteus
    from moteus.protocol import Register, parse_reply

    with CanLine(bus, fd=True) as line:

        def asked(drive: int, question: Question) -> list[Any]:
            return line.ask(question, partial(words_of, drive), PATIENCE)

        def heard(drive: int) -> int:
            return len(asked(drive, identity(drive)))

        check(old, new, IDS, heard)
        (data,) = asked(old, identity(old))
        if parse_reply(data)[Register.MODE] in f.POWERED:
            raise ValueError(f"id {old} has power; it changes its id without")
        words = f"conf set id.id {new}\n".encode()
        who = moteus.Controller(id=old)
        line.send(old, f.padded(who.make_diagnostic_write(words).data))
        for line_of_it, answer in (("conf get id.id", f"{new}"), ("conf write", "OK")):
            reply = converse(said(new, line_of_it), partial(asked, new))
            if reply != answer:
                raise ValueError(f"id {new}: {line_of_it}: {reply!r}; {answer} is expected")
        verify(old, new, heard)


make = maker(MoteusDrives, MoteusOptions, IDS)

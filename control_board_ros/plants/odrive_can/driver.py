# SPDX-License-Identifier: Apache-2.0
"""ODrive controllers by CAN Simple, firmware 0.6: one set-point down, remote frames for answers.

An exchange requests position and velocity of each drive, and in turn its state with errors, and
its torque. A kind of set-point is a control mode; with it come its first values. CAN Simple does
not acknowledge it: it is repeated, and read back where the number of its endpoint is known.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from ...core.terms.drives import OnSilence, SetPoint
from ..drives.can_drives import CanDrives, CanOptions
from ..drives.can_frame import REMOTE
from ..drives.can_line import CanLine, Frame
from ..drives.driver import ONE_TURN, Identity, Order, Traits
from ..drives.faults import flagged
from ..drives.interview import Question, Questions, ask, find, told
from ..drives.plant import maker
from ..drives.reconcile import ACTING, ASK, CONFIRM, POWER_ON, RESET
from ..errors import PlantSettingsError
from ..interface import DriveLimits
from . import frames as f

REV = 2.0 * math.pi
IDS = range(63)
MODES = {
    SetPoint.POSITION: f.POSITION_CONTROL,
    SetPoint.VELOCITY: f.VELOCITY_CONTROL,
    SetPoint.TORQUE: f.TORQUE_CONTROL,
}
#: What is requested beside the position, one per exchange, and its format.
IN_TURN = (f.BEAT, f.TORQUES)
FORMATS = {f.BEAT: "<IBBBB", f.TORQUES: "<ff", f.ESTIMATES: "<ff"}


#: Exchanges with a control mode, one after the other; then each of so many.
REPEATED, SELDOM = 3, 10
#: rev and s: estimates of one exchange that differ by less are of one drive, cyclic ones too.
APART, STALE = 0.01, 0.02


@dataclass(slots=True)
class Drive:
    """One drive since it was set up.

    Attributes: parameters (by name; empty without a watchdog), scales (counts of Set_Input_Pos),
        sent (exchanges with the present law), law (as sent), read (as read back, where its
        endpoint is known), awaited (answers of this exchange), estimates (of this exchange: rev,
        rev/s).
    """

    parameters: Mapping[str, f.Endpoint] = field(default_factory=dict)
    scales: tuple[float, float] = (f.FEED_FORWARD, f.FEED_FORWARD)
    sent: int = 0
    law: int = 0
    read: int | None = None
    awaited: set[int] = field(default_factory=set)
    estimates: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class OdriveOptions(CanOptions):
    """``endpoints``: the file of parameter numbers of a firmware; "": those included."""

    endpoints: str = ""


class OdriveDrives(CanDrives[OdriveOptions]):
    """The controllers of one bus; see ``drives.driver.Driver``."""

    laws = MODES

    def __init__(self, options: OdriveOptions) -> None:
        super().__init__(options, bitrate=options.bitrate)
        self.traits = Traits(
            set_points=tuple(MODES),
            on_silence=(OnSilence.FREE,),
            rate=8e3,
            torque=True,
            laws=f.MODES,
        )
        self._drives = [Drive() for _ in self._axes]
        self._turn = 0

    def set_up(self, k: int) -> Questions[Identity]:
        """Set the watchdog; the identification of the drive."""
        axis = self._axes[k]
        number, drive = axis.id, Drive()
        question = requested(number, f.VERSION, several=True)
        said = yield from find(question, axis, self._options.bus, "odrive_can")
        version = f.Version.parse(said)
        firmware = ".".join(map(str, f.FIRMWARE))
        if version.protocol != f.PROTOCOL or not version.firmware.startswith(f"{firmware}."):
            raise PlantSettingsError(
                f"{axis.name}: id {number} has firmware {version.firmware}, CAN Simple "
                f"{version.protocol}; firmware {firmware}, CAN Simple {f.PROTOCOL} is supported"
            )
        yield told((frame(number, f.CLEAR), b"\0"))
        limits = DriveLimits()
        if not self._options.unwatched:
            drive.parameters = f.endpoints(version, self._options.endpoints)
            for name, value in self._watchdog.items():
                yield from self._put(number, drive, name, value)
            limits = yield from self._limits(number, drive)
            scales = []
            for name in (f.SPEED_SCALE, f.TORQUE_SCALE):
                known = name in drive.parameters
                scales.append((yield from got(number, drive, name)) if known else f.FEED_FORWARD)
            drive.scales = scales[0], scales[1]
        self._drives[k] = drive
        return Identity(
            id=number,
            type=f"ODrive {version.hardware}",
            firmware=version.firmware,
            limits=limits,
            turn=ONE_TURN,
            says_law=f.LAW in drive.parameters,
        )

    @property
    def _watchdog(self) -> Mapping[str, float]:
        return {f.WATCHDOG_TIMEOUT: self._setup.timeout, f.WATCHDOG_ENABLED: 1.0}

    def _limits(self, number: int, drive: Drive) -> Questions[DriveLimits]:
        speed = yield from got(number, drive, f.SPEED_LIMIT)
        current = yield from got(number, drive, f.CURRENT_LIMIT)
        constant = yield from got(number, drive, f.TORQUE_CONSTANT)
        return DriveLimits(
            velocity=speed * REV if math.isfinite(speed) else None,
            torque=current * constant,
            current=current,
        )

    def _put(self, number: int, drive: Drive, name: str, value: float) -> Questions[None]:
        """Write a parameter and read it back: what answers to a write is not that."""
        endpoint = drive.parameters[name]
        yield told((frame(number, f.RX_SDO), written(endpoint, value)))
        if abs((yield from got(number, drive, name)) - value) > 1e-6:
            raise PlantSettingsError(f"id {number} does not accept {value:g} for {name}")

    def confirm(self, k: int) -> Questions[bool]:
        """Whether its watchdog is ours: a restart forgets it."""
        drive, right = self._drives[k], True
        for name, value in self._watchdog.items():
            if name in drive.parameters:
                read = yield from got(self._axes[k].id, drive, name)
                right = right and abs(read - value) <= 1e-6
        return right

    def begin(self, orders: Mapping[int, Order]) -> None:
        self._turn = (self._turn + 1) % len(IN_TURN)
        super().begin(orders)

    def _frames(self, orders: Mapping[int, Order]) -> Iterator[Frame]:
        for k, order in orders.items():
            number, drive = self._axes[k].id, self._drives[k]
            yield from order.request
            if order.action in ACTING:
                yield from self._command(k, order)
            elif order.action not in (ASK, CONFIRM):
                drive.law = 0
                yield frame(number, f.STATE), struct.pack("<I", f.IDLE)
                if order.action is RESET:
                    yield frame(number, f.CLEAR), b"\0"
            questions = f.ESTIMATES, IN_TURN[self._turn]
            drive.awaited, drive.estimates = set(questions), None
            self._answers.asked[k] += 1
            for command in questions:
                yield frame(number, command) | REMOTE, b""

    def _command(self, k: int, order: Order) -> Iterator[Frame]:
        """The set-point of a drive, and before it has it, its mode and its power."""
        number, drive, law = self._axes[k].id, self._drives[k], MODES[order.kind]
        yield self._set_point(k, order.kind, order.values)
        if law != drive.law:
            drive.law, drive.sent, drive.read = law, 0, None
        drive.sent += 1
        known, again = f.LAW in drive.parameters, drive.sent % SELDOM == 0
        if again or (drive.read != law if known else drive.sent <= REPEATED):
            yield frame(number, f.MODE), f.mode(law)
        if known and (again or drive.read != law):
            question = struct.pack("<BHB", f.READ, drive.parameters[f.LAW].id, 0)
            yield frame(number, f.RX_SDO), question
        if order.action is POWER_ON:
            yield frame(number, f.STATE), struct.pack("<I", f.CLOSED_LOOP)

    def _set_point(self, k: int, kind: SetPoint, value: Sequence[float]) -> Frame:
        _, _, torque, velocity, position, _, _ = value
        number, turns, speed = self._axes[k].id, position / REV, velocity / REV
        if kind is SetPoint.POSITION:
            data = f.position(turns, speed, torque, self._drives[k].scales)
            return frame(number, f.INPUT_POSITION), data
        if kind is SetPoint.VELOCITY:
            return frame(number, f.INPUT_VELOCITY), struct.pack("<ff", speed, torque)
        return frame(number, f.INPUT_TORQUE), struct.pack("<f", torque)

    def close(self) -> None:
        off = struct.pack("<I", f.IDLE)
        self.line.close((frame(axis.id, f.STATE), off) for axis in self._axes)

    def _take(self, message: Any) -> int | None:
        answers, data = self._answers, bytes(message.data)
        command, k = message.arbitration_id & 0x1F, answers.places.get(message.arbitration_id >> 5)
        if k is None or message.is_remote_frame:
            return None
        if (interview := self._interview(k)) is not None:
            interview.hear(command, data)
        elif command == f.TX_SDO and f.LAW in self._drives[k].parameters:
            law = parameter(self._drives[k].parameters[f.LAW], command, data)
            self._drives[k].read = self._drives[k].read if law is None else int(law)
        form, drive, reported = FORMATS.get(command), self._drives[k], answers.reported[k]
        if form is None or len(data) != 8:
            return None
        numbers = struct.unpack(form, data)
        if not all(map(math.isfinite, numbers)):
            return None
        if command == f.ESTIMATES:
            answers.position[k], answers.velocity[k] = numbers[0] * REV, numbers[1] * REV
            self._came(k, numbers[0], numbers[1], data)
        elif command == f.TORQUES:
            answers.torque[k] = numbers[1]
        else:
            reported.power = numbers[1] == f.CLOSED_LOOP
            reported.fault = flagged(numbers[0], f.ERRORS)
        reported.law = drive.read if f.LAW in drive.parameters else drive.law or None
        drive.awaited.discard(command)
        return None if drive.awaited else k

    def _came(self, k: int, turns: float, speed: float, data: bytes) -> None:
        """An answer; cyclic messages of the same drive are none of a second one."""
        drive = self._drives[k]
        if drive.estimates is None:
            drive.estimates = turns, speed
            self._answers.came(k, data)
        elif abs(turns - drive.estimates[0]) > APART + STALE * abs(drive.estimates[1]):
            self._answers.came(k, data)


def frame(drive: int, command: int) -> int:
    return drive << 5 | command


def written(endpoint: f.Endpoint, value: float) -> bytes:
    """Data of a frame that writes a parameter."""
    number = value if endpoint.form == "<f" else int(value)
    return struct.pack("<BHB", f.WRITE, endpoint.id, 0) + struct.pack(endpoint.form, number)


def requested(drive: int, command: int, *, several: bool = False) -> Question:
    """The question by a remote frame."""

    def pick(answered: int, data: bytes) -> bytes | None:
        return data if answered == command and len(data) == 8 else None

    return Question([(frame(drive, command) | REMOTE, b"")], pick, several)


def got(number: int, drive: Drive, name: str) -> Questions[float]:
    """A parameter of a drive."""
    endpoint = drive.parameters[name]

    def pick(command: int, data: bytes) -> float | None:
        return parameter(endpoint, command, data)

    question = struct.pack("<BHB", f.READ, endpoint.id, 0)
    request = [(frame(number, f.RX_SDO), question)]
    value: float = yield from ask(
        Question(request, pick), f"id {number} does not answer for {name}"
    )
    return value


def parameter(endpoint: f.Endpoint, command: int, data: bytes) -> float | None:
    """The value of a parameter in an answer; None: it is another's."""
    if command != f.TX_SDO or len(data) < 5 or data[1] | data[2] << 8 != endpoint.id:
        return None
    return float(struct.unpack_from(endpoint.form, data[4:].ljust(4, b"\0"))[0])


def scan(bus: str) -> list[Identity]:
    """The controllers that answer on a bus."""
    answers: dict[int, dict[int, bytes]] = {}
    with CanLine(bus) as line:
        for command in (f.VERSION, f.SUPPLY, f.BEAT):
            asked = partial(requested, command=command)
            for drive, data in line.survey(asked, IDS, words_of):
                answers.setdefault(drive, {})[command] = data
    return [
        identity_of(drive, said) for drive, said in sorted(answers.items()) if f.VERSION in said
    ]


def words_of(drive: int, message: Any) -> tuple[int, bytes] | None:
    """Command and data of a frame of a drive."""
    number, command = divmod(message.arbitration_id, 32)
    return (command, bytes(message.data)) if number == drive else None


def identity_of(drive: int, said: Mapping[int, bytes]) -> Identity:
    """A controller by its answers."""
    version = f.Version.parse(said[f.VERSION])
    errors = struct.unpack_from("<I", said[f.BEAT])[0] if f.BEAT in said else 0
    return Identity(
        id=drive,
        type=f"ODrive {version.hardware}",
        firmware=version.firmware,
        voltage=struct.unpack_from("<f", said[f.SUPPLY])[0] if f.SUPPLY in said else math.nan,
        fault=flagged(errors, f.ERRORS),
        turn=ONE_TURN,
    )


make = maker(OdriveDrives, OdriveOptions, IDS)

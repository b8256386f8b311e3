# SPDX-License-Identifier: Apache-2.0
"""CiA 402 drives on CANopen: two PDOs down and two or three up, by one SYNC for the bus.

A kind of set-point is a mode of operation, which comes in the PDO with its own targets::

    position    CSP (8)     target position, torque offset
    velocity    CSV (9)     target velocity, torque offset
    torque      CST (10)    target torque

The targets of the inactive modes are those at which the drive rests. Its watchdog is
the heartbeat of this driver (0x1016), a frame per exchange.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from ...core.terms.drives import OnSilence, SetPoint
from ..drives.can_drives import CanDrives, CanOptions
from ..drives.can_line import CanLine, Frame
from ..drives.driver import Identity, Order, Traits
from ..drives.faults import WATCHDOG
from ..drives.interview import Questions, converse, find, told
from ..drives.plant import maker
from ..drives.reconcile import ACTING, ASK, CONFIRM, RESET, SET_UP
from ..errors import PlantSettingsError
from ..interface import DriveFault
from . import objects as o
from .identity import REV, UNKNOWN, Cia402Axis, Scale, identity_of, limits_of, named, scale_of
from .sdo import Sdo, device_type
from .states import FAULT_RESET, TOWARDS_POWER, Mode, State, state_of

IDS = range(1, 127)
MODES = {
    SetPoint.POSITION: Mode.CSP,
    SetPoint.VELOCITY: Mode.CSV,
    SetPoint.TORQUE: Mode.CST,
}
#: What a drive does without heartbeat: objects and their values, a fault first.
ON_SILENCE = {
    OnSilence.FREE: {o.ABORT_OPTION: o.FAULT_SIGNAL, o.FAULT_OPTION: o.COAST},
    OnSilence.BRAKED: {o.ABORT_OPTION: o.QUICK_STOP, o.QUICK_STOP_OPTION: o.STAY_STOPPED},
}
LOST = DriveFault(0, "drive disabled itself or restarted; check that safe torque off is released")
#: States in which the motor has power.
POWERED = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)
FAULTED = (State.FAULT, State.FAULT_REACTION_ACTIVE)
#: Exchanges with the reset of a fault after which its communication is reset: an EPOS4 keeps error
#: 0x8130 until then (maxon's EPOS4 Firmware Specification, as drivers of others quote it).
MAX_RESETS = 20
#: The control word by SDO, which needs no SYNC and no mapping.
POWER_OFF = struct.pack("<BHBI", 0x2B, o.CONTROL, 0, 0)


@dataclass(slots=True)
class Drive:
    """One drive since it was set up.

    Attributes:
        scale: Its units.
        offset: Whether it has a torque offset.
        whole: What an answer consists of, a bit for each PDO.
        parts: Those that came in this exchange.
        state, error: As its PDOs report them.
        counts: Its position.
        word: The last control word.
        idle: Whether it had no power since it was set up.
        resets: Exchanges in which it was told to clear the fault of its watchdog, so far.
    """

    scale: Scale = UNKNOWN
    offset: bool = True
    whole: int = 3
    parts: int = 0
    state: State = State.SWITCH_ON_DISABLED
    error: int = 0
    counts: int = 0
    word: int = 0
    idle: bool = True
    resets: int = 0


@dataclass(frozen=True, kw_only=True)
class Cia402Options(CanOptions):
    """``modes``: those to use.

    Raises:
        PlantSettingsError: there is no such mode.
    """

    axis = Cia402Axis
    axes: tuple[Cia402Axis, ...] = ()
    modes: str = "csp csv cst"

    def __post_init__(self) -> None:
        if not self.used or not set(self.used) <= {mode.name.lower() for mode in Mode}:
            raise PlantSettingsError(f"modes={self.modes}: some of csp csv cst")

    @property
    def used(self) -> list[str]:
        return self.modes.replace(",", " ").split()


class Cia402Drives(CanDrives[Cia402Options]):
    """The drives of one bus; see ``drives.driver.Driver``."""

    power_lost, laws = LOST, MODES

    def __init__(self, options: Cia402Options) -> None:
        super().__init__(options, bitrate=options.bitrate)
        self.traits = Traits(
            set_points=tuple(k for k, m in MODES.items() if m.name.lower() in options.used),
            on_silence=tuple(ON_SILENCE),
            torque=True,
            laws=o.MODES,
            motor_encoders=frozenset(
                k for k, axis in enumerate(options.axes) if axis.motor_counts > 0.0
            ),
        )
        self._drives = [Drive() for _ in self._axes]

    def set_up(self, k: int) -> Questions[Identity]:
        """Disable, set watchdog and PDOs, start; the identification of the drive."""
        axis, sdo = self._options.axes[k], Sdo(self._axes[k].id)
        question = device_type(axis.id)
        device = yield from find(question, axis, self._options.bus, "cia402")
        if device & 0xFFFF != o.PROFILE:
            raise PlantSettingsError(
                f"{axis.name}: id {axis.id} has profile {device & 0xFFFF}; {o.PROFILE} (drives) "
                "is supported"
            )
        yield told((o.NMT, bytes([o.PRE_OPERATIONAL, axis.id])))
        yield from self._clear(axis.id, sdo)
        modes = yield from sdo.get(o.SUPPORTED_MODES, 0, "<I")
        for set_point in self.traits.set_points:
            if not modes >> MODES[set_point] - 1 & 1:
                modes_offered = [m.name.lower() for m in Mode if modes >> m - 1 & 1]
                raise PlantSettingsError(
                    f"{axis.name}: id {axis.id} has no {MODES[set_point].name}; add 'modes="
                    f"{' '.join(modes_offered)}' to plant_arguments"
                )
        yield from self._set_watchdog(k, sdo)
        yield from self._set_period(sdo)
        drive = Drive(scale=(yield from scale_of(axis, sdo)))
        drive.offset = (yield from sdo.maybe(o.TORQUE_OFFSET, 0, "<h")) is not None
        for function, mapped in o.MAPPED.items():
            objects = [item for item in mapped if item[0] != o.TORQUE_OFFSET or drive.offset]
            yield from sdo.map_pdo(function, objects)
        if k in self.traits.motor_encoders:
            drive.whole = 7
            yield from sdo.map_pdo(o.TPDO3, o.MOTOR)
        identity = yield from named(sdo, axis.id)
        limits = yield from limits_of(sdo, drive.scale)
        yield told((o.NMT, bytes([o.START, axis.id])))
        self._drives[k] = drive
        return replace(identity, limits=limits)

    def _clear(self, number: int, sdo: Sdo) -> Questions[None]:
        """Clear an earlier fault, as that of its watchdog; see MAX_RESETS."""
        for attempt in (False, True):
            for word in (0, FAULT_RESET, 0):
                yield from sdo.put(o.CONTROL, 0, "<H", word)
            error = yield from sdo.maybe(o.ERROR_CODE, 0, "<H")
            status = yield from sdo.get(o.STATUS, 0, "<H")
            if attempt or error != o.HEARTBEAT_LOST or state_of(status) not in FAULTED:
                return
            yield told((o.NMT, bytes([o.RESET_COMMUNICATION, number])))

    def _set_watchdog(self, k: int, sdo: Sdo) -> Questions[None]:
        """The consumer's heartbeat, and what follows when it is missing."""
        joint, axis = self._setup.joints[k], self._axes[k]
        silence = OnSilence.FREE if joint is None else joint.on_silence
        items = [(o.CONSUMER_HEARTBEAT, 1, "<I", self._watch)]
        items += [(index, 0, "<h", value) for index, value in ON_SILENCE[silence].items()]
        for index, subindex, form, value in items:
            if (yield from sdo.accepts(index, subindex, form, value)):
                continue
            absent = (yield from sdo.maybe(index, subindex, form)) is None
            if index == o.ABORT_OPTION and absent and silence is OnSilence.FREE:
                continue  # it is optional, and a fault signal without it
            if not self._options.unwatched:
                raise PlantSettingsError(
                    f"{axis.name}: id {axis.id} does not accept {value} in object "
                    f"0x{index:04x}:{subindex}, by which it would stop without frames; "
                    "unwatched=1 goes without"
                )
        # Where it exists: stay operational without heartbeat, and so report it.
        yield from sdo.accepts(o.ERROR_BEHAVIOUR, 1, "<B", 1)

    @property
    def _watch(self) -> int:
        return o.MASTER << 16 | max(1, int(1e3 * self._setup.timeout))

    def _set_period(self, sdo: Sdo) -> Questions[None]:
        """The period of SYNC, between whose targets a drive interpolates, where it has one."""
        period = self._setup.period
        exponent = -3 if abs(1e3 * period - round(1e3 * period)) < 1e-6 else -4
        units = max(1, min(255, round(period / 10.0**exponent)))
        yield from sdo.accepts(o.INTERPOLATION_PERIOD, 2, "<b", exponent)
        yield from sdo.accepts(o.INTERPOLATION_PERIOD, 1, "<B", units)
        yield from sdo.accepts(o.CYCLE_PERIOD, 0, "<I", round(1e6 * period))

    def confirm(self, k: int) -> Questions[bool]:
        """Whether its watchdog is ours: a restart forgets it."""
        sdo = Sdo(self._axes[k].id)
        watch = yield from sdo.maybe(o.CONSUMER_HEARTBEAT, 1, "<I")
        return watch == self._watch or self._options.unwatched

    def _frames(self, orders: Mapping[int, Order]) -> Iterator[Frame]:
        if orders:
            yield o.HEARTBEAT | o.MASTER, bytes([o.OPERATIONAL])
        for k, order in orders.items():
            self._drives[k].parts = 0
            self._answers.asked[k] += 1
            if request := order.request:
                yield from request
            elif order.action is SET_UP and self._answers.reported[k].unheard:
                self._answers.asked[k] += 1
                yield o.SDO_REQUEST | self._axes[k].id, POWER_OFF  # it may hear, unheard
            if order.action not in (SET_UP, ASK, CONFIRM):
                yield from self._targets(k, order)
        yield o.SYNC, b""

    def _targets(self, k: int, order: Order) -> Iterator[Frame]:
        """Control word, mode and targets; those of the other modes are those of rest."""
        number, drive, kind, value = self._axes[k].id, self._drives[k], order.kind, order.values
        scale, on = drive.scale, order.action in ACTING
        word = TOWARDS_POWER.get(drive.state, 0) if on else 0
        if order.action is RESET or waited(drive):
            word = 0 if drive.word & FAULT_RESET else FAULT_RESET
            drive.resets = drive.resets + 1 if drive.error == o.HEARTBEAT_LOST else 0
            if drive.resets == MAX_RESETS:  # it boots, and is set up again
                drive.resets = 0
                yield o.NMT, bytes([o.RESET_COMMUNICATION, number])
        drive.word = word
        mode = MODES[kind if on else self.traits.set_points[0]]
        position, speed, target, offset = drive.counts, 0, 0, 0
        if on:
            _, _, torque, velocity, place, _, _ = value
            target, offset = whole(torque * scale.torque, 16), 0
            if kind is not SetPoint.TORQUE:
                target, offset = offset, target
            if kind is SetPoint.POSITION:
                position = whole(place * scale.position, 32)
            elif kind is SetPoint.VELOCITY:
                speed = whole(velocity * scale.velocity, 32)
        first = struct.pack(o.RPDO1_FORMAT, word, mode, target, offset)
        yield o.RPDO1 | number, first if drive.offset else first[:-2]
        yield o.RPDO2 | number, struct.pack(o.RPDO2_FORMAT, position, speed)

    def close(self) -> None:
        """Power off and no watchdog, by commands that need no SYNC, and leave the bus."""
        unwatched = struct.pack("<BHBI", 0x23, o.CONSUMER_HEARTBEAT, 1, 0)
        self.line.close(
            (o.SDO_REQUEST | axis.id, data)
            for data in (POWER_OFF, unwatched)
            for axis in self._axes
        )

    def _take(self, message: Any) -> int | None:
        answers, data = self._answers, bytes(message.data)
        frame: int = message.arbitration_id
        function, k = frame & 0x780, answers.places.get(frame & 0x7F)
        if k is None:
            return None
        interview = self._interview(k)
        if function == o.HEARTBEAT and data[:1] == bytes([o.BOOT_UP]):
            answers.reported[k].lost = True
        elif function == o.SDO_ANSWER and len(data) == 8 and interview is not None:
            answers.came(k, data)
            interview.hear(data)
            return k if interview.answered and answers.reported[k].lost else None
        elif function in o.ANSWERS and not answers.reported[k].lost:
            self._read_pdo(k, function, data)
            return k if self._drives[k].parts == self._drives[k].whole else None
        return None

    def _read_pdo(self, k: int, function: int, data: bytes) -> None:
        answers, drive, reported = self._answers, self._drives[k], self._answers.reported[k]
        part, form = o.ANSWERS[function]
        if len(data) != struct.calcsize(form):
            return
        numbers = struct.unpack(form, data)
        if function == o.TPDO1:
            drive.state, drive.counts = state_of(numbers[0]), numbers[1]
            answers.position[k] = numbers[1] / drive.scale.position
            answers.torque[k] = numbers[2] / drive.scale.torque
            reported.power = drive.state in POWERED
            drive.idle = drive.idle and not reported.power
            answers.came(k, data)
        elif function == o.TPDO2:
            answers.velocity[k] = numbers[0] / drive.scale.velocity
            drive.error, reported.law = numbers[1], numbers[2]
        else:
            answers.motor_position[k] = numbers[0] * REV / self._options.axes[k].motor_counts
        reported.fault = judged(drive)
        drive.parts |= part


def waited(drive: Drive) -> bool:
    """Whether its only fault is that no heartbeat came between its set-up and the first cycle."""
    return drive.idle and drive.state is State.FAULT and drive.error == o.HEARTBEAT_LOST


def judged(drive: Drive) -> DriveFault | None:
    """The fault of a drive by its state and its error code."""
    if drive.state in FAULTED and not waited(drive):
        return DriveFault(drive.error, o.error_name(drive.error))
    return WATCHDOG if drive.state is State.QUICK_STOP_ACTIVE else None


def whole(value: float, bits: int) -> int:
    """A value as a signed integer, at its end where it is beyond."""
    limit = (1 << bits - 1) - 1
    return round(max(-limit, min(limit, value)))


def scan(bus: str) -> list[Identity]:
    """The drives that answer on a bus."""
    with CanLine(bus) as line:
        return [
            identified(line, drive)
            for drive, device in line.survey(device_type, IDS, data_of)
            if device & 0xFFFF == o.PROFILE
        ]


def data_of(drive: int, message: Any) -> tuple[bytes] | None:
    """The answer of a drive by SDO in a frame."""
    right = message.arbitration_id == o.SDO_ANSWER | drive and len(message.data) == 8
    return (bytes(message.data),) if right else None


def identified(line: CanLine, drive: int) -> Identity:
    """The identification of a drive on a line that nobody else uses."""
    answers = partial(line.ask, words_of=partial(data_of, drive))
    return converse(identity_of(Sdo(drive), drive), answers)


make = maker(Cia402Drives, Cia402Options, IDS)

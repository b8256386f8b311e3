# SPDX-License-Identifier: Apache-2.0
"""Dynamixel X servos over protocol 2: sync writes and one sync read for a whole bus.

A kind of set-point is an operating mode, which such a servo changes without torque only, by
packets that it acknowledges: torque off until it is reported, mode and goal read back, torque on.
Positions have no velocity and no feed-forward.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.axes import Options
from ..drives.can_line import budget
from ..drives.driver import ONE_TURN, Answers, Found, Order, Traits
from ..drives.faults import RESTARTED, WATCHDOG, flagged
from ..drives.interview import Question, Questions, find
from ..drives.plant import maker
from ..drives.reconcile import Action
from ..drives.serial_line import Item, Request, ServoBus, get, put
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import table as t

#: The goal and the operating mode of each kind.
GOALS = {
    SetPoint.PWM: (t.GOAL_PWM, t.PWM_MODE),
    SetPoint.CURRENT: (t.GOAL_CURRENT, t.CURRENT_MODE),
    SetPoint.VELOCITY: (t.GOAL_VELOCITY, t.VELOCITY_MODE),
    SetPoint.POSITION: (t.GOAL_POSITION, t.EXTENDED),
}
IDS = range(253)


@dataclass(slots=True)
class Servo:
    """One servo since it was set up.

    Attributes: model; data (where its indirect data begin); pwm, current (its limits, counts);
        mode (as it acknowledged).
    """

    model: t.Model = t.MODELS[1020]
    data: int = t.DATA
    pwm: int = t.FULL_PWM
    current: int = 0
    mode: int = t.POSITION_MODE


class DynamixelDrives:
    """The servos of one bus; see ``drives.driver.Driver``."""

    live, power_lost = False, RESTARTED

    def __init__(self, options: Options) -> None:
        self._options, self._axes = options, options.axes
        self._senses = bool(options.own["current"])
        self._position_mode = int(options.own["position_mode"])
        if self._position_mode not in (3, 4, 5):
            raise PlantSettingsError(
                f"position_mode={self._position_mode}: 3 (one turn), 4 (several turns) "
                "or 5 (several turns, bounded current) is required"
            )
        kinds = (SetPoint.POSITION, SetPoint.VELOCITY, SetPoint.CURRENT, SetPoint.PWM)
        self.traits = Traits(
            set_points=tuple(k for k in kinds if self._senses or k is not SetPoint.CURRENT),
            on_silence=(OnSilence.BRAKED, OnSilence.FREE),
            resolution=t.COUNT,
            current=self._senses,
            temperature=True,
            voltage=True,
            laws=t.MODES,
        )
        self.line = ServoBus(t.LIBRARY, options.bus, int(options.own["baudrate"]))
        self._servos = [Servo() for _ in self._axes]

    def open(self, setup: Setup, answers: Answers) -> None:
        self.line.open()
        self._answers, self._wait = answers, budget(setup.period)
        self._watch = max(1, min(127, int(setup.timeout / t.WATCHDOG_STEP)))  # never longer

    def law(self, k: int, kind: SetPoint) -> int:
        del k
        return self._position_mode if kind is SetPoint.POSITION else GOALS[kind][1]

    def set_up(self, k: int) -> Questions[Found]:
        """Torque off, indirect reads, watchdog; the drive's identification and limits."""
        axis, drive = self._axes[k], self._axes[k].id
        question = Question(Request(t.MODEL), lambda reply: reply, several=True)
        number = (yield from find(question, axis, self._options.bus, "dynamixel")).value
        if (model := t.MODELS.get(number)) is None:
            raise PlantSettingsError(
                f"{axis.name}: id {drive} is of model {number}; supported: "
                + ", ".join(known.name for known in t.MODELS.values())
            )
        if self._senses and not model.ampere:
            raise PlantSettingsError(
                f"{axis.name}: {model.name} has no current control; add current=0 to "
                "plant_arguments"
            )
        firmware = yield from get(drive, t.FIRMWARE)
        yield from self._put(drive, t.TORQUE, 0)
        yield from self._put(drive, t.WATCHDOG, 0)
        place = t.INDIRECT
        for item in t.READ:
            for byte in range(item.length):
                yield from self._put(drive, Item(place, 2), item.address + byte)
                place += 2
        yield from self._put(drive, t.WATCHDOG, self._watch)
        pwm = yield from get(drive, t.PWM_LIMIT)
        current = (yield from get(drive, t.CURRENT_LIMIT)) if model.ampere else 0
        mode = yield from get(drive, t.MODE)
        self._servos[k] = Servo(model, model.data(firmware), pwm, current, mode)
        ends: list[float | None] = [None, None]
        if self._position_mode == t.POSITION_MODE:
            for n, item in enumerate((t.MIN_POSITION, t.MAX_POSITION)):
                ends[n] = angle((yield from get(drive, item, signed=True)))
        speed, error = (yield from get(drive, t.VELOCITY_LIMIT)), (yield from get(drive, t.ERROR))
        limits = DriveLimits(
            lower=ends[0],
            upper=ends[1],
            velocity=speed * t.SPEED,
            current=current * model.ampere or None,
        )
        volts = yield from get(drive, t.VOLTAGE)
        found = Found(id=drive, type=model.name, firmware=f"{firmware}", voltage=volts * t.VOLT)
        turn = 0.0 if self._position_mode == t.POSITION_MODE else ONE_TURN
        return replace(found, fault=flagged(error, t.ERRORS), limits=limits, turn=turn)

    def confirm(self, k: int) -> Questions[bool]:
        """A restart is seen in what is read: its watchdog is 0."""
        del k
        yield from ()
        return True

    def set_law(self, k: int, law: int) -> Questions[int]:
        """The mode, where it is another, and its goal of rest, each acknowledged."""
        drive, servo = self._axes[k].id, self._servos[k]
        if servo.mode != law:
            yield from self._put(drive, t.MODE, law)
            servo.mode = law
        rest = {t.PWM_MODE: t.GOAL_PWM, t.CURRENT_MODE: t.GOAL_CURRENT,
                t.VELOCITY_MODE: t.GOAL_VELOCITY}  # fmt: skip
        if law in rest:
            yield from self._put(drive, rest[law], 0)
        else:
            place = round(self._answers.position[k] / t.COUNT) + t.CENTRE
            yield from self._put(drive, t.GOAL_POSITION, place)
        return law

    def _put(self, drive: int, item: Item, value: int) -> Questions[None]:
        return put(drive, item, value, t.LIBRARY.refusal)

    def exchange(self, orders: Mapping[int, Order]) -> None:
        reported = self._answers.reported
        acting = (Action.GOAL, Action.POWER_ON)
        driven = {k: order for k, order in orders.items() if order.action in acting}
        off = [k for k in orders if k not in driven and orders[k].action is not Action.ASK]
        off = [k for k in off if reported[k].power or reported[k].lost]  # it may hear, unheard
        self._sync(t.TORQUE, dict.fromkeys(off, 0))
        for k, order in orders.items():
            if order.action is Action.RESET:
                self._reset(k)
        self._goals(driven)
        on = [k for k, order in driven.items() if order.action is Action.POWER_ON]
        if on:
            self._sync(t.TORQUE, dict.fromkeys(on, 1))
            self._goals({k: driven[k] for k in on})
        self._read(orders)
        for k, order in orders.items():
            self.line.hold(self._axes[k].id, order.interview, self._wait if driven else 0.0)

    def _reset(self, k: int) -> None:
        """A restart clears a shutdown, a new watchdog one that tripped."""
        reported, drive = self._answers.reported[k], self._axes[k].id
        if reported.fault is WATCHDOG:
            self._sync(t.WATCHDOG, {k: 0})
            self._sync(t.WATCHDOG, {k: self._watch})
        elif reported.fault is not None:
            self.line.protocol.reboot(self.line.port, drive)

    def close(self) -> None:
        self.line.close(self._axes)

    def _goals(self, orders: Mapping[int, Order]) -> None:
        for kind, (item, _) in GOALS.items():
            mine = {k: order for k, order in orders.items() if order.kind is kind}
            self._sync(item, {k: self._raw(k, kind, order.values) for k, order in mine.items()})

    def _raw(self, k: int, kind: SetPoint, value: Sequence[float]) -> int:
        """The goal of a kind in counts; the servo refuses one beyond its limit (S4)."""
        servo = self._servos[k]
        if kind is SetPoint.PWM:
            return cut(value[Value.PWM] / 100.0 * t.FULL_PWM, servo.pwm)
        if kind is SetPoint.CURRENT:
            return cut(value[Value.CURRENT] / servo.model.ampere, servo.current)
        if kind is SetPoint.VELOCITY:
            return round(value[Value.VELOCITY] / t.SPEED)
        return round(value[Value.POSITION] / t.COUNT) + t.CENTRE

    def _sync(self, item: Item, values: Mapping[int, int]) -> None:
        signed = item.length > 1
        packed = {self._axes[k].id: item.pack(v, signed=signed) for k, v in values.items()}
        self.line.sync(item, packed)

    def _read(self, drives: Iterable[int]) -> None:
        """What is read of each, by the place of its indirect data."""
        self.line.drain(self._take)
        places: dict[int, list[int]] = {}
        for k in drives:
            places.setdefault(self._servos[k].data, []).append(self._axes[k].id)
            self._answers.asked[k] += 1
        for place, ids in places.items():
            self.line.read(Item(place, t.READ_LENGTH), sorted(ids), self._take, self._wait)

    def _take(self, drive: int, data: bytes) -> None:
        answers = self._answers
        k = answers.places.get(drive)
        if k is None or len(data) != t.READ_LENGTH:
            return
        answers.came(k, data)
        reported = answers.reported[k]
        torque, error, watchdog, current, velocity, position, volts, degrees = struct.unpack(
            t.READ_FORMAT, data
        )
        if reported.lost or watchdog == 0:  # what it reads is not set up
            reported.lost = True
            return
        reported.power, reported.fault = bool(torque), judged(error, watchdog)
        answers.position[k] = angle(position)
        answers.velocity[k] = velocity * t.SPEED
        answers.current[k] = current * self._servos[k].model.ampere
        answers.voltage[k], answers.temperature[k] = volts * t.VOLT, degrees


def judged(error: int, watchdog: int) -> DriveFault | None:
    """The fault of a servo by its hardware errors and its watchdog."""
    return flagged(error, t.ERRORS) or (WATCHDOG if watchdog == t.TRIPPED else None)


def cut(value: float, most: int) -> int:
    return round(max(-most, min(most, value)))


def angle(count: int) -> float:
    """Rad at the output for counts; 0 in the middle of the first turn."""
    return (count - t.CENTRE) * t.COUNT


def scan(device: str, baudrate: int = 1_000_000) -> list[Found]:
    """The servos that answer on a bus."""
    with ServoBus(t.LIBRARY, device, baudrate) as bus:
        answered, _ = bus.protocol.broadcastPing(bus.port)
        return [identity(bus, drive) for drive in sorted(answered)]


def identity(bus: ServoBus, drive: int) -> Found:
    number, error = bus.get(drive, t.MODEL), bus.get(drive, t.ERROR)
    return Found(
        id=drive,
        type=t.MODELS[number].name if number in t.MODELS else f"model {number}",
        firmware=str(bus.get(drive, t.FIRMWARE)),
        voltage=bus.get(drive, t.VOLTAGE) * t.VOLT,
        fault=flagged(error, t.ERRORS),
        turn=ONE_TURN,
    )


def set_id(device: str, old: int, new: int, baudrate: int = 1_000_000) -> None:
    """Give a servo another id, which it stores; see ``ServoBus.set_id``."""
    with ServoBus(t.LIBRARY, device, baudrate) as bus:
        bus.set_id(old, new, IDS, t.ID)


make = maker(
    DynamixelDrives,
    bus="/dev/ttyUSB0",
    ids=IDS,
    whole={"baudrate": 1e6, "current": 1.0, "position_mode": float(t.EXTENDED)},
)

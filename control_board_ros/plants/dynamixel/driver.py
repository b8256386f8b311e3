# SPDX-License-Identifier: Apache-2.0
"""Dynamixel X servos over protocol 2: one sync write and one sync read for a whole bus.

A kind of set-point is an operating mode, which such a servo changes without torque only: in one
exchange torque off, mode, goal, torque on. Positions have no velocity and no
feed-forward.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.axes import Options
from ..drives.can_line import ATTEMPTS, budget
from ..drives.driver import Answers, Found, Traits, Wanted, only
from ..drives.faults import WATCHDOG, flagged
from ..drives.plant import maker
from ..drives.serial_line import Item, ServoBus
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import table as t

GOALS = {
    SetPoint.PWM: (t.GOAL_PWM, t.PWM_MODE),
    SetPoint.CURRENT: (t.GOAL_CURRENT, t.CURRENT_MODE),
    SetPoint.VELOCITY: (t.GOAL_VELOCITY, t.VELOCITY_MODE),
    SetPoint.POSITION: (t.GOAL_POSITION, t.EXTENDED),
}
#: Answers without torque, until that counts as a fault of a servo that should have it.
UNPOWERED = 5


@dataclass(slots=True)
class Servo:
    """One servo since it was set up.

    Attributes: model, pwm and current (its limits, counts), kind (as requested), without (answers
        in a row without torque, while it should have it).
    """

    model: t.Model = t.MODELS[1020]
    pwm: int = t.FULL_PWM
    current: int = 0
    kind: SetPoint = SetPoint.OFF
    without: int = 0


class DynamixelDrives:
    """The servos of one bus; see ``drives.driver.Driver``."""

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
        )
        self._bus = ServoBus(t.LIBRARY, options.bus, int(options.own["baudrate"]))
        self._servos = [Servo() for _ in self._axes]

    def open(self, setup: Setup, answers: Answers) -> None:
        self._bus.open()
        self._answers, self._wait = answers, budget(setup.period)
        self._watch = max(1, min(127, int(setup.timeout / t.WATCHDOG_STEP)))  # never longer

    def set_up(self, k: int, attempts: int = ATTEMPTS) -> Found:
        """Disable torque, set indirect reads and watchdog; returns the drive's identification."""
        bus, axis = self._bus, self._axes[k]
        number = only(bus.models(axis.id, attempts), axis, self._options.bus, "dynamixel")
        drive, name = axis.id, axis.name
        if (model := t.MODELS.get(number)) is None:
            raise PlantSettingsError(
                f"{name}: id {drive} is of model {number}; supported: "
                + ", ".join(known.name for known in t.MODELS.values())
            )
        if self._senses and not model.ampere:
            raise PlantSettingsError(
                f"{name}: {model.name} has no current control; add current=0 to plant_arguments"
            )
        self._servos[k] = servo = Servo(model)
        servo.pwm = bus.get(drive, t.PWM_LIMIT)
        servo.current = bus.get(drive, t.CURRENT_LIMIT) if model.ampere else 0
        bus.put(drive, t.TORQUE, 0)
        bus.put(drive, t.WATCHDOG, 0)
        place = t.INDIRECT
        for item in t.READ:
            for byte in range(item.length):
                bus.put(drive, Item(place, 2), item.address + byte)
                place += 2
        bus.put(drive, t.WATCHDOG, self._watch)
        bounded = self._position_mode == t.POSITION_MODE
        limits = DriveLimits(
            lower=angle(bus.get(drive, t.MIN_POSITION, signed=True)) if bounded else None,
            upper=angle(bus.get(drive, t.MAX_POSITION, signed=True)) if bounded else None,
            velocity=bus.get(drive, t.VELOCITY_LIMIT) * t.SPEED,
            current=servo.current * model.ampere or None,
        )
        return replace(identity(bus, drive), limits=limits)

    def exchange(self, wanted: Wanted) -> None:
        kinds = {k: kind for k, (kind, _) in wanted.items()}
        changed = {k: kind for k, kind in kinds.items() if kind is not self._servos[k].kind}
        if changed:
            self._sync(t.TORQUE, dict.fromkeys(changed, 0))
            on = {k: kind for k, kind in changed.items() if kind is not SetPoint.OFF}
            self._sync(t.MODE, {k: self._mode(kind) for k, kind in on.items()})
            self._goals(on, wanted)
            self._sync(t.TORQUE, dict.fromkeys(on, 1))
            for k, kind in changed.items():
                self._servos[k].kind, self._servos[k].without = kind, 0
        self._goals(kinds, wanted)
        self._read(wanted)

    def clear_fault(self, k: int) -> None:
        """A reboot clears a shutdown, a new watchdog one that tripped."""
        bus, axis = self._bus, self._axes[k].id
        if bus.get(axis, t.ERROR):
            bus.protocol.reboot(bus.port, axis)
            self._answers.restarted[k] = True
        else:
            bus.put(axis, t.WATCHDOG, 0)
            bus.put(axis, t.WATCHDOG, self._watch)

    def close(self) -> None:
        self._bus.close(self._axes)

    def _mode(self, kind: SetPoint) -> int:
        return self._position_mode if kind is SetPoint.POSITION else GOALS[kind][1]

    def _goals(self, kinds: Mapping[int, SetPoint], wanted: Wanted) -> None:
        for kind, (item, _) in GOALS.items():
            self._sync(
                item, {k: self._raw(k, kind, wanted[k][1]) for k in kinds if kinds[k] is kind}
            )

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
        packed = {
            self._axes[k].id: item.pack(value, signed=item.length > 1)
            for k, value in values.items()
        }
        self._bus.sync(item, packed)

    def _read(self, drives: Collection[int]) -> None:
        """What is read of each, by the place of its indirect data."""
        self._bus.drain(self._take)
        for place in {self._servos[k].model.data for k in drives}:
            ids = sorted(self._axes[k].id for k in drives if self._servos[k].model.data == place)
            item = Item(place, t.READ_LENGTH)
            self._bus.read(item, ids, self._take, self._wait)

    def _take(self, drive: int, data: bytes) -> None:
        answers = self._answers
        k = answers.places.get(drive)
        if k is not None and len(data) == t.READ_LENGTH:
            found = struct.unpack(t.READ_FORMAT, data)
            answers.faults[k] = self._judge(k, *found[:3])
            if not answers.restarted[k]:
                current, velocity, position, volts, degrees = found[3:]
                answers.position[k] = angle(position)
                answers.velocity[k] = velocity * t.SPEED
                answers.current[k] = current * self._servos[k].model.ampere
                answers.voltage[k], answers.temperature[k] = volts * t.VOLT, degrees
            answers.came(k, data)

    def _judge(self, k: int, torque: int, error: int, watchdog: int) -> DriveFault | None:
        if error:
            return flagged(error, t.ERRORS)
        if watchdog == 0:  # what it reads is not set up any more
            self._answers.restarted[k] = True
        if watchdog == t.TRIPPED:
            return WATCHDOG
        servo = self._servos[k]
        servo.without = 0 if torque or not servo.kind else servo.without + 1
        if servo.without >= UNPOWERED:
            return DriveFault(0, "no torque, although enabled")
        return None


def cut(value: float, most: int) -> int:
    return round(max(-most, min(most, value)))


def angle(count: int) -> float:
    """Rad at the output for counts; 0 in the middle of the first turn."""
    return (count - t.CENTRE) * t.COUNT


def identity(bus: ServoBus, drive: int) -> Found:
    number, error = bus.get(drive, t.MODEL), bus.get(drive, t.ERROR)
    return Found(
        id=drive,
        type=t.MODELS[number].name if number in t.MODELS else f"model {number}",
        firmware=str(bus.get(drive, t.FIRMWARE)),
        voltage=bus.get(drive, t.VOLTAGE) * t.VOLT,
        fault=flagged(error, t.ERRORS),
    )


def scan(device: str) -> list[Found]:
    with ServoBus(t.LIBRARY, device) as bus:
        answered, _ = bus.protocol.broadcastPing(bus.port)
        return [identity(bus, drive) for drive in sorted(answered)]


make = maker(
    DynamixelDrives,
    bus="/dev/ttyUSB0",
    ids=range(253),
    whole={"baudrate": 1e6, "current": 1.0, "position_mode": float(t.EXTENDED)},
)

# SPDX-License-Identifier: Apache-2.0
"""Dynamixel X servos over protocol 2: sync writes and one sync read for a whole bus.

A kind of set-point is an operating mode, which such a servo changes without torque only, by
packets that it acknowledges: torque off until it is reported, mode and goal read back, torque on.
Positions have no velocity and no feed-forward.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.driver import ONE_TURN, Answers, Identity, Order, Traits
from ..drives.faults import WATCHDOG, flagged
from ..drives.interview import Questions
from ..drives.plant import maker
from ..drives.serial_line import Item, ServoBus, get
from ..drives.servo_drives import IDS, ServoDrives, ServoOptions
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
#: A mode that was written and is not read back yet.
UNKNOWN = -1


@dataclass(frozen=True, kw_only=True)
class DynamixelOptions(ServoOptions):
    """``current``: the servos have a current sensor; ``position_mode``: that of positions.

    Raises:
        PlantSettingsError: it is none.
    """

    current: bool = True
    position_mode: int = t.EXTENDED

    def __post_init__(self) -> None:
        if self.position_mode not in (3, 4, 5):
            raise PlantSettingsError(
                f"position_mode={self.position_mode}: 3 (one turn), 4 (several turns) "
                "or 5 (several turns, bounded current) is required"
            )


@dataclass(slots=True)
class Servo:
    """One servo since it was set up.

    Attributes: model; data (where its indirect data begin); pwm, current (its limits, counts);
        gains (D, I and P of positions, as found); mode (as read back), reset (whether it
        has set the gains back).
    """

    model: t.Model = t.MODELS[1020]
    data: int = t.DATA
    pwm: int = t.FULL_PWM
    current: int = 0
    gains: int = 0
    mode: int = t.POSITION_MODE
    reset: bool = False


class DynamixelDrives(ServoDrives[DynamixelOptions]):
    """The servos of one bus; see ``drives.driver.Driver``."""

    library, driver, length, again = t.LIBRARY, "dynamixel", t.READ_LENGTH, True
    models = {number: model.name for number, model in t.MODELS.items()}

    def __init__(self, options: DynamixelOptions) -> None:
        super().__init__(options)
        kinds = (SetPoint.POSITION, SetPoint.VELOCITY, SetPoint.CURRENT, SetPoint.PWM)
        self.laws = {kind: GOALS[kind][1] for kind in kinds}
        self.laws[SetPoint.POSITION] = options.position_mode
        self.traits = Traits(
            set_points=tuple(k for k in kinds if options.current or k is not SetPoint.CURRENT),
            on_silence=(OnSilence.BRAKED, OnSilence.FREE),
            resolution=t.COUNT,
            current=options.current,
            temperature=True,
            voltage=True,
            laws=t.MODES,
            stiffness=True,
        )
        self._servos = [Servo() for _ in self._axes]

    def open(self, setup: Setup, answers: Answers) -> None:
        super().open(setup, answers)
        self._watch = max(1, min(127, int(setup.timeout / t.WATCHDOG_STEP)))  # never longer

    def set_up(self, k: int) -> Questions[Identity]:
        """Torque off, indirect reads, watchdog; the drive's identification and limits."""
        axis, drive = self._axes[k], self._axes[k].id
        model = t.MODELS[(yield from self._model(k))]
        if self._options.current and not model.ampere:
            raise PlantSettingsError(
                f"{axis.name}: {model.name} has no current control; add current=0 to "
                "plant_arguments"
            )
        firmware = yield from get(drive, t.FIRMWARE)
        yield from self._put(k, t.TORQUE, 0)
        yield from self._put(k, t.WATCHDOG, 0)
        place = t.INDIRECT
        for item in t.READ:
            for byte in range(item.length):
                yield from self._put(k, Item(place, 2), item.address + byte)
                place += 2
        yield from self._put(k, t.WATCHDOG, self._watch)
        pwm = yield from get(drive, t.PWM_LIMIT)
        current = (yield from get(drive, t.CURRENT_LIMIT)) if model.ampere else 0
        mode = yield from get(drive, t.MODE)
        gains = yield from get(drive, t.POSITION_GAINS)
        self._servos[k] = Servo(model, model.data(firmware), pwm, current, gains, mode)
        ends: list[float | None] = [None, None]
        if self._options.position_mode == t.POSITION_MODE:
            for n, item in enumerate((t.MIN_POSITION, t.MAX_POSITION)):
                ends[n] = angle((yield from get(drive, item, signed=True)))
        speed, stall = (yield from get(drive, t.VELOCITY_LIMIT)), self._stall(k)
        limits = DriveLimits(
            lower=ends[0],
            upper=ends[1],
            velocity=speed * t.SPEED,
            torque=pwm / t.FULL_PWM * stall or None,
            current=current * model.ampere or None,
        )
        gain = (gains >> 32) / t.POSITION_P_STEP / t.FULL_PWM / t.COUNT
        turn = 0.0 if self._options.position_mode == t.POSITION_MODE else ONE_TURN
        return Identity(
            id=drive,
            type=model.name,
            firmware=f"{firmware}",
            limits=limits,
            stiffness=gain * stall,
            turn=turn,
        )

    def set_law(self, k: int, law: int) -> Questions[int]:
        """The mode, where it is another, read back, and its goal of rest, acknowledged.

        A change resets the gains (e-manual, "Operating Mode(11)"): they are as found again.
        """
        servo = self._servos[k]
        rest = {t.PWM_MODE: t.GOAL_PWM, t.CURRENT_MODE: t.GOAL_CURRENT,
                t.VELOCITY_MODE: t.GOAL_VELOCITY}  # fmt: skip
        if servo.mode == UNKNOWN:
            servo.mode = yield from get(self._axes[k].id, t.MODE)
        if servo.mode != law:
            servo.mode, servo.reset = UNKNOWN, True  # also where an answer is lost
            yield from self._put(k, t.MODE, law)
            servo.mode = yield from get(self._axes[k].id, t.MODE)
        if servo.reset and law not in rest:
            yield from self._put(k, t.POSITION_GAINS, servo.gains)
            servo.reset = False
        if law in rest:
            yield from self._put(k, rest[law], 0)
        else:
            place = round(self._answers.position[k] / t.COUNT) + t.CENTRE
            yield from self._put(k, t.GOAL_POSITION, place)
        return servo.mode

    def _reset(self, k: int) -> None:
        """A restart clears a shutdown, a new watchdog one that tripped."""
        reported, drive = self._answers.reported[k], self._axes[k].id
        if reported.fault is WATCHDOG:
            self._sync(t.WATCHDOG, {k: 0})
            self._sync(t.WATCHDOG, {k: self._watch})
        elif reported.fault is not None:
            self.line.protocol.reboot(self.line.port, drive)

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
        packed = {self._ids[k]: item.pack(v, signed=signed) for k, v in values.items()}
        self.line.sync(item, packed)

    def _read(self, orders: Mapping[int, Order]) -> None:
        """What is read of each, by the place of its indirect data."""
        places: dict[int, list[int]] = {}
        for k in orders:
            places.setdefault(self._servos[k].data, []).append(self._ids[k])
        for place, ids in places.items():
            self.line.read(Item(place, t.READ_LENGTH), sorted(ids), self._take, self._wait)

    def _parse(self, k: int, data: bytes) -> None:
        answers, reported = self._answers, self._answers.reported[k]
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


def scan(device: str, baudrate: int = 1_000_000) -> list[Identity]:
    """The servos that answer on a bus."""
    with ServoBus(t.LIBRARY, device, baudrate) as bus:
        answered, _ = bus.protocol.broadcastPing(bus.port)
        return [identity(bus, drive) for drive in sorted(answered)]


def identity(bus: ServoBus, drive: int) -> Identity:
    number, error = bus.get(drive, t.MODEL), bus.get(drive, t.ERROR)
    return Identity(
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


make = maker(DynamixelDrives, DynamixelOptions, IDS)

# SPDX-License-Identifier: Apache-2.0
"""Feetech STS servos by their maker's library: one sync write and one sync read for a whole bus.

They have no watchdog: a servo without commands follows its last one. For a position that is
holding it; velocities and PWM are offered with ``unwatched=1`` only. A kind of set-point is an
operating mode, changed without torque, and not stored. Positions have no velocity and no
feed-forward.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.axes import Options
from ..drives.can_line import ATTEMPTS, budget
from ..drives.driver import Answers, Found, Traits, Wanted, only
from ..drives.faults import flagged
from ..drives.plant import maker
from ..drives.serial_line import Item, ServoBus
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import table as t

MODES = {
    SetPoint.POSITION: t.POSITION_MODE,
    SetPoint.VELOCITY: t.VELOCITY_MODE,
    SetPoint.PWM: t.PWM_MODE,
}
IDS = range(253)
#: Answers without torque that mean a restart of a servo that should have torque.
UNPOWERED = 5


@dataclass(slots=True)
class Servo:
    """One servo since it was set up.

    Attributes: kind (as requested), mode and torque (whether it is on) by the last answer, place
        (its position in counts, as it answers), without (answers in a row without torque, while it
        should have it), had (it had torque since its kind was requested).
    """

    kind: SetPoint = SetPoint.OFF
    mode: int = t.POSITION_MODE
    torque: bool = False
    place: int = t.CENTRE
    without: int = 0
    had: bool = False


class FeetechDrives:
    """The servos of one bus; see ``drives.driver.Driver``."""

    def __init__(self, options: Options) -> None:
        self._options, self._axes = options, options.axes
        self.traits = Traits(
            set_points=tuple(MODES) if options.own["unwatched"] else (SetPoint.POSITION,),
            on_silence=(OnSilence.BRAKED,),
            resolution=t.COUNT,
            current=True,
            temperature=True,
            voltage=True,
        )
        self._bus = ServoBus(t.LIBRARY, options.bus, int(options.own["baudrate"]))
        self._servos = [Servo() for _ in self._axes]

    def open(self, setup: Setup, answers: Answers) -> None:
        self._bus.open()
        self._answers, self._wait = answers, budget(setup.period)

    def set_up(self, k: int, attempts: int = ATTEMPTS) -> Found:
        """Disable torque and ramps; returns the identification of the drive."""
        bus, axis = self._bus, self._axes[k]
        number = only(bus.models(axis.id, attempts), axis, self._options.bus, "feetech")
        drive = axis.id
        if number not in t.MODELS:
            raise PlantSettingsError(
                f"{axis.name}: id {drive} is of model {number}; supported: "
                + ", ".join(t.MODELS.values())
            )
        # Behind the lock a mode acts, and is not stored.
        for item, value in ((t.TORQUE, 0), (t.LOCK, 1), (t.ACCELERATION, 0)):
            bus.put(drive, item, value)
        bus.put(drive, t.MODE, t.POSITION_MODE)
        self._servos[k] = Servo()
        lower, upper = bus.get(drive, t.MIN_POSITION), bus.get(drive, t.MAX_POSITION)
        limits = DriveLimits(
            lower=angle(lower) if lower < upper else None,
            upper=angle(upper) if lower < upper else None,
            velocity=bus.get(drive, t.SPEED_LIMIT) * t.SPEED_LIMIT_STEP * t.COUNT or None,
            current=bus.get(drive, t.CURRENT_LIMIT) * t.AMPERE or None,
        )
        return replace(identity(bus, drive), limits=limits)

    def exchange(self, wanted: Wanted) -> None:
        bus, servos, ids = self._bus, self._servos, [axis.id for axis in self._axes]
        kinds = {k: kind for k, (kind, _) in wanted.items()}
        powered = {k: kind for k, kind in kinds.items() if kind is not SetPoint.OFF}
        modes = {k: MODES[kind] for k, kind in powered.items() if MODES[kind] != servos[k].mode}
        bus.sync(t.TORQUE, {ids[k]: bytes(1) for k in modes})
        bus.sync(t.MODE, {ids[k]: bytes([mode]) for k, mode in modes.items()})
        targets = {k: goals(kind, wanted[k][1], servos[k].place) for k, kind in powered.items()}
        bus.sync(t.GOALS, {ids[k]: data for k, data in targets.items()})
        # Repeated while the answers differ; but no torque to one that had it, and lost it.
        switches = {
            ids[k]: bytes([k in powered])
            for k, kind in kinds.items()
            if k in modes
            or kind is not servos[k].kind
            or (servos[k].torque is not (k in powered) and not servos[k].had)
        }
        bus.sync(t.TORQUE, switches)
        for k, kind in kinds.items():
            if kind is not servos[k].kind:
                servos[k].kind, servos[k].without, servos[k].had = kind, 0, False
        bus.drain(self._take)
        if wanted:
            bus.read(t.READ, [ids[k] for k in wanted], self._take, self._wait)

    def clear_fault(self, k: int) -> None:
        """Torque off resets a shutdown."""
        self._bus.put(self._axes[k].id, t.TORQUE, 0)

    def close(self) -> None:
        self._bus.close(self._axes)

    def _take(self, drive: int, data: bytes) -> None:
        answers = self._answers
        k = answers.places.get(drive)
        if k is not None and len(data) == t.READ.length:
            servo = self._servos[k]
            servo.mode, servo.torque = part(data, t.MODE), bool(part(data, t.TORQUE))
            servo.place = part(data, t.POSITION)
            answers.faults[k] = self._judge(k, part(data, t.STATUS))
            answers.position[k] = angle(servo.place)
            answers.velocity[k] = t.signed(part(data, t.VELOCITY)) * t.COUNT
            answers.current[k] = t.signed(part(data, t.CURRENT)) * t.AMPERE
            answers.voltage[k] = part(data, t.VOLTAGE) * t.VOLT
            answers.temperature[k] = part(data, t.TEMPERATURE)
            answers.came(k, data)

    def _judge(self, k: int, status: int) -> DriveFault | None:
        servo = self._servos[k]
        powered = servo.kind is not SetPoint.OFF
        servo.had = powered and (servo.had or servo.torque)
        servo.without = servo.without + 1 if powered and not servo.torque else 0
        if servo.without >= UNPOWERED:
            self._answers.restarted[k] = True
        return flagged(status, t.ERRORS)


def part(data: bytes, item: Item) -> int:
    """A number of what is read in each exchange."""
    place = item.address - t.READ.address
    return int.from_bytes(data[place : place + item.length], "little")


def angle(count: int) -> float:
    """Rad at the output for counts; 0 in the middle of the turn."""
    return (t.signed(count) - t.CENTRE) * t.COUNT


def goals(kind: SetPoint, value: Sequence[float], place: int) -> bytes:
    """Goal position, time or PWM, and velocity of a kind of set-point.

    Those of the other kinds are those of rest: the position is ``place``, where the servo is.
    """
    position, pwm, velocity = place, 0, 0
    if kind is SetPoint.POSITION:
        position = t.magnitude(value[Value.POSITION] / t.COUNT + t.CENTRE)
    elif kind is SetPoint.VELOCITY:
        velocity = t.magnitude(value[Value.VELOCITY] / t.COUNT)
    else:
        output = max(-100.0, min(100.0, value[Value.PWM]))
        pwm = t.magnitude(output / 100.0 * t.FULL_PWM, t.PWM_SIGN)
    return struct.pack("<HHH", position, pwm, velocity)


def identity(bus: ServoBus, drive: int) -> Found:
    number, status = bus.get(drive, t.MODEL), bus.get(drive, t.STATUS)
    firmware = bus.get(drive, t.FIRMWARE)
    return Found(
        id=drive,
        type=t.MODELS.get(number, f"model {number}"),
        firmware=f"{firmware & 0xFF}.{firmware >> 8}",
        voltage=bus.get(drive, t.VOLTAGE) * t.VOLT,
        fault=flagged(status, t.ERRORS),
    )


def scan(device: str) -> list[Found]:
    with ServoBus(t.LIBRARY, device) as bus:
        bus.port.wait = 5e-3
        return [identity(bus, drive) for drive in IDS if bus.models(drive, attempts=1)]


make = maker(
    FeetechDrives,
    bus="/dev/ttyUSB0",
    ids=IDS,
    whole={"baudrate": 1e6, "unwatched": 0.0},
)

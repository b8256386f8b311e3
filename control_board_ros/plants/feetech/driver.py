# SPDX-License-Identifier: Apache-2.0
"""Feetech STS servos by their maker's library: sync writes and one sync read for a whole bus.

They have no watchdog: a servo without commands follows its last one. For a position that is
holding it; velocities and PWM are offered with ``unwatched=1`` only. A kind of set-point is an
operating mode, changed without torque, by packets that the servo acknowledges, and not stored.
Positions have no velocity and no feed-forward.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.driver import Identity, Order, Traits
from ..drives.faults import flagged
from ..drives.interview import PAUSE, Questions, longer
from ..drives.plant import maker
from ..drives.serial_line import Item, ServoBus, get
from ..drives.servo_drives import IDS, ServoDrives, ServoOptions
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits
from . import table as t

MODES = {
    SetPoint.POSITION: t.POSITION_MODE,
    SetPoint.VELOCITY: t.VELOCITY_MODE,
    SetPoint.PWM: t.PWM_MODE,
}


@dataclass(frozen=True, kw_only=True)
class FeetechOptions(ServoOptions):
    """``unwatched``: with set-points that continue when this computer stops."""

    unwatched: bool = False


class FeetechDrives(ServoDrives[FeetechOptions]):
    """The servos of one bus; see ``drives.driver.Driver``."""

    library, driver, models, laws = t.LIBRARY, "feetech", t.MODELS, MODES
    length = t.READ.length

    def __init__(self, options: FeetechOptions) -> None:
        super().__init__(options)
        self.traits = Traits(
            set_points=tuple(MODES) if options.unwatched else (SetPoint.POSITION,),
            on_silence=(OnSilence.BRAKED,),
            resolution=t.COUNT,
            current=True,
            temperature=True,
            voltage=True,
            laws=t.MODES,
            stiffness=True,
        )
        #: Position of each servo in counts, and its mode, as it answers.
        self._places = [t.CENTRE] * len(self._axes)
        self._modes = [t.POSITION_MODE] * len(self._axes)
        #: Offset of each count, and whether it wrapped.
        self._homing, self._wrapped = [0] * len(self._axes), [False] * len(self._axes)

    def set_up(self, k: int) -> Questions[Identity]:
        """Disable torque and ramps; the identification of the drive and its limits."""
        axis, drive = self._axes[k], self._axes[k].id
        number = yield from self._model(k)
        for item, mask, right, name in t.READINGS:
            for attempt in (3, 5, 0):  # before it is refused it is read again, after late answers
                if (value := (yield from get(drive, item))) & mask == right:
                    break
                yield longer(PAUSE, attempt)
            else:
                raise PlantSettingsError(
                    f"{axis.name}: {name} (address {item.address}) of id {drive} is {value}: its "
                    f"positions are not those of one turn; set its bits {mask:#x} to {right:#x} "
                    "with the maker's tool"
                )
        # Behind the lock a mode acts, and is not stored.
        for item, value in ((t.TORQUE, 0), (t.LOCK, 1), (t.ACCELERATION, 0)):
            yield from self._put(k, item, value)
        lower, upper = (
            (yield from get(drive, t.MIN_POSITION)),
            (yield from get(drive, t.MAX_POSITION)),
        )
        if lower >= upper:  # none of its own: those of its count, which would wrap
            lower, upper = 0, t.LAST
        homing, self._wrapped[k] = (yield from get(drive, t.HOMING)), False
        self._homing[k] = t.signed(homing, t.HOMING_SIGN)
        speed, stall = (yield from get(drive, t.SPEED_LIMIT)), self._stall(k)
        most = min(t.MOST_DUTY, 1e-3 * (yield from get(drive, t.TORQUE_LIMIT)))
        limits = DriveLimits(
            lower=angle(lower),
            upper=angle(upper),
            velocity=speed * t.SPEED_LIMIT_STEP * t.COUNT or None,
            torque=most * stall or None,
            current=(yield from get(drive, t.CURRENT_LIMIT)) * t.AMPERE or None,
        )
        stiffness = t.GAIN * (yield from get(drive, t.P)) * stall
        firmware = yield from get(drive, t.FIRMWARE)
        return Identity(
            id=drive,
            type=t.MODELS[number],
            firmware=f"{firmware & 0xFF}.{firmware >> 8}",
            limits=limits,
            stiffness=stiffness,
        )

    def set_law(self, k: int, law: int) -> Questions[int]:
        """Goals of rest, and the mode, where it is another; each acknowledged."""
        rest = struct.pack("<HHH", self._places[k], 0, 0)
        yield from self._put(k, t.GOALS, int.from_bytes(rest, "little"))
        if self._modes[k] != law:
            yield from self._put(k, t.MODE, law)
        return law

    def _reset(self, k: int) -> None:
        """Torque off resets a shutdown, too."""
        self._wrapped[k] = False

    def _goals(self, orders: Mapping[int, Order]) -> None:
        targets = {self._ids[k]: goals(order.kind, order.values, self._places[k])
                   for k, order in orders.items()}  # fmt: skip
        self.line.sync(t.GOALS, targets)

    def _read(self, orders: Mapping[int, Order]) -> None:
        if orders:
            self.line.read(t.READ, [self._ids[k] for k in orders], self._take, self._wait)

    def _parse(self, k: int, data: bytes) -> None:
        answers, reported, before = self._answers, self._answers.reported[k], self._places[k]
        self._places[k] = part(data, t.POSITION)
        if not part(data, t.LOCK):
            reported.lost = True
        way = t.signed(self._places[k]) - t.signed(before)
        if abs(way) > t.CENTRE and not reported.lost:
            self._wrapped[k] = True
        reported.power = bool(part(data, t.TORQUE))
        self._modes[k] = part(data, t.MODE)
        if reported.power:
            reported.law = self._modes[k]
        reported.fault = flagged(part(data, t.STATUS), t.ERRORS) or self._wrap(k)
        answers.position[k] = angle(self._places[k])
        answers.velocity[k] = t.signed(part(data, t.VELOCITY)) * t.COUNT
        answers.current[k] = t.signed(part(data, t.CURRENT)) * t.AMPERE
        answers.voltage[k] = part(data, t.VOLTAGE) * t.VOLT
        answers.temperature[k] = part(data, t.TEMPERATURE)

    def _wrap(self, k: int) -> DriveFault | None:
        """The fault of a count that jumped by a turn, inside the travel of the joint."""
        if not self._wrapped[k]:
            return None
        return DriveFault(
            0,
            "its count wrapped: move it back, and set its Homing_Offset (address "
            f"{t.HOMING.address}, now {self._homing[k]}) so that it counts {t.CENTRE} in the "
            "middle of its travel",
        )


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


def identity(bus: ServoBus, drive: int) -> Identity:
    number, status = bus.get(drive, t.MODEL), bus.get(drive, t.STATUS)
    firmware = bus.get(drive, t.FIRMWARE)
    return Identity(
        id=drive,
        type=t.MODELS.get(number, f"model {number}"),
        firmware=f"{firmware & 0xFF}.{firmware >> 8}",
        voltage=bus.get(drive, t.VOLTAGE) * t.VOLT,
        fault=flagged(status, t.ERRORS),
    )


def scan(device: str, baudrate: int = 1_000_000) -> list[Identity]:
    """The servos that answer on a bus."""
    with ServoBus(t.LIBRARY, device, baudrate) as bus:
        bus.port.wait = 5e-3
        return [identity(bus, drive) for drive in IDS if bus.models(drive, attempts=1)]


def set_id(device: str, old: int, new: int, baudrate: int = 1_000_000) -> None:
    """Give a servo another id, which it stores; see ``ServoBus.set_id``."""
    with ServoBus(t.LIBRARY, device, baudrate) as bus:
        bus.set_id(old, new, IDS, t.ID, t.LOCK)


make = maker(FeetechDrives, FeetechOptions, IDS)

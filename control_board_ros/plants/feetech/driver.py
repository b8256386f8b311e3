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

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.axes import Options
from ..drives.can_line import budget
from ..drives.driver import Answers, Found, Order, Traits
from ..drives.faults import RESTARTED, flagged
from ..drives.interview import PAUSE, Question, Questions, find, longer
from ..drives.plant import maker
from ..drives.reconcile import Action
from ..drives.serial_line import Item, Request, ServoBus, get, put
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import table as t

MODES = {
    SetPoint.POSITION: t.POSITION_MODE,
    SetPoint.VELOCITY: t.VELOCITY_MODE,
    SetPoint.PWM: t.PWM_MODE,
}
IDS = range(253)


class FeetechDrives:
    """The servos of one bus; see ``drives.driver.Driver``."""

    live, power_lost = False, RESTARTED

    def __init__(self, options: Options) -> None:
        self._options, self._axes = options, options.axes
        self.traits = Traits(
            set_points=tuple(MODES) if options.own["unwatched"] else (SetPoint.POSITION,),
            on_silence=(OnSilence.BRAKED,),
            resolution=t.COUNT,
            current=True,
            temperature=True,
            voltage=True,
            laws=t.MODES,
        )
        self.line = ServoBus(t.LIBRARY, options.bus, int(options.own["baudrate"]))
        #: Position of each servo in counts, and its mode, as it answers.
        self._places = [t.CENTRE] * len(self._axes)
        self._modes = [t.POSITION_MODE] * len(self._axes)
        #: Offset of each count, and whether it wrapped.
        self._homing, self._wrapped = [0] * len(self._axes), [False] * len(self._axes)

    def open(self, setup: Setup, answers: Answers) -> None:
        self.line.open()
        self._answers, self._wait = answers, budget(setup.period)

    def law(self, k: int, kind: SetPoint) -> int:
        del k
        return MODES[kind]

    def set_up(self, k: int) -> Questions[Found]:
        """Disable torque and ramps; the identification of the drive and its limits."""
        axis, drive = self._axes[k], self._axes[k].id
        question = Question(Request(t.MODEL), lambda reply: reply, several=True)
        number = (yield from find(question, axis, self._options.bus, "feetech")).value
        if number not in t.MODELS:
            raise PlantSettingsError(
                f"{axis.name}: id {drive} is of model {number}; supported: "
                + ", ".join(t.MODELS.values())
            )
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
            yield from self._put(drive, item, value)
        lower, upper = (
            (yield from get(drive, t.MIN_POSITION)),
            (yield from get(drive, t.MAX_POSITION)),
        )
        if lower >= upper:  # none of its own: those of its count, which would wrap
            lower, upper = 0, t.LAST
        homing, self._wrapped[k] = (yield from get(drive, t.HOMING)), False
        self._homing[k] = t.signed(homing, t.HOMING_SIGN)
        speed = yield from get(drive, t.SPEED_LIMIT)
        limits = DriveLimits(
            lower=angle(lower),
            upper=angle(upper),
            velocity=speed * t.SPEED_LIMIT_STEP * t.COUNT or None,
            current=(yield from get(drive, t.CURRENT_LIMIT)) * t.AMPERE or None,
        )
        firmware, status = (yield from get(drive, t.FIRMWARE)), (yield from get(drive, t.STATUS))
        return Found(
            id=drive,
            type=t.MODELS[number],
            firmware=f"{firmware & 0xFF}.{firmware >> 8}",
            fault=flagged(status, t.ERRORS),
            limits=limits,
        )

    def confirm(self, k: int) -> Questions[bool]:
        """A restart is seen in what is read: its lock is 0."""
        del k
        yield from ()
        return True

    def set_law(self, k: int, law: int) -> Questions[int]:
        """Goals of rest, and the mode, where it is another; each acknowledged."""
        drive = self._axes[k].id
        rest = struct.pack("<HHH", self._places[k], 0, 0)
        yield from self._put(drive, t.GOALS, int.from_bytes(rest, "little"))
        if self._modes[k] != law:
            yield from self._put(drive, t.MODE, law)
        return law

    def _put(self, drive: int, item: Item, value: int) -> Questions[None]:
        return put(drive, item, value, t.LIBRARY.refusal)

    def exchange(self, orders: Mapping[int, Order]) -> None:
        ids, reported = [axis.id for axis in self._axes], self._answers.reported
        acting = (Action.GOAL, Action.POWER_ON)
        driven = {k: order for k, order in orders.items() if order.action in acting}
        rest = [k for k in orders if k not in driven and orders[k].action is not Action.ASK]
        # Torque off resets a shutdown, too; a servo that is not heard may hear it.
        off = [
            k
            for k in rest
            if reported[k].power or reported[k].lost or orders[k].action is Action.RESET
        ]
        self.line.sync(t.TORQUE, {ids[k]: bytes(1) for k in off})
        targets = {ids[k]: self._goals(k, order) for k, order in driven.items()}
        self.line.sync(t.GOALS, targets)
        on = [ids[k] for k, order in driven.items() if order.action is Action.POWER_ON]
        self.line.sync(t.TORQUE, dict.fromkeys(on, b"\1"))
        self.line.drain(self._take)
        for k, order in orders.items():
            self._answers.asked[k] += 1
            self._wrapped[k] &= order.action is not Action.RESET
        if orders:
            self.line.read(t.READ, [ids[k] for k in orders], self._take, self._wait)
        for k, order in orders.items():
            self.line.hold(ids[k], order.interview, self._wait if driven else 0.0)

    def close(self) -> None:
        self.line.close(self._axes)

    def _goals(self, k: int, order: Order) -> bytes:
        return goals(order.kind, order.values, self._places[k])

    def _take(self, drive: int, data: bytes) -> None:
        answers = self._answers
        k = answers.places.get(drive)
        if k is None or len(data) != t.READ.length:
            return
        answers.came(k, data)
        reported, before = answers.reported[k], self._places[k]
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


def scan(device: str, baudrate: int = 1_000_000) -> list[Found]:
    """The servos that answer on a bus."""
    with ServoBus(t.LIBRARY, device, baudrate) as bus:
        bus.port.wait = 5e-3
        return [identity(bus, drive) for drive in IDS if bus.models(drive, attempts=1)]


def set_id(device: str, old: int, new: int, baudrate: int = 1_000_000) -> None:
    """Give a servo another id, which it stores; see ``ServoBus.set_id``."""
    with ServoBus(t.LIBRARY, device, baudrate) as bus:
        bus.set_id(old, new, IDS, t.ID, t.LOCK)


make = maker(
    FeetechDrives,
    bus="/dev/ttyUSB0",
    ids=IDS,
    whole={"baudrate": 1e6, "unwatched": 0.0},
)

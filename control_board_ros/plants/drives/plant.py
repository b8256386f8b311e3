# SPDX-License-Identifier: Apache-2.0
"""The drives of one bus as a plant: what every make has in common.

In each exchange every drive gets the action that ``reconcile.step`` gives for what the board wants
and what the drive reported. Here are directions, ratios and offsets, the last answer of each
drive, its age, its set-up in one question per exchange, and the faults that are no drive's own:
silence, restart, two drives with one id, and what is not confirmed within the timeout.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

import numpy as np

from ...core.terms.drives import DriveReport, OnSilence, SetPoint
from ...core.terms.measurement import Array, SetPoints, Value
from ..interface import Description, DriveFault, JointDescription, Readings, Setup
from .axes import Axes, Axis
from .can_drives import CanDrives, Own
from .clock import Clock
from .driver import NONE, Answers, Driver, Identity, Order, zero_of
from .faults import RESTARTED, UNCONFIRMED
from .interview import Interview, Questions
from .reconcile import (
    ASKING,
    GOAL,
    OFF,
    POWER_ON,
    RESET,
    UNHEARD,
    Action,
    Desired,
    done,
    step,
    unconfirmed,
)  # fmt: skip
from .turns import Zero

#: A drive that did not answer yet.
UNKNOWN = Identity(id=0, type="")
#: Longest period of exchanges while the bus is connected, s.
PACE = 5e-3
#: Surplus answers that mean two drives with one id, less some for each exchange without.
CLASHES, FORGIVEN = 3.0, 0.3
#: Most answers that may be pending, above what one exchange reads.
LATEST = 100
#: s after which drives report again what did not change.
REPORT = 1.0
UNPOWERED = Desired(None)
#: By their numbers.
KINDS = tuple(SetPoint)
#: Actions after which a drive that had power still has it.
HOLDING = (GOAL, POWER_ON, Action.ASK)
Fault = str | DriveFault
Make = Callable[[Sequence[str], Mapping[str, str]], "DrivesPlant"]


class DrivesPlant:
    """A DrivePlant over the drives of one bus.

    Args:
        axes: One for each joint, in the board's order.
        driver: Of their make, in the same order.

    Attributes: axes, driver; answers (the last of each drive); far_end (virtual drives that are
        closed with it, or None); clock (set before ``connect``).
    """

    def __init__(self, axes: Sequence[Axis], driver: Driver) -> None:
        self.axes, self.driver = tuple(axes), driver
        self.far_end: Any = None
        self.clock = Clock()
        self._axes = Axes(axes)
        self._shafts = any(axis.motor_turns for axis in axes)
        self._timeout, self._period = math.inf, 0.0
        self._free = [True] * len(axes)
        self._identities: list[Identity | None] = [None] * len(axes)
        self._off = SetPoints.off(len(axes))
        self._zeros = [Zero(axis) for axis in axes]
        self._begin()

    def _begin(self) -> None:
        n = len(self.axes)
        self.answers = Answers(self.axes, self.clock.now)
        self._clashes, self._owed = [0.0] * n, [0] * n
        #: Start of the overdue answer of each drive, s; a loop that pauses expects none.
        self._asked = [math.inf] * n
        self._interviews: list[Interview[Any] | None] = [None] * n
        #: Faults that last until they are cleared.
        self._latched: list[Fault | None] = [None] * n
        self._resets = [False] * n
        self._wishes, self._actions = [UNPOWERED] * n, [OFF] * n
        #: Since when each drive does not report what is desired, s; inf: it does.
        self._undone = [math.inf] * n
        self._had_power = [False] * n
        #: What the drives reported last, and when they report again, s.
        self._said: list[tuple[Any, ...]] | None = None
        self._says_at: float

    def describe(self) -> Description:
        """What the drives have; with type, firmware and limits of each once it is connected."""
        traits = self.driver.traits
        joints = (
            JointDescription(
                name=axis.name,
                set_points=traits.set_points,
                drive="" if identity is None else f"{identity.type} {identity.firmware}".strip(),
                rate=traits.rate,
                resolution=traits.resolution / axis.ratio,
                limits=NONE
                if identity is None
                else axis.limits_at_joint(identity.limits, zero.shift),
                stiffness=(identity or UNKNOWN).stiffness * axis.ratio**2
                if traits.stiffness
                else None,
                turn=zero.turn / axis.ratio,
                turned=zero.shift / axis.factor,
                on_silence=traits.on_silence,
                torque_estimate=traits.torque,
                current_sensor=traits.current,
                temperature_sensor=traits.temperature,
                motor_encoder=axis.motor_turns > 0.0 or k in traits.motor_encoders,
            )
            for k, (axis, identity, zero) in enumerate(
                zip(self.axes, self._identities, self._zeros, strict=True)
            )
        )
        return Description(joints=tuple(joints))

    def connect(self, setup: Setup) -> None:
        """Open the bus again, and set up its drives.

        Raises:
            OSError: a drive does not answer, or two answer as one.
            ValueError: a drive is none that this driver supports.
        """
        self.driver.close()
        self._begin()
        self._timeout, self._period = setup.timeout, setup.period
        self._free = [j is None or j.on_silence is OnSilence.FREE for j in setup.joints]
        for zero, joint in zip(self._zeros, setup.joints, strict=True):
            zero.begin(joint)
        self.driver.line.clock = self.clock
        self.driver.open(setup, self.answers)
        reported, everyone = self.answers.reported, range(len(self.axes))
        while any(report.lost for report in reported):
            orders = {k: self._order(k, UNPOWERED, SetPoint.OFF, ()) for k in everyone}
            self._send(orders, self.driver.exchange)
            self._judge()
            self.clock.pass_by(min(self._period, PACE))
        self.exchange(self._off)

    def exchange(self, wanted: SetPoints) -> Readings:
        """Send set-points and read; a silent drive keeps its last reading."""
        self._send(self._orders(wanted), self.driver.exchange)
        return self.finish()

    def fileno(self) -> int | None:
        """The number of the socket of its bus; None: it has none, ``exchange`` is all there is."""
        return self.driver.line.fileno() if isinstance(self.driver, CanDrives) else None

    def begin(self, wanted: SetPoints) -> None:
        """The first part of an exchange, on a bus with a ``fileno``: send set-points.

        Raises:
            TypeError: its drives have no such bus.
        """
        if not isinstance(self.driver, CanDrives):
            raise TypeError("the bus of these drives has no socket")
        self._send(self._orders(wanted), self.driver.begin)

    def read(self, end: float) -> bool:
        """The second: read answers until all are there, or until a time, s; false then."""
        return bool(self.driver.line.read(end))

    def finish(self) -> Readings:
        """The last: judge what came."""
        self._judge()
        return self._readings(self._begun)

    def _orders(self, wanted: SetPoints) -> dict[int, Order]:
        sent = self._axes.to_drive(wanted)
        if any(shifts := self._shifts):
            sent[Value.POSITION] -= shifts
        orders: dict[int, Order] = {}
        for k, (number, values) in enumerate(
            zip(wanted.kinds.tolist(), sent.T.tolist(), strict=True)
        ):
            if kind := KINDS[number]:
                self._zeros[k].lost = False  # its calibration began
            try:
                orders[k] = self._order(k, self._wish(k, kind), kind, values)
            except (OSError, ValueError) as error:  # of the set-up of this drive alone
                self._interviews[k] = None
                self._latched[k] = str(error)
                orders[k] = Order(OFF, SetPoint.OFF, values)
        return orders

    def _send(
        self, orders: Mapping[int, Order], tell: Callable[[Mapping[int, Order]], None]
    ) -> None:
        self._begun, self._sent = self.clock.now(), orders
        self.answers.begin()
        self._before = [reported.power for reported in self.answers.reported]
        tell(orders)

    def _judge(self) -> None:
        """What the answers of an exchange say."""
        answers, before = self.answers, self._before
        for k, order in self._sent.items():
            self._actions[k] = order.action
            if order.interview is None:
                answers.miss(k)
            else:
                order.interview.asks = False
            reported = answers.reported[k]
            heard = bool(answers.raw[k])
            off = order.action in (OFF, RESET)
            unseen = not before[k] and reported.unheard >= UNHEARD
            reported.stale = reported.power and (off or unseen or reported.stale)
            reported.unheard = 0 if heard else reported.unheard + 1
            if reported.power or off:
                reported.confirmed = False
            if off and not self.driver.live and not reported.power:
                reported.law = None  # it is set again before each power, with goals of rest
        self._notice_clashes()

    def _wish(self, k: int, kind: SetPoint) -> Desired:
        """What the board wants of a drive; nothing while a fault lasts, or it was never read."""
        unread = math.isnan(self.answers.position[k])
        if not kind or unread or self._latched[k] is not None or self._zeros[k].fault:
            reset, self._resets[k] = self._resets[k], False
            return Desired(None, reset=True) if reset else UNPOWERED
        law, last = self.driver.law(k, kind), self._wishes[k]
        return last if last.law == law else Desired(law, self.driver.live)

    def _order(self, k: int, wish: Desired, kind: SetPoint, values: Sequence[float]) -> Order:
        """The next action of a drive, after its interview went on.

        Raises:
            OSError, ValueError: from its set-up.
        """
        reported = self.answers.reported[k]
        self._wishes[k] = wish
        while (action := step(wish, reported)) in ASKING:
            if not self._ask_on(k, action):
                return Order(action, kind, values, self._interviews[k])
        self._interviews[k] = None
        if action is POWER_ON:  # a goal of rest, until power is reported
            values = [*values]
            values[Value.POSITION], values[Value.VELOCITY] = self.answers.position[k], 0.0
        return Order(action, kind, values)

    def _ask_on(self, k: int, action: Action) -> bool:
        """Go on with the interview of a drive; true when it is over."""
        now, reported = self.clock.now(), self.answers.reported[k]
        interview = self._interviews[k]
        if interview is None:
            interview = self._interviews[k] = Interview(self._questions(k, action), now)
        if not interview.advance(now):
            return False
        self._interviews[k] = None
        if action is Action.SET_UP:
            self._identities[k], reported.lost = interview.result, False
            self._zeros[k].set_up(math.nan if interview.result is None else interview.result.turn)
        elif action is Action.SET_LAW:
            reported.law = interview.result
        elif interview.result:
            reported.confirmed = True
        else:
            self._lose(k, RESTARTED)
        return True

    def _questions(self, k: int, action: Action) -> Questions[Any]:
        if action is Action.SET_UP:
            return self.driver.set_up(k)
        if action is Action.CONFIRM:
            return self.driver.confirm(k)
        return self.driver.set_law(k, self._wishes[k].law)

    def _lose(self, k: int, fault: Fault) -> None:
        """The set-up of a drive is lost."""
        reported = self.answers.reported[k]
        reported.lost, reported.power = True, False
        reported.law = reported.fault = None
        self._interviews[k], self._latched[k] = None, fault

    def _readings(self, begin: float) -> Readings:
        answers, traits, now = self.answers, self.driver.traits, self.clock.now()
        late = [time < begin for time in answers.times]
        ages = self._aged(late, begin, now)
        position, velocity, torque, current, temperature, voltage = self._axes.from_drive(
            answers.values
        )
        if any(shifts := self._shifts):
            position = self._axes.position(answers.position + shifts)
        position = self._watch_turns(position, late)
        shafts = self._at_shafts() if self._shafts or traits.motor_encoders else (None, None)
        return Readings(
            position=position,
            velocity=velocity,
            torque=torque if traits.torque else None,
            current=current if traits.current else None,
            temperature=temperature if traits.temperature else None,
            voltage=voltage if traits.voltage else None,
            motor_position=shafts[0],
            motor_velocity=shafts[1],
            ages=ages,
            dropped=self._dropped(),
            faults=[self._fault(k, now) for k in range(len(late))],
            lost=np.array(lost) if any(lost := [zero.lost for zero in self._zeros]) else None,
            drives=self._reports(now),
        )

    def _aged(self, late: Sequence[bool], begin: float, now: float) -> Array:
        """The ages of the last answers, s; those that are silent have the fault."""
        ages = np.zeros(len(late))
        for k, overdue in enumerate(late):
            if not overdue:
                self._asked[k] = math.inf
                continue
            self._asked[k] = min(self._asked[k], begin)
            owed = now - self._asked[k]  # a loop that pauses is no silence
            ages[k] = min(owed + self._period, self._timeout)
            if owed > self._timeout:
                fault = silent(self.axes[k], now - self.answers.times[k])
                if self.answers.reported[k].lost:  # its set-up goes on
                    self._latched[k] = fault
                else:
                    self._lose(k, fault)
        return ages

    def _reports(self, now: float) -> list[DriveReport] | None:
        """What the drives report of themselves, where it changed, and once in REPORT."""
        reports = [(report.power, report.law, report.lost or report.unheard >= UNHEARD)
                for report in self.answers.reported]  # fmt: skip
        if reports == self._said and now < self._says_at:
            return None
        self._said, self._says_at = reports, now + REPORT
        return [self._report(k, *report) for k, report in enumerate(reports)]

    def _report(self, k: int, power: bool, law: Hashable, silent: bool) -> DriveReport:
        identity, option, names = self._identities[k], self.axes[k].turn, self.driver.traits.laws
        if identity is None:
            return DriveReport(lost=self.answers.lost[k], late=self.answers.late[k])
        name = f"{law} {names[law]}" if law in names else f"{law}"
        return DriveReport(
            zero=zero_of(identity.turn if option is None else option),
            power=power if identity.says_power and not silent else None,
            law=name if identity.says_law and not silent and law is not None else None,
            lost=self.answers.lost[k],
            late=self.answers.late[k],
        )

    def _dropped(self) -> Array | None:
        count = getattr(self.driver.line, "dropped", 0)
        return np.full(len(self.axes), float(count)) if count else None

    def _watch_turns(self, position: Array, late: Sequence[bool]) -> Array:
        """Positions with turns corrected after a set-up; a jump shows a restart, too (S9)."""
        answers = self.answers
        for k, (zero, place) in enumerate(zip(self._zeros, position.tolist(), strict=True)):
            if zero.turn and zero.jumps(place, answers.times[k] + self._period):
                self._lose(k, RESTARTED)
            if late[k] or answers.reported[k].lost or math.isnan(place):
                continue
            if zero.due:
                zero.find(float(self._axes.position(answers.position)[k]))
                position = self._axes.position(answers.position + self._shifts)
            if not zero.fault:
                zero.keep(position.item(k), answers.times[k])
        return position

    @property
    def _shifts(self) -> list[float]:
        return [zero.shift for zero in self._zeros]

    def _fault(self, k: int, now: float) -> Fault | None:
        """The fault of a drive: its own, or one of those that are judged here."""
        reported, wish = self.answers.reported[k], self._wishes[k]
        if self._clashes[k] >= CLASHES:
            self._latched[k] = f"two drives answer as id {self.axes[k].id}; change that of one"
        elif reported.lost:
            if self._latched[k] is None:
                self._lose(k, RESTARTED)
        elif reported.fault is not None:
            self._undone[k] = math.inf
            return reported.fault
        elif self._had_power[k] and not reported.power and self._actions[k] in HOLDING:
            self._lose(k, self.driver.power_lost)
        elif done(wish, reported):
            self._undone[k] = math.inf
        elif reported.unheard == 0:
            self._undone[k] = min(self._undone[k], now)
            if now - self._undone[k] > self._timeout and self._latched[k] is None:
                self._latched[k] = DriveFault(UNCONFIRMED, unconfirmed(wish, reported))
        holds = self._actions[k] in HOLDING and not reported.stale
        self._had_power[k] = reported.power and holds
        return self._latched[k] or self._zeros[k].fault or None

    def _at_shafts(self) -> tuple[Array, Array]:
        """Position and velocity of the motors' shafts; NaN where they are not measured."""
        axes, answers = self._axes, self.answers
        position = axes.shaft * (answers.position + self._shifts)
        velocity = axes.shaft * answers.velocity
        own = ~np.isnan(answers.motor_position)
        position[own], velocity[own] = (axes.sign * answers.motor_position)[own], math.nan
        return position, velocity

    def _notice_clashes(self) -> None:
        """Detect two drives with one id: more answers than questions, which differ."""
        for k, raw in enumerate(self.answers.raw):
            owed = min(LATEST, self._owed[k] + self.answers.asked[k]) - len(raw)
            self._owed[k] = max(0, owed)
            if owed < 0:
                self._clashes[k] += 1.0
            elif 0.0 < self._clashes[k] < CLASHES:
                self._clashes[k] -= FORGIVEN

    def clear_fault(self, joint: int) -> None:
        """Reset the fault of a drive in its next exchange, and those that are judged here."""
        self._clashes[joint] = 0.0
        reported = self.answers.reported[joint]
        self._resets[joint] = reported.fault is not None
        if not (reported.power or reported.lost):
            self._latched[joint], self._undone[joint] = None, math.inf
            self._zeros[joint].due = self._zeros[joint].due or bool(self._zeros[joint].fault)

    def let_go(self) -> None:
        """Disable motors whose ``on_silence`` is free; the others receive nothing more."""
        off = Order(OFF, SetPoint.OFF, ())
        self.driver.exchange({k: off for k, free in enumerate(self._free) if free})

    def close(self) -> None:
        self.driver.close()
        if self.far_end is not None:
            self.far_end.close()


def silent(axis: Axis, age: float) -> str:
    """The fault of a silent drive."""
    if math.isinf(age):
        return f"no answer from id {axis.id}; is it powered, and its id right?"
    return f"no answer from id {axis.id} for {1e3 * age:.0f} ms"


def maker(driver: Callable[[Own], Driver], schema: type[Own], ids: range) -> Make:
    """The ``make`` of a make's module: from joints and options to a plant.

    Args:
        driver: Its class.
        schema: The class of its options.
        ids: That its drives can have.
    """

    def make(names: Sequence[str], arguments: Mapping[str, str]) -> DrivesPlant:
        """The plant of this driver.

        Raises:
            PlantSettingsError: an argument is unknown or invalid.
        """
        options = schema.parse(names, arguments)
        for axis in options.axes:
            if axis.id not in ids:
                raise axis.refused("id", f"{ids[0]} to {ids[-1]} is required")
        return DrivesPlant(options.axes, driver(options))

    return make

# SPDX-License-Identifier: Apache-2.0
"""Calibrators: they determine the zero of a joint (SPEC K).

One small class per type of calibrator; custom types are added with :func:`register`. A calibrator
drives its joint through a :class:`Hand`, which the machine implements: it can hold, drive, set the
offset and move, and nothing else. ``calibrations`` steps it once per control cycle until it
reports that it is done or raises CalibrationError.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import NoReturn, Protocol

from ..config.config import CALIBRATION_TYPES, Calibration, JointConfig

#: Tolerances are written in rad; of a sliding joint this many metres count as one.
METRES_PER_RADIAN = 0.05

#: Tolerance of the start position, rad.
START_TOLERANCE = 0.02

#: Time within this tolerance, s.
START_SETTLING_TIME = 0.05

#: The phase of the way there.
TO_START = "moving to the start position"


class CalibrationError(Exception):
    """A calibration that cannot continue; the text is the reason (K4)."""


class Hand(Protocol):
    """Access of a calibrator to its joint; rad, rad/s, percent, A, s; of a sliding joint m, m/s.

    It holds, drives, sets the offset and moves.
    """

    @property
    def joint(self) -> JointConfig:
        """The joint's configuration: limits, motor, kind."""

    @property
    def reading(self) -> float:
        """The encoder, before any offset."""

    @property
    def position(self) -> float:
        """The joint angle, true once the offset is set."""

    @property
    def travelled(self) -> float:
        """Travel of the motor since power-on."""

    @property
    def current(self) -> float:
        """Measured motor current."""

    def hold(self) -> None:
        """Hold the present position with the stiff position law."""

    def drive(self, output: float) -> None:
        """Drive the motor with a PWM, percent."""

    def set_offset(self, offset: float) -> None:
        """Set the encoder offset: joint angle = ``reading - offset``."""

    def move(self, target: float, speed: float) -> None:
        """Start a minimum-jerk move."""

    def moving(self) -> bool:
        """Whether that move is active."""


@dataclass(slots=True)
class Progress:
    """Progress of a calibration: fraction from 0 to 1, and its phase as text."""

    fraction: float = 0.0
    phase: str = "waiting"


class Calibrator:
    """A calibrator of one joint; ``step`` is true when it is done.

    Attributes: calibration, hand, period (s), progress, scale (what a tolerance in rad is to be
    multiplied with for this joint), unit (``rad`` or ``m``).
    """

    def __init__(self, calibration: Calibration, hand: Hand, period: float) -> None:
        self.calibration, self.hand, self.period = calibration, hand, period
        self.progress = Progress()
        kind = hand.joint.kind
        self.scale, self.unit = kind.choose(1.0, METRES_PER_RADIAN), kind.unit
        self._periods = 0.0
        self._settled = 0

    def step(self, periods: float = 1.0) -> bool:
        """One control cycle (K2).

        Args:
            periods: of control that passed since the last one.

        Raises:
            CalibrationError: the time of the calibration is over (K4).
        """
        self._periods += periods
        if self._periods * self.period > self.calibration.timeout:
            raise CalibrationError(
                f"timed out after {self.calibration.timeout:g} s while {self.progress.phase}"
            )
        return self.advance()

    def advance(self) -> bool:
        """One cycle of the type; returns whether it is done."""
        raise NotImplementedError

    def go_to_start(self, begin: bool) -> bool:
        """Move to the start position and settle there."""
        hand, calibration = self.hand, self.calibration
        if begin:
            hand.hold()
            self._distance = max(abs(calibration.start - hand.position), 1e-9)
            hand.move(calibration.start, calibration.speed)
            self.progress.phase = TO_START
        off = abs(calibration.start - hand.position)
        self.progress.fraction = max(
            self.progress.fraction, 0.5 + 0.5 * (1 - off / self._distance)
        )
        there = off < START_TOLERANCE * self.scale and not hand.moving()
        self._settled = self._settled + 1 if there else 0
        return self._settled * self.period >= START_SETTLING_TIME


#: Travel in stall_time below which a joint is at rest, rad.
STALL_TRAVEL = 0.002

#: The same of the motor, whose travel is estimated from its voltage and current.
MOTOR_STALL_TRAVEL = 0.01

#: How far the joint goes back before it approaches again, rad, and at most of its hard range.
BACK_OFF = 0.1
BACK_OFF_SHARE = 0.25

#: How far apart both places may be, rad, and at most of the way back.
SAME_PLACE = 0.01
SAME_PLACE_SHARE = 0.25

#: Maximum motion of the joint under the push, rad.
PUSH_TRAVEL = 0.005

#: Current that must flow at a stall, as a part of V/R: less for a hot winding and a bridge.
STALL_CURRENT_SHARE = 0.5

#: Time constant of the filter of the current, as a part of stall_time: 1/FILTER.
FILTER = 5.0

#: Duration of the push, as a multiple of stall_time.
PUSH_TIME = 2.0

#: Time in which the press ends and is no longer measured as a load, s: a joint hardly falls in it.
RELEASE_TIME = 0.05

#: Time for the way back after its profile has ended, s.
BACK_OFF_TIME = 1.0


class HardStop(Calibrator):
    """Type 5: meet the stop, back off, meet it again, push; then go to the start position.

    Standstill is not yet a stop: gravity, friction, a tight cable or a weak drive stall a
    joint in mid-air. The place counts when
    - the motor draws the current of a stall there, I = V/R, so the drive is at its torque;
    - the joint moves back from it, which shows that it can move in the other direction;
    - it meets the same place again. Friction would hold it where it backed off to;
    - half as much torque again moves nothing. A load would be lifted further by it;
    - the way there fits between the joint's hard stops.
    Anything else is a CalibrationError that names which of these failed. The remaining error is
    in docs/howto/own_calibrator.md.
    """

    def __init__(self, calibration: Calibration, hand: Hand, period: float) -> None:
        super().__init__(calibration, hand, period)
        limits = hand.joint.limits
        self._way = 1.0 if calibration.output > 0.0 else -1.0
        self._back = min(
            BACK_OFF * self.scale, BACK_OFF_SHARE * (limits.hard_upper - limits.hard_lower)
        )
        self._same = min(SAME_PLACE * self.scale, SAME_PLACE_SHARE * self._back)
        self._filter = min(1.0, FILTER * period / calibration.stall_time)
        self._course = self._run()

    def advance(self) -> bool:
        return next(self._course, None) is None

    def _run(self) -> Generator[str, None, None]:
        """The whole calibration; yields its phase once per control cycle."""
        hand, calibration = self.hand, self.calibration
        self._begin = hand.reading
        first = yield from self._meet("driving to the hard stop", 0.05)
        self._check_way(first)
        yield from self._back_off()
        second = yield from self._meet("approaching the stop again", 0.3)
        self._check_place(first, second)
        yield from self._push(second)
        yield from self._let_go(TO_START, 0.5)
        hand.set_offset(second - calibration.stop)
        arrived = self.go_to_start(True)
        while not arrived:
            yield self.progress.phase
            arrived = self.go_to_start(False)

    def _meet(self, phase: str, fraction: float) -> Generator[str, None, float]:
        """Drive until encoder and motor are at rest; returns the reading there.

        A stall needs both: a frozen encoder alone is no stop.
        """
        hand, calibration = self.hand, self.calibration
        self.progress.phase, self.progress.fraction = phase, fraction
        hand.drive(calibration.output)
        mark, motor, still, current = hand.reading, hand.travelled, 0, 0.0
        while still * self.period < calibration.stall_time:
            yield phase
            still += 1
            current += self._filter * (hand.current - current)
            moved = abs(hand.reading - mark) > STALL_TRAVEL * self.scale
            if moved or abs(hand.travelled - motor) > MOTOR_STALL_TRAVEL * self.scale:
                mark, motor, still = hand.reading, hand.travelled, 0
                self._check_range()
        self._check_current(calibration.output, current)
        return hand.reading

    def _let_go(self, phase: str, fraction: float) -> Generator[str, None, None]:
        """Press no longer: a position law would hold the press as a load."""
        self.progress.phase, self.progress.fraction = phase, fraction
        self.hand.drive(0.0)
        for _ in range(round(RELEASE_TIME / self.period)):
            yield phase

    def _back_off(self) -> Generator[str, None, None]:
        """Move back from the stop: the joint must be able to move in the other direction."""
        hand, phase = self.hand, "backing off the stop"
        place = hand.position
        yield from self._let_go(phase, 0.25)
        hand.hold()
        hand.move(place - self._way * self._back, self.calibration.speed)
        late = 0
        while hand.moving() or self._way * (place - hand.position) < 0.5 * self._back:
            yield phase
            late = 0 if hand.moving() else late + 1
            if late * self.period > BACK_OFF_TIME:
                moved = abs(hand.position - place)
                self._fail(
                    f"met a stop, but moved back by {moved:.4g} {self.unit} instead of "
                    f"{self._back:.4g} {self.unit}: the joint does not move in the other "
                    "direction",
                    "free the joint, or raise its position gains",
                )

    def _push(self, place: float) -> Generator[str, None, None]:
        """Push harder: at a stop nothing moves."""
        hand, calibration, phase = self.hand, self.calibration, "pushing against the stop"
        self.progress.phase, self.progress.fraction = phase, 0.45
        joint = hand.joint
        output = self._way * calibration.push(joint.limits, joint.motor)
        hand.drive(output)
        current, cycles = 0.0, round(PUSH_TIME * calibration.stall_time / self.period)
        for _ in range(cycles):
            yield phase
            current += self._filter * (hand.current - current)
            gave = abs(hand.reading - place)
            if gave > PUSH_TRAVEL * self.scale:
                self._fail(
                    f"stalled at {calibration.output:.3g} %, then moved by {gave:.4g} "
                    f"{self.unit} at {output:.3g} %: held by load or friction, not by a stop",
                    "raise calibration.output",
                )
        self._check_current(output, current)

    def _check_range(self) -> None:
        """Check that the distance to the stop is within the joint's range."""
        limits, way = self.hand.joint.limits, abs(self.hand.reading - self._begin)
        longest = limits.hard_upper - limits.hard_lower + limits.hard_margin
        if way > longest:
            self._fail(
                f"no stop within {way:.4g} {self.unit}, the hard range being "
                f"{limits.hard_upper - limits.hard_lower:.4g} {self.unit}",
                "check limits.hard_lower and hard_upper, the encoder, and the stop itself",
            )

    def _check_way(self, place: float) -> None:
        """Check that the joint moved as driven, and that its range allows the stop."""
        limits, stop = self.hand.joint.limits, self.calibration.stop
        way, margin = place - self._begin, limits.hard_margin
        if way * self._way < -margin:
            self._fail(
                f"moved {abs(way):.4g} {self.unit} against the output of "
                f"{self.calibration.output:.3g} %: the load is stronger",
                "raise calibration.output, or correct its sign",
            )
        began = stop - way
        if not limits.hard_lower - margin <= began <= limits.hard_upper + margin:
            self._fail(
                f"{way:.4g} {self.unit} to the stop at {stop:.4g} {self.unit}: it "
                f"would have started at {began:.4g} {self.unit}, its hard range being "
                f"{limits.hard_lower:.4g} to {limits.hard_upper:.4g} {self.unit}",
                "check calibration.stop and the sign of calibration.output",
            )

    def _check_place(self, first: float, second: float) -> None:
        """Check that the stop was met twice at the same place."""
        apart = second - first
        if abs(apart) > self._same:
            self._fail(
                f"stalled at {first:.4g} {self.unit}, and at {second:.4g} {self.unit} on the "
                f"second approach (up to {self._same:.3g} {self.unit} apart is allowed): "
                "friction, a load or an obstruction, not a stop",
                "raise calibration.output, or clear the path",
            )

    def _check_current(self, output: float, current: float) -> None:
        """Check that the motor draws its stall current."""
        stalled = self.hand.joint.motor.stall_current(output)
        if current / stalled < STALL_CURRENT_SHARE:
            self._fail(
                f"stalled, but the motor draws {current:.3g} A at {output:.3g} %, where a "
                f"stall needs {stalled:.3g} A (at least {STALL_CURRENT_SHARE:.0%} is needed)",
                "check the encoder, the motor, its supply, and motor.resistance",
            )

    def _fail(self, why: str, step: str) -> NoReturn:
        raise CalibrationError(f"{why}; {step}")


class AbsoluteSensor(Calibrator):
    """Type 12: an absolute sensor measures the angle; no motion."""

    def advance(self) -> bool:
        self.hand.set_offset(self.calibration.zero)
        self.progress.phase, self.progress.fraction = "done", 1.0
        return True


class OffsetAndMove(Calibrator):
    """Type 3: an absolute encoder measures the angle, then the joint moves to its start."""

    def advance(self) -> bool:
        begin = self.progress.phase == "waiting"
        if begin:
            self.hand.set_offset(self.calibration.zero)
        return self.go_to_start(begin)


class Unmade(Calibrator):
    """In place of a calibrator that could not be made: its step raises why (K4)."""

    def __init__(self, error: Exception, calibration: Calibration, hand: Hand, period: float):
        super().__init__(calibration, hand, period)
        self._error = error

    def advance(self) -> bool:
        raise self._error


TYPES: dict[int, Callable[[Calibration, Hand, float], Calibrator]] = {
    3: OffsetAndMove,
    5: HardStop,
    12: AbsoluteSensor,
}


def register(number: int, text: str) -> Callable[[type[Calibrator]], type[Calibrator]]:
    """Register a user's calibrator as ``calibration.type`` ``number``; decorates its class.

    Args:
        number: 1 to 12, not used by another type.
        text: name of the type, for messages.

    Raises:
        ValueError: the number is used, or out of range.
    """
    if number in TYPES or not 1 <= number <= 12:
        raise ValueError(f"calibration type {number}: choose a free one of 1 to 12")

    def enter(calibrator: type[Calibrator]) -> type[Calibrator]:
        TYPES[number], CALIBRATION_TYPES[number] = calibrator, text
        return calibrator

    return enter

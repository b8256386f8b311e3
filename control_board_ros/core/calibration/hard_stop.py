# SPDX-License-Identifier: Apache-2.0
"""Calibration type 5: drive to a hard stop of known angle (SPEC K5, K6).

Standstill is not yet a stop: gravity, friction, a tight cable or a weak drive stall a
joint in mid-air. The place counts when
- the motor draws the current of a stall there, I = V/R, so the drive is at its torque;
- the joint comes back from it, which shows that it moves the other way;
- it meets the same place again. Friction would hold it where it backed off to;
- half as much torque again moves nothing. A load would be lifted further by it;
- the way there fits between the joint's hard stops.
Anything else is a CalibrationError that names which of these failed. The remaining error is
in docs/howto/own_calibrator.md.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import NoReturn

from ..config.parts import Calibration
from .calibrator import CalibrationError, Calibrator, Hand

#: Travel in stall_time below which a joint is at rest, rad.
STALLED = 0.002

#: The same of the motor, whose travel is estimated from its voltage and current.
MOTOR_STALLED = 0.01

#: How far the joint goes back before it approaches again, rad, and at most of its hard range.
BACK_OFF = 0.1
BACK_OFF_SHARE = 0.25

#: How far apart both places may be, rad, and at most of the way back.
SAME_PLACE = 0.01
SAME_PLACE_SHARE = 0.25

#: How far the joint may give way under the push, rad.
GAVE_WAY = 0.005

#: Current that must flow at a stall, as a part of V/R: less for a hot winding and a bridge.
AT_TORQUE = 0.5

#: Time constant of the filter of the current, as a part of stall_time: 1/FILTER.
FILTER = 5.0

#: Duration of the push, as a multiple of stall_time.
PUSH_TIME = 2.0

#: Time for the way back after its profile has ended, s.
SETTLING = 1.0


class HardStop(Calibrator):
    """Type 5: meet the stop, back off, meet it again, push; then go to the start position."""

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
        hand.set_offset(second - calibration.stop)
        arrived = self.go_to_start(True)
        while not arrived:
            yield self.progress.phase
            arrived = self.go_to_start(False)

    def _meet(self, phase: str, fraction: float) -> Generator[str, None, float]:
        """Drive until encoder and motor stand still; returns the reading there.

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
            moved = abs(hand.reading - mark) > STALLED * self.scale
            if moved or abs(hand.travelled - motor) > MOTOR_STALLED * self.scale:
                mark, motor, still = hand.reading, hand.travelled, 0
                self._check_range()
        self._check_current(calibration.output, current)
        return hand.reading

    def _back_off(self) -> Generator[str, None, None]:
        """Go back from the stop; the joint must be able to move the other way."""
        hand, phase = self.hand, "backing off the stop"
        self.progress.phase, self.progress.fraction = phase, 0.25
        hand.hold()
        place = hand.position
        hand.move(place - self._way * self._back, self.calibration.speed)
        late = 0
        while hand.moving() or self._way * (place - hand.position) < 0.5 * self._back:
            yield phase
            late = 0 if hand.moving() else late + 1
            if late * self.period > SETTLING:
                moved = abs(hand.position - place)
                self._fail(
                    f"met a stop, but came back by {moved:.4g} {self.unit} instead of "
                    f"{self._back:.4g} {self.unit}: the joint does not move the other way",
                    "free it, or raise its position gains",
                )

    def _push(self, place: float) -> Generator[str, None, None]:
        """Push harder; at a stop nothing moves."""
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
            if gave > GAVE_WAY * self.scale:
                self._fail(
                    f"stood still at {calibration.output:.3g} %, but gave way by {gave:.4g} "
                    f"{self.unit} at {output:.3g} %: held by its load or friction, not by a stop",
                    "raise calibration.output",
                )
        self._check_current(output, current)

    def _check_range(self) -> None:
        """The way to a stop is no longer than the joint's range."""
        limits, way = self.hand.joint.limits, abs(self.hand.reading - self._begin)
        longest = limits.hard_upper - limits.hard_lower + limits.hard_margin
        if way > longest:
            self._fail(
                f"no stop within {way:.4g} {self.unit}, the hard range being "
                f"{limits.hard_upper - limits.hard_lower:.4g} {self.unit}",
                "check limits.hard_lower and hard_upper, the encoder, and the stop itself",
            )

    def _check_way(self, place: float) -> None:
        """The joint moved as driven, and the stop is where its range allows."""
        limits, stop = self.hand.joint.limits, self.calibration.stop
        way, margin = place - self._begin, limits.hard_margin
        if way * self._way < -margin:
            self._fail(
                f"went {abs(way):.4g} {self.unit} against the {self.calibration.output:.3g} % "
                "that drive it: its load is stronger",
                "raise calibration.output, or mend its sign",
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
        """Both times the same place."""
        apart = second - first
        if abs(apart) > self._same:
            self._fail(
                f"stood still at {first:.4g} {self.unit}, and at {second:.4g} {self.unit} when "
                f"it came again (up to {self._same:.3g} {self.unit} apart is allowed): friction, "
                "a load or something in its way, not a stop",
                "raise calibration.output, or clear its way",
            )

    def _check_current(self, output: float, current: float) -> None:
        """The motor draws what it does at a stall."""
        stalled = self.hand.joint.motor.stall_current(output)
        if current / stalled < AT_TORQUE:
            self._fail(
                f"stands still, but its motor draws {current:.3g} A at {output:.3g} %, where a "
                f"stall needs {stalled:.3g} A (at least {AT_TORQUE:.0%} is needed)",
                "check the motor, its supply, and motor.resistance",
            )

    def _fail(self, why: str, step: str) -> NoReturn:
        raise CalibrationError(f"{why}; {step}")

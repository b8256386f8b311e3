# SPDX-License-Identifier: Apache-2.0
"""Calibrators: how a joint finds its zero (SPEC K), one small class per type.

A calibrator drives its joint through a :class:`Hand`, which the board implements: it can hold,
drive, set the offset and move, and nothing else. It is stepped once per control cycle until it
says DONE or raises CalibrationError.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from .parts import CALIBRATION_TYPES, Calibration

#: How close to the start position a joint must come, rad.
ARRIVED = 0.02

#: Travel in stall_time below which a joint stands at its stop, rad.
STALLED = 0.002


class CalibrationError(Exception):
    """A calibration that cannot go on; the text says why (K4)."""


class Hand(Protocol):
    """What a calibrator may do with its joint and see of it; rad, rad/s, percent, s."""

    @property
    def reading(self) -> float:
        """The encoder, before any offset."""

    @property
    def position(self) -> float:
        """The joint angle, true once the offset is set."""

    @property
    def travelled(self) -> float:
        """Travel of the motor since power-on."""

    def hold(self) -> None:
        """Hold the present position with the stiff position law."""

    def drive(self, output: float) -> None:
        """Give the motor a PWM."""

    def set_offset(self, offset: float) -> None:
        """Take ``reading - offset`` as the joint angle from now on."""

    def move(self, target: float, speed: float) -> None:
        """Start a minimum-jerk move."""

    def moving(self) -> bool:
        """Whether that move is on its way."""


@dataclass(slots=True)
class Progress:
    """How far a calibration is: 0 to 1, and a phase in words."""

    fraction: float = 0.0
    phase: str = "waiting"


class Calibrator:
    """A calibrator of one joint; ``step`` is true when it is done."""

    def __init__(self, calibration: Calibration, hand: Hand, period: float) -> None:
        self.calibration, self.hand, self.period = calibration, hand, period
        self.progress = Progress()
        self._cycles = 0
        self._settled = 0

    def step(self) -> bool:
        """One control cycle (K2).

        Raises:
            CalibrationError: the time of the calibration is over (K4).
        """
        self._cycles += 1
        if self._cycles * self.period > self.calibration.timeout:
            raise CalibrationError(
                f"timed out after {self.calibration.timeout:g} s while {self.progress.phase}"
            )
        return self.advance()

    def advance(self) -> bool:
        """What the type does in one cycle."""
        raise NotImplementedError

    def go_to_start(self, begin: bool) -> bool:
        """Move to the start position and settle there."""
        hand, calibration = self.hand, self.calibration
        if begin:
            hand.hold()
            self._distance = max(abs(calibration.start - hand.position), 1e-9)
            hand.move(calibration.start, calibration.speed)
            self.progress.phase = "moving to the start position"
        off = abs(calibration.start - hand.position)
        self.progress.fraction = max(
            self.progress.fraction, 0.5 + 0.5 * (1 - off / self._distance)
        )
        self._settled = self._settled + 1 if off < ARRIVED and not hand.moving() else 0
        return self._settled * self.period >= 0.05


class AbsoluteSensor(Calibrator):
    """Type 12: the absolute sensor gives the angle at once."""

    def advance(self) -> bool:
        self.hand.set_offset(self.calibration.zero)
        self.progress.phase, self.progress.fraction = "done", 1.0
        return True


class OffsetAndMove(Calibrator):
    """Type 3: an absolute encoder gives the angle, then the joint goes to its start."""

    def advance(self) -> bool:
        begin = self.progress.phase == "waiting"
        if begin:
            self.hand.set_offset(self.calibration.zero)
        return self.go_to_start(begin)


class HardStop(Calibrator):
    """Type 5: drive until the joint stalls, take that as the stop's angle, go to the start.

    A stall needs both the encoder and the motor's own speed to stand still: a frozen encoder
    alone is no stop.
    """

    def advance(self) -> bool:
        hand, calibration = self.hand, self.calibration
        if self.progress.phase == "waiting":
            self.progress.phase, self.progress.fraction = "driving to the hard stop", 0.05
            hand.drive(calibration.output)
            self._mark, self._motor, self._still = hand.reading, hand.travelled, 0
        if self.progress.phase != "driving to the hard stop":
            return self.go_to_start(False)
        self._still += 1
        motor = abs(hand.travelled - self._motor)
        if abs(hand.reading - self._mark) > STALLED or motor > 5.0 * STALLED:
            self._mark, self._motor, self._still = hand.reading, hand.travelled, 0
            self.progress.fraction = min(0.45, self.progress.fraction + 0.002)
        if self._still * self.period >= calibration.stall_time:
            hand.set_offset(hand.reading - calibration.stop)
            self.go_to_start(True)
        return False


TYPES: dict[int, Callable[[Calibration, Hand, float], Calibrator]] = {
    3: OffsetAndMove,
    5: HardStop,
    12: AbsoluteSensor,
}


def register(number: int, text: str) -> Callable[[type[Calibrator]], type[Calibrator]]:
    """Offer a calibrator of one's own as ``calibration.type`` ``number``; decorates its class.

    Args:
        number: 1 to 12, not taken by another type.
        text: what it is, for messages.

    Raises:
        ValueError: the number is taken, or out of range.
    """
    if number in TYPES or not 1 <= number <= 12:
        raise ValueError(f"calibration type {number}: choose a free one of 1 to 12")

    def enter(calibrator: type[Calibrator]) -> type[Calibrator]:
        TYPES[number], CALIBRATION_TYPES[number] = calibrator, text
        return calibrator

    return enter


@dataclass(frozen=True, slots=True)
class CalibrationStatus:
    """How the last calibration of a joint stands.

    Attributes: name, running, done (the last one succeeded), progress (0 to 1), phase,
    message (why it failed; empty otherwise), calibrated (the joint knows its angle, be it from
    an earlier one, or because it requires none).
    """

    name: str
    running: bool = False
    done: bool = False
    progress: float = 0.0
    phase: str = "none"
    message: str = ""
    calibrated: bool = False

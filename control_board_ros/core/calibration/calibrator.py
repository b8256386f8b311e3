# SPDX-License-Identifier: Apache-2.0
"""What all calibrators share: the hand that they move their joint with, the move at the end.

A calibrator drives its joint through a :class:`Hand`, which the board implements: it can hold,
drive, set the offset and move, and nothing else. It is stepped once per control cycle until it
reports that it is done or raises CalibrationError.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ..config.config import JointConfig
from ..config.parts import Calibration

#: Tolerances are written in rad; of a sliding joint this many metres count as one.
METRES_PER_RADIAN = 0.05

#: How close to the start position a joint must come, rad.
ARRIVED = 0.02

#: Time for which it must be there, s.
SETTLED = 0.05


class CalibrationError(Exception):
    """A calibration that cannot continue; the text is the reason (K4)."""


class Hand(Protocol):
    """What a calibrator may do with its joint and see of it; rad, rad/s, percent, A, s.

    Of a sliding joint m and m/s.
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
    """A calibrator of one joint; ``step`` is true when it is done.

    Attributes: calibration, hand, period (s), progress, scale (what a tolerance in rad is to be
    multiplied with for this joint), unit (``rad`` or ``m``).
    """

    def __init__(self, calibration: Calibration, hand: Hand, period: float) -> None:
        self.calibration, self.hand, self.period = calibration, hand, period
        self.progress = Progress()
        kind = hand.joint.kind
        self.scale, self.unit = kind.choose(1.0, METRES_PER_RADIAN), kind.unit
        self._cycles = 0
        self._settled = 0

    @property
    def begun(self) -> bool:
        """Whether it has been stepped: the joint is in its hands."""
        return self._cycles > 0

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
        there = off < ARRIVED * self.scale and not hand.moving()
        self._settled = self._settled + 1 if there else 0
        return self._settled * self.period >= SETTLED

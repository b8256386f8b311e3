# SPDX-License-Identifier: Apache-2.0
"""Calibrators: how a joint finds its zero (SPEC K), one small class per type.

Types 3 and 12 are here, type 5 in hard_stop.py, what they share in calibrator.py. A type of
one's own is entered with :func:`register`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..config.parts import CALIBRATION_TYPES, Calibration
from .calibrator import CalibrationError, Calibrator, Hand, Progress
from .hard_stop import HardStop

__all__ = [
    "TYPES",
    "AbsoluteSensor",
    "CalibrationError",
    "CalibrationStatus",
    "Calibrator",
    "Hand",
    "HardStop",
    "OffsetAndMove",
    "Progress",
    "register",
]


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


TYPES: dict[int, Callable[[Calibration, Hand, float], Calibrator]] = {
    3: OffsetAndMove,
    5: HardStop,
    12: AbsoluteSensor,
}


def register(number: int, text: str) -> Callable[[type[Calibrator]], type[Calibrator]]:
    """Offer a calibrator of one's own as ``calibration.type`` ``number``; decorates its class.

    Args:
        number: 1 to 12, not used by another type.
        text: what it is, for messages.

    Raises:
        ValueError: the number is used, or out of range.
    """
    if number in TYPES or not 1 <= number <= 12:
        raise ValueError(f"calibration type {number}: choose a free one of 1 to 12")

    def enter(calibrator: type[Calibrator]) -> type[Calibrator]:
        TYPES[number], CALIBRATION_TYPES[number] = calibrator, text
        return calibrator

    return enter


@dataclass(frozen=True, slots=True)
class CalibrationStatus:
    """Status of the last calibration of a joint.

    Attributes: name, running, done (the last one succeeded), progress (0 to 1), phase,
    message (why it failed; empty otherwise), calibrated (whether the joint has a valid angle, be
    it from an earlier one or because it requires none; None if unknown).
    """

    name: str
    running: bool = False
    done: bool = False
    progress: float = 0.0
    phase: str = "none"
    message: str = ""
    calibrated: bool | None = None

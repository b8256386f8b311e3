# SPDX-License-Identifier: Apache-2.0
"""Kinds of set-points of drives, and their use for the laws (SPEC S1, S5); no numpy."""

from __future__ import annotations

from enum import IntEnum, StrEnum
from typing import NamedTuple


class SetPoint(IntEnum):
    """The kinds of set-point; OFF disables the motor."""

    OFF = 0
    PWM = 1
    CURRENT = 2
    TORQUE = 3
    VELOCITY = 4
    POSITION = 5
    IMPEDANCE = 6

    @property
    def code(self) -> str:
        """As users write it: ``position``."""
        return self.name.lower()


#: The set-points that a drive can accept.
KINDS = tuple(kind for kind in SetPoint if kind is not SetPoint.OFF)


#: Kinds whose drive closes the loop of a position, or the damping in it, itself.
CLOSE_POSITION = (SetPoint.POSITION, SetPoint.IMPEDANCE, SetPoint.VELOCITY)


class OnSilence(StrEnum):
    """Reaction of a motor to missing commands (S5)."""

    FREE = "free"  # no power
    DAMPED = "damped"  # its terminals shorted, or a velocity of 0 against damping
    BRAKED = "braked"  # held, by a brake or by the drive


class DriveReport(NamedTuple):
    """What a drive reports of itself, and what was lost on its bus; None: that is not reported.

    Attributes:
        zero: How its zero survives a restart: "absolute", "one turn", "0.1 turns", "lost".
        power: Its motor has power.
        law: Its mode of operation, by its maker's number and name.
        lost: Questions for its readings that were not answered, since ``connect``; one that is
            answered later than in its exchange counts until then.
        late: Answers that came later than in their exchange, since ``connect``.
    """

    zero: str | None = None
    power: bool | None = None
    law: str | None = None
    lost: int | None = None
    late: int | None = None

    def __str__(self) -> str:
        power = None if self.power is None else f"power {'on' if self.power else 'off'}"
        law, zero = self.law and f"mode {self.law}", self.zero and f"zero {self.zero}"
        counts = [f"{count} {name}" for name, count in
                  (("lost", self.lost), ("late", self.late)) if count]  # fmt: skip
        return ", ".join(filter(None, (power, law, zero, *counts)))


class DriveUse(NamedTuple):
    """The set-points of a joint's laws (S1), as codes; None where the drive has none for a law.

    Attributes:
        set_points: Those that its drive accepts.
        position, impedance, torque, current, output: The set-point of each law.
        on_silence: Reaction of the motor to missing commands (S5).
        reported: What the drive says of itself.
    """

    set_points: tuple[str, ...]
    position: str | None
    impedance: str | None
    torque: str | None
    current: str | None
    output: str | None
    on_silence: str
    reported: DriveReport = DriveReport()

    @property
    def loops(self) -> str:
        """Each set-point with the laws that it carries, in one line: ``pwm: all``."""
        carried: dict[str, list[str]] = {}
        for law in LAW_FIELDS:
            if (code := getattr(self, law)) is not None:
                carried.setdefault(code, []).append(law)
        return "; ".join(f"{code}: {' '.join(laws)}" for code, laws in carried.items())


#: The laws that have a set-point, as fields of a DriveUse.
LAW_FIELDS = DriveUse._fields[1:-2]

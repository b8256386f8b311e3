# SPDX-License-Identifier: Apache-2.0
"""The kind of a joint: its units, and the texts of its values."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import TypeVar

T = TypeVar("T")

#: Values from here on have no decimal places: 300 digits are no text.
HUGE = 1e9

#: Ranges above this are those of joints without limits, rad or m.
ENDLESS = 1e5


class JointKind(StrEnum):
    """A joint turns (rad, rad/s, N·m) or slides (m, m/s, N); values are URDF's words.

    Texts for people are in degrees and mm, with the same resolution everywhere: 0.1°, 0.1 mm and
    0.01 N·m (N); a value that is not finite is ``-``.
    """

    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"

    @classmethod
    def of(cls, described: str | None) -> JointKind:
        """The kind of a description; REVOLUTE where it is unknown or missing."""
        return cls(described) if described in set(cls) else cls.REVOLUTE

    @property
    def slides(self) -> bool:
        return self is JointKind.PRISMATIC

    def choose(self, turning: T, sliding: T) -> T:
        """The constant of this kind: ``turning`` in rad or N·m, ``sliding`` in m or N."""
        return sliding if self.slides else turning

    @property
    def unit(self) -> str:
        """Of positions: rad or m."""
        return self.choose("rad", "m")

    @property
    def force_unit(self) -> str:
        """N·m or N."""
        return self.choose("N·m", "N")

    @property
    def shown_unit(self) -> str:
        """Of positions for people: ° or mm."""
        return self.choose("°", "mm")

    @property
    def shown_factor(self) -> float:
        """From rad or m to ``shown_unit``."""
        return self.choose(math.degrees(1.0), 1000.0)

    @property
    def resolution(self) -> float:
        """The last digit of a position for people, rad or m."""
        return 0.1 / self.shown_factor

    def position(self, value: float, per: str = "") -> str:
        """``12.3°`` or ``40.0 mm``; with ``per`` a rate: ``12.3°/s``."""
        if not math.isfinite(value):
            return "-"
        gap = self.choose("", " ")
        return f"{decimal(value * self.shown_factor, 1)}{gap}{self.shown_unit}{per}"

    def velocity(self, value: float) -> str:
        """``12.3°/s`` or ``40.0 mm/s``."""
        return self.position(value, "/s")

    def acceleration(self, value: float) -> str:
        """``12.3°/s²`` or ``40.0 mm/s²``."""
        return self.position(value, "/s²")

    def travel(self, lower: float, upper: float) -> str:
        """``-168.0…168.0°``, ``0.0…40.0 mm`` or ``endless``."""
        if not upper - lower < ENDLESS:
            return "endless"
        return f"{lower * self.shown_factor:z.1f}…{self.position(upper)}"

    def force(self, value: float) -> str:
        """A torque, or the force of a sliding joint: ``1.50 N·m`` or ``1.50 N``."""
        return f"{decimal(value, 2)} {self.force_unit}" if math.isfinite(value) else "-"


def decimal(value: float, places: int) -> str:
    """A value with decimal places; one of HUGE and more by its power of ten: ``1e+300``."""
    return f"{value:z.{places}f}" if abs(value) < HUGE else f"{value:.3g}"

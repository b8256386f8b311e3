# SPDX-License-Identifier: Apache-2.0
"""What all benchmarks share: figures, goals, the effort spent, and small statistics."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Literal, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Effort:
    """How much to measure: ``full`` to record, ``quick`` to look, ``tiny`` to try the scripts."""

    level: Literal["full", "quick", "tiny"] = "full"

    def of(self, full: T, quick: T, tiny: T) -> T:
        """The amount for this level."""
        return {"full": full, "quick": quick, "tiny": tiny}[self.level]


@dataclass(frozen=True, slots=True)
class Goal:
    """What a figure is to reach: ``at most`` or ``at least`` a bound."""

    sense: Literal["≤", "≥", "="]
    bound: float

    def met(self, value: float) -> bool:
        """Whether a value reaches the goal; what is not a number does not."""
        if self.sense == "≤":
            return value <= self.bound
        if self.sense == "≥":
            return value >= self.bound
        return value == self.bound


def time_until(over: Callable[[], bool]) -> Callable[[], float]:
    """A clock, s, for a virtual world: no time passes while something is so."""
    return lambda: -math.inf if over() else time.monotonic()


def at_most(bound: float) -> Goal:
    """The figure must not be greater."""
    return Goal("≤", bound)


def at_least(bound: float) -> Goal:
    """The figure must not be smaller."""
    return Goal("≥", bound)


def exactly(bound: float) -> Goal:
    """The figure must be this one."""
    return Goal("=", bound)


@dataclass(frozen=True, slots=True)
class Figure:
    """One measured figure.

    Attributes: number (``B1``), case (what was measured), value with its unit, goal (None where
    the figure is only stated), reference (what the bare reference of the same run gave, in
    words), details (raw numbers, for the record), digits (significant ones to show).
    """

    number: str
    case: str
    value: float
    unit: str
    goal: Goal | None = None
    reference: str = "–"
    details: dict[str, float] = field(default_factory=dict)
    digits: int = 3

    @property
    def met(self) -> bool | None:
        """Whether the goal is reached; None where there is none."""
        return None if self.goal is None else self.goal.met(self.value)

    @property
    def text(self) -> str:
        """The value for people; what has no unit is a count."""
        if not self.unit:
            return f"{self.value:g}"
        return f"{number(self.value, self.digits)} {self.unit}"

    @property
    def goal_text(self) -> str:
        """The goal for people."""
        if self.goal is None:
            return "stated"
        sense = "" if self.goal.sense == "=" else f"{self.goal.sense} "
        return f"{sense}{self.goal.bound:g} {self.unit}".strip()


def number(value: float, digits: int = 3) -> str:
    """A number with ``digits`` significant digits, never in exponents."""
    if not math.isfinite(value):
        return str(value)
    if value == 0.0:
        return "0"
    whole = len(str(int(abs(value)))) if abs(value) >= 1.0 else 1
    if 0.0 < abs(value) < 1.0:
        whole = 1 + math.floor(math.log10(abs(value)))
    return f"{value:.{max(0, digits - whole)}f}"


def percentile(values: Sequence[float], percent: float) -> float:
    """The value below which ``percent`` % of the values lie; nearest rank.

    Raises:
        ValueError: there are no values.
    """
    if not values:
        raise ValueError("nothing was measured")
    ordered = sorted(values)
    rank = math.ceil(percent / 100.0 * len(ordered))
    return ordered[min(max(rank, 1), len(ordered)) - 1]


def medians(runs: Sequence[dict[str, float]]) -> dict[str, float]:
    """The median of each quantity over several runs."""
    return {key: median(run[key] for run in runs) for key in runs[0]}

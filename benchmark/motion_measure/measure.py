# SPDX-License-Identifier: Apache-2.0
"""Run rows on a rig: every joint in every pose, and the worst of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from .position_rows import Figures
from .rig import Array, Failure, RefusedError, Rig
from .rows import ROWS, Quantity, Row

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Finding:
    """One figure of one joint: robot, row and quantity (keys), joint, pose, value."""

    robot: str
    row: str
    quantity: str
    joint: str
    pose: str
    value: float


@dataclass(frozen=True, slots=True)
class Line:
    """A line of a robot's table.

    Attributes: row, quantity, worst (None where no joint has it), reach, failures (faults and
    refusals that the row met).
    """

    row: Row
    quantity: Quantity
    worst: Finding | None
    reach: float
    failures: int

    @property
    def key(self) -> str:
        """Row and quantity, as in files."""
        return f"{self.row.key}.{self.quantity.key}"

    @property
    def reached(self) -> bool | None:
        """Whether the worst is good enough, and nothing failed; None without a goal."""
        if self.failures:
            return False
        if self.worst is None or self.reach == 0.0:
            return None
        return abs(self.worst.value) <= self.reach


def measure(
    rig: Rig, poses: dict[str, Array], rows: Iterable[str], joints: Sequence[int] | None = None
) -> Iterator[Finding]:
    """Measure rows in poses, the first of which is where rows of one pose are measured.

    A refusal or a fault is kept in ``rig.failures`` and costs the figures of that test.
    """
    chosen = list(range(rig.board.count) if joints is None else joints)
    for number, (pose, positions) in enumerate(poses.items()):
        rig.take(positions)
        for row in (ROWS[key] for key in rows):
            if row.pose is not None and number != min(row.pose, len(poses) - 1):
                continue
            for j, figures in _figures(rig, row, chosen, pose):
                name = rig.board.names[j]
                for quantity, value in figures.items():
                    yield Finding(rig.name, row.key, quantity, name, pose, float(value))


def _figures(
    rig: Rig, row: Row, joints: Sequence[int], pose: str
) -> Iterator[tuple[int, Figures]]:
    together, one = row.together, row.measure
    if together is not None:
        found = _try(rig, row.key, f"all, {pose}", partial(together, rig, joints))
        yield from (found or {}).items()
    if one is not None:
        for j in joints:
            where = f"{rig.board.names[j]}, {pose}"
            yield j, _try(rig, row.key, where, partial(one, rig, j)) or {}


def _try(rig: Rig, row: str, where: str, test: Callable[[], T]) -> T | None:
    """What a test gives; None, with the reason in ``rig.failures``, where it could not end."""
    try:
        found = test()
    except RefusedError as error:
        if not rig.note_faults(row, where):
            rig.failures.append(Failure(row, where, str(error)))
        found = None
    else:
        if rig.note_faults(row, where):
            found = None
    for j in range(rig.board.count):
        rig.simulation.plant.push(j, 0.0)
    return found


def worst(
    findings: Sequence[Finding], failures: Sequence[Failure], derived: bool, rows: Iterable[str]
) -> list[Line]:
    """The table of one robot."""
    lines = []
    for row in (ROWS[key] for key in rows):
        failed = sum(failure.row == row.key for failure in failures)
        for quantity in row.quantities:
            mine = [f for f in findings if (f.row, f.quantity) == (row.key, quantity.key)]
            found = max(mine, key=lambda f: abs(f.value), default=None)
            lines.append(Line(row, quantity, found, quantity.reach(derived), failed))
    return lines

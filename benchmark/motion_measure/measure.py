# SPDX-License-Identifier: Apache-2.0
"""Run rows on a rig: every joint in every pose, and the worst of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from .rig import Array, RefusedError, Rig
from .rows import ROWS, Quantity, Row


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
    """A line of a robot's table: the worst of a quantity, None where no joint has it."""

    row: Row
    quantity: Quantity
    worst: Finding | None
    reach: float

    @property
    def reached(self) -> bool | None:
        if self.worst is None or self.reach == 0.0:
            return None
        return abs(self.worst.value) <= self.reach


def measure(
    rig: Rig, poses: dict[str, Array], rows: Iterable[str], joints: Sequence[int] | None = None
) -> Iterator[Finding]:
    """Measure rows in poses, the first of which is where rows of one pose are measured.

    A refusal or a fault is kept in ``rig.failures`` and costs the figures of that test.
    """
    chosen = range(rig.board.count) if joints is None else joints
    for number, (pose, positions) in enumerate(poses.items()):
        for row in (ROWS[key] for key in rows):
            if number and not row.every_pose:
                continue
            for j in chosen:
                name = rig.board.names[j]
                for quantity, value in _try(rig, row, j, pose, positions).items():
                    yield Finding(rig.name, row.key, quantity, name, pose, float(value))


def _try(rig: Rig, row: Row, j: int, pose: str, positions: Array) -> dict[str, float]:
    where = f"{row.key} of {rig.board.names[j]} in {pose}"
    try:
        rig.go(positions)
        found = row.measure(rig, j)
    except RefusedError as error:
        if not rig.note_faults(where):
            rig.failures.append(f"{where}: {error}")
        found = {}
    else:
        if rig.note_faults(where):
            found = {}
    rig.simulation.plant.push(j, 0.0)
    return found


def worst(findings: Sequence[Finding], derived: bool, rows: Iterable[str]) -> list[Line]:
    """The table of one robot."""
    lines = []
    for row in (ROWS[key] for key in rows):
        for quantity in row.quantities:
            mine = [f for f in findings if (f.row, f.quantity) == (row.key, quantity.key)]
            found = max(mine, key=lambda f: abs(f.value), default=None)
            lines.append(Line(row, quantity, found, quantity.reach(derived)))
    return lines


def record(findings: Sequence[Finding], failures: Sequence[str]) -> dict[str, Any]:
    """What is kept in a file."""
    return {"findings": [asdict(f) for f in findings], "failures": list(failures)}

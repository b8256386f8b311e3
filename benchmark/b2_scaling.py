# SPDX-License-Identifier: Apache-2.0
"""B2: the control cycle of longer and longer chains against bare cycles of the same chains."""

from __future__ import annotations

from itertools import cycle, islice
from pathlib import Path
from tempfile import TemporaryDirectory

from chains import chain
from common import Effort, Figure, at_most, medians, number
from cycles import MIXED, compare

from control_board_ros.settings import loading as settings

# pybullet 3.2.7 cannot read the joints of a body that has more than 127 of them.
LENGTHS = (7, 32, 127)
CASES = {"all in POSITION": None, "mixed modes, half compliant": MIXED}


def run(effort: Effort) -> list[Figure]:
    """Measure chains of 7, 32 and 127 joints, in POSITION and in mixed modes."""
    chunks, runs = effort.of(15, 6, 1), effort.of(7, 1, 1)
    figures = []
    for case, pattern in CASES.items():
        before = float("inf")
        for length in effort.of(LENGTHS, LENGTHS, LENGTHS[:2]):
            modes = None if pattern is None else list(islice(cycle(pattern), length))
            with TemporaryDirectory() as folder:
                path = Path(folder, "chain.urdf")
                path.write_text(chain(length), encoding="utf-8")
                robot = settings.load(None, {"robot": str(path)})
            found = medians(compare(robot, modes, chunks=chunks, runs=runs))
            # The ratio is to fall from length to length, to 1.08 at the longest.
            goal = 1.08 if length == LENGTHS[-1] else before
            before = found["ratio"]
            figures.append(
                Figure(
                    "B2",
                    f"control cycle, chain of {length} joints, {case}",
                    found["ratio"],
                    "×",
                    at_most(float(number(goal))) if goal < float("inf") else None,
                    f"{number(found['board'])} µs against {number(found['bare'])} µs",
                    found,
                )
            )
    return figures

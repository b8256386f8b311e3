# SPDX-License-Identifier: Apache-2.0
"""B11: several boards of 7 joints at 1 kHz on this machine, in one process and in one each."""

from __future__ import annotations

from contextlib import ExitStack

from bare import PERIOD
from common import Effort, Figure, Goal, at_most, number, percentile
from processes import board, cpu_share, helper
from tap import Fared, Tap, tap

from control_board_ros.testing import free_domain

MUST_KEEP_UP = 4  # boards
#: Overruns of the boards may be so many times those of as many bare loops.
ALLOWED = 3.0


def run(effort: Effort) -> list[Figure]:
    """Measure 1, 4 and 10 boards in both arrangements."""
    figures = []
    for boards in effort.of((1, 4, 10), (4,), (1,)):
        missed = _bare(boards, effort.of(10.0, 1.0, 0.2))
        for arrangement in ("one process", "one process each"):
            with ExitStack() as stack:
                tapped, domain = stack.enter_context(tap()), stack.enter_context(free_domain())
                if arrangement == "one process":
                    together = helper(domain, "many_boards", boards, **tapped.environment)
                    pids = [stack.enter_context(together).process.pid]
                else:
                    pids = _start_each(stack, domain, tapped, boards)
                if effort.level == "full":
                    tapped.window(2.0, boards)  # until all have met
                fared = tapped.window(effort.of(10.0, 2.0, 0.0), boards)
                share = cpu_share(pids, effort.of(4.0, 0.5, 0.1))
            figures.append(_figure(boards, arrangement, fared, share, missed))
    return figures


def _bare(loops: int, seconds: float) -> int:
    """Cycles that start more than a period late, of so many bare loops at once."""
    with ExitStack() as stack:
        domain = stack.enter_context(free_domain())
        running = [
            stack.enter_context(helper(domain, "bare", "loop", seconds)) for _ in range(loops)
        ]
        found = [one.result()["lateness"] for one in running]
    return sum(late > PERIOD for lateness in found for late in lateness)


def _start_each(stack: ExitStack, domain: int, tapped: Tap, boards: int) -> list[int]:
    started = [
        stack.enter_context(board(domain, tap=tapped, namespace=f"arm_{k}")) for k in range(boards)
    ]
    return [one.process.pid for one in started]


def _figure(
    boards: int, arrangement: str, fared: list[Fared], share: float, missed: int
) -> Figure:
    overruns = sum(one.overruns for one in fared)
    late = 1e3 * percentile([late for one in fared for late in one.lateness], 99)
    cycles = sum(len(one.lateness) for one in fared)
    goal: Goal | None = at_most(ALLOWED * missed) if boards <= MUST_KEEP_UP else None
    return Figure(
        "B11",
        f"overruns of {boards} board{'s' * (boards > 1)} at 1 kHz, {arrangement}",
        float(overruns),
        "",
        goal,
        f"of {cycles} cycles; slowest {min(one.rate for one in fared):.1f} Hz, "
        f"lateness p99 {number(late)} ms, {share:.0f} % of one core; "
        f"as many bare loops: {missed} cycles a period late",
        {"p99": late, "cycles": float(cycles), "cpu": share, "bare": float(missed)},
    )

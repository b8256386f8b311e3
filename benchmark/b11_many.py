# SPDX-License-Identifier: Apache-2.0
"""B11: several boards of 7 joints at 1 kHz on this machine.

In one process and in a process each, every one with a loop and an arm of its own; and as the
parts of one robot, with one loop, in one world.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

from bare import PERIOD
from common import Effort, Figure, Goal, at_least, at_most, number, percentile
from many_arms import NAME, many_arms
from processes import board, cpu_share, helper
from tap import Fared, Tap, tap

from control_board_ros.testing import free_domain

MUST_KEEP_UP = 4  # boards
MANY = 10
FULL_RATE = 999.5  # Hz, of a loop that skips nothing: the window is cut at whole seconds
#: Overruns of the boards over those of as many bare loops, at most.
ALLOWED = 3.0


def run(effort: Effort) -> list[Figure]:
    """Measure 1, 4 and 10 boards in each arrangement."""
    figures = []
    for boards in effort.of((1, 4, MANY), (4,), (1,)):
        missed = _bare(boards, effort.of(10.0, 1.0, 0.2))
        for arrangement, start in ARRANGEMENTS.items():
            with ExitStack() as stack:
                tapped, domain = stack.enter_context(tap()), stack.enter_context(free_domain())
                pids = start(stack, domain, tapped, boards)
                loops = 1 if start is _start_robot else boards
                if effort.level == "full":
                    tapped.window(2.0, loops)  # until all have met
                fared = tapped.window(effort.of(10.0, 2.0, 0.0), loops)
                share = cpu_share(pids, effort.of(4.0, 0.5, 0.1))
            figures.append(_figure(boards, arrangement, fared, share, missed))
            if boards == MANY:
                figures.append(_rate(boards, arrangement, fared))
    return figures


def _bare(loops: int, seconds: float) -> int:
    """Cycles that start more than a period late, of ``loops`` bare loops at once."""
    with ExitStack() as stack:
        domain = stack.enter_context(free_domain())
        running = [
            stack.enter_context(helper(domain, "bare", "loop", seconds)) for _ in range(loops)
        ]
        found = [one.result()["lateness"] for one in running]
    return sum(late > PERIOD for lateness in found for late in lateness)


def _start_together(stack: ExitStack, domain: int, tapped: Tap, boards: int) -> list[int]:
    together = helper(domain, "many_boards", boards, **tapped.environment)
    return [stack.enter_context(together).process.pid]


def _start_each(stack: ExitStack, domain: int, tapped: Tap, boards: int) -> list[int]:
    started = [
        stack.enter_context(board(domain, tap=tapped, namespace=f"arm_{k}")) for k in range(boards)
    ]
    return [one.process.pid for one in started]


def _start_robot(stack: ExitStack, domain: int, tapped: Tap, boards: int) -> list[int]:
    folder = Path(stack.enter_context(TemporaryDirectory()))
    config = many_arms(boards, folder)
    running = stack.enter_context(board(domain, tap=tapped, config=config, robot=NAME))
    return [running.process.pid]


ARRANGEMENTS = {
    "one process": _start_together,
    "one process each": _start_each,
    "one robot of as many parts": _start_robot,
}


def _rate(boards: int, arrangement: str, fared: list[Fared]) -> Figure:
    slowest = min(one.rate for one in fared)
    goal = None if arrangement == "one process each" else at_least(FULL_RATE)
    return Figure("B11", f"slowest rate of {boards} boards, {arrangement}", slowest, "Hz", goal)


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

# SPDX-License-Identifier: Apache-2.0
"""B12: mode requests and references with the garbage collector running and switched off.

The same calls go to two boards in turns, one of which collects no garbage; the node under test
records the duration of each collection (tap.py).
"""

from __future__ import annotations

from contextlib import ExitStack
from itertools import cycle
from statistics import median
from time import perf_counter

from common import Effort, Figure, at_most, medians, number, percentile
from control_board_msgs.srv import SetControlMode
from processes import BOARD, board
from talking import SetPoints, Talker, switch, talker
from tap import COLLECTOR, Tap, tap

from control_board_ros.testing import free_domain


def run(effort: Effort) -> list[Figure]:
    """Measure requests and references, and the longest collection."""
    calls, runs = effort.of(500, 200, 20), effort.of(5, 3, 1)
    with ExitStack() as stack:
        boards = {
            case: (tapped := stack.enter_context(tap()), _board(stack, tapped, case))
            for case in ("running", "off")
        }
        for _, talking in boards.values():
            switch(talking, "posd")
        points = {case: SetPoints(talking) for case, (_, talking) in boards.items()}
        started = len(boards["running"][0].pauses())
        found = medians([_measure(boards, points, calls) for _ in range(runs)])
        pauses = boards["running"][0].pauses()[started:]
    longest = 1e3 * max(pauses, default=0.0)
    return [
        Figure(
            "B12",
            "longest pause by a garbage collection",
            longest,
            "ms",
            at_most(1.0),
            f"{len(pauses)} collections in {calls * runs} requests and references; "
            f"median {number(1e3 * median(pauses or [0.0]))} ms",
            {"collections": float(len(pauses)), "longest": longest},
        ),
        *(
            Figure(
                "B12",
                f"{what}, p99, collector running over off",
                found[f"{what} running"] / found[f"{what} off"],
                "×",
                None,
                f"{number(found[f'{what} running'])} ms against {number(found[f'{what} off'])} ms",
                found,
            )
            for what in ("mode request", "reference to state")
        ),
    ]


def _board(stack: ExitStack, tapped: Tap, case: str) -> Talker:
    """A board with the collector as the case says, and who talks to it."""
    domain = stack.enter_context(free_domain())
    tapped.environment[COLLECTOR] = "off" if case == "off" else "on"
    stack.enter_context(board(domain, {"state_rate": 1000.0}, tap=tapped))
    talking: Talker = stack.enter_context(talker(domain))
    return talking


def _measure(
    boards: dict[str, tuple[Tap, Talker]], points: dict[str, SetPoints], calls: int
) -> dict[str, float]:
    """p99 of requests and of references until the state shows them, ms, of both boards."""
    times: dict[str, list[float]] = {}
    talkers = {case: talking for case, (_, talking) in boards.items()}
    clients = {
        case: talking.client(SetControlMode, f"{BOARD}/set_control_mode")
        for case, talking in talkers.items()
    }
    modes = cycle(("vel", "posd"))
    for _ in range(2 * (calls // 2)):
        request = SetControlMode.Request(modes=[next(modes)])
        for case, talking in talkers.items():
            start = perf_counter()
            talking.call(clients[case], request)
            times.setdefault(f"mode request {case}", []).append(perf_counter() - start)
    for k in range(calls):
        position = 1e-4 * (k % 100 + 1)
        for case, sender in points.items():
            start = perf_counter()
            sender.send(position)
            sender.wait_for(position)
            times.setdefault(f"reference to state {case}", []).append(perf_counter() - start)
    return {key: 1e3 * percentile(values, 99) for key, values in times.items()}

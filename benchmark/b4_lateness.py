# SPDX-License-Identifier: Apache-2.0
"""B4: lateness of the cycle start at 1 kHz and real time, quiet and under load."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, nullcontext
from itertools import product
from typing import Any

from common import Effort, Figure, Goal, at_most, exactly, number, percentile
from processes import BOARD, board, helper
from talking import switch, talker
from tap import Fared, tap

from control_board_ros.testing import free_domain

NOTHING: Callable[[int], AbstractContextManager[Any]] = lambda _: nullcontext()  # noqa: E731
#: Case, parameters of the node, load beside it, bounds of the p99: with niceness, without (ms).
CASES: tuple[tuple[str, dict[str, float], Any, float, float], ...] = (
    ("quiet", {}, NOTHING, 0.18, 0.3),
    (
        "1 kHz commands in, 1 kHz state out",
        {"state_rate": 1000.0},
        lambda domain: helper(domain, "load", "command", BOARD, 1000),
        0.4,
        1.0,
    ),
    (
        "10 kHz flood of commands",
        {},
        lambda domain: helper(domain, "load", "command", BOARD, 10000),
        1.1,
        3.0,
    ),
)
#: Who starts the node, and whether the niceness that it asks for is granted.
USERS = {"niceness granted": False, "ordinary user": True}


def run(effort: Effort) -> list[Figure]:
    """Measure all cases, each after a bare loop."""
    figures = []
    cases = effort.of(CASES, CASES, CASES[1:2])
    for (case, params, load, *bounds), user in product(cases, USERS):
        bound = bounds[USERS[user]]
        with free_domain() as domain:
            with helper(domain, "bare", "loop", effort.of(10.0, 1.0, 0.2)) as bare:
                reference = bare.result()
            with (
                tap() as tapped,
                board(domain, params, tap=tapped, ordinary=USERS[user]),
                ExitStack() as stack,
            ):
                with talker(domain) as talking:
                    switch(talking, "posd")
                sender = stack.enter_context(load(domain))
                if effort.level == "full":
                    tapped.window(2.0)  # until discovery is over
                fared = tapped.window(effort.of(60.0, 2.0, 0.0))[0]
                loaded = {} if sender is None else sender.result()
        figures += _figures(f"{case}, {user}", bound, fared, reference, loaded)
    return figures


def _figures(
    case: str, bound: float, fared: Fared, bare: dict[str, Any], load: dict[str, float]
) -> list[Figure]:
    p50, p99, worst = (1e3 * percentile(fared.lateness, p) for p in (50, 99, 100))
    bare99, bare_worst = (1e3 * percentile(bare["lateness"], p) for p in (99, 100))
    reference = f"bare loop, quiet: p99 {number(bare99)} ms, worst {number(bare_worst)} ms"
    details = {
        "p50": p50,
        "p99": p99,
        "worst": worst,
        "bare_p99": bare99,
        "bare_worst": bare_worst,
        "cycles": float(len(fared.lateness)),
        "overruns": float(fared.overruns),
        "skipped": float(fared.skipped),
    } | {f"load_{key}": value for key, value in load.items()}
    rates = "".join(f"; {key} {value:.0f} /s" for key, value in load.items())
    skipped: Goal | None = exactly(0.0) if case.startswith("quiet") else None
    return [
        Figure(
            "B4",
            f"lateness of the cycle start, p99, {case}",
            p99,
            "ms",
            at_most(bound),
            reference + rates,
            details,
        ),
        Figure(
            "B4",
            f"average rate, {case}",
            round(fared.rate, 1),
            "Hz",
            exactly(1000.0),
            f"bare loop: {bare['rate']:.1f} Hz",
            digits=5,
        ),
        Figure("B4", f"cycles skipped, {case}", float(fared.skipped), "", skipped),
    ]

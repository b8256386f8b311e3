# SPDX-License-Identifier: Apache-2.0
"""B8: from a published reference to the state that shows it, beside a bare relay."""

from __future__ import annotations

import random
import time

from common import Effort, Figure, at_most, medians, number, percentile
from processes import BARE, BOARD, board, helper
from talking import SetPoints, switch, talker

from control_board_ros.testing import free_domain


def run(effort: Effort) -> list[Figure]:
    """Measure both in turns, at 1 kHz state."""
    times, runs = effort.of(400, 150, 10), effort.of(5, 1, 1)
    with (
        free_domain() as domain,
        board(domain, {"state_rate": 1000.0}),
        helper(domain, "bare", "state"),
    ):
        with talker(domain) as talking:
            switch(talking, "posd")
        turns = [
            (_measure(domain, BOARD, times), _measure(domain, BARE, times)) for _ in range(runs)
        ]
    found, bare = (medians(runs) for runs in zip(*turns, strict=True))
    return [
        Figure(
            "B8",
            f"reference published to seen in state (1 kHz), {name}",
            found[key],
            "ms",
            at_most(bound),
            f"bare relay: {number(bare[key])} ms",
            found | {f"bare_{other}": value for other, value in bare.items()},
        )
        for name, key, bound in (("median", "p50", 2.0), ("p99", "p99", 4.0))
    ]


def _measure(domain: int, name: str, times: int) -> dict[str, float]:
    """Latencies of ``times`` set-points, ms."""
    chance = random.Random(times)
    latencies = []
    with talker(domain) as talking:
        points = SetPoints(talking, name)
        for k in range(times):
            talking.pause(0.002 + 0.002 * chance.random())  # at any phase of the cycle
            position = 1e-5 * (k + 1)
            start = time.perf_counter()
            points.send(position)
            if not points.wait_for(position):
                raise RuntimeError(f"{name} never showed set-point {position}")
            latencies.append(1e3 * (time.perf_counter() - start))
    return {"p50": percentile(latencies, 50), "p99": percentile(latencies, 99)}

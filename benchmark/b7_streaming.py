# SPDX-License-Identifier: Apache-2.0
"""B7: ``~/state`` at 1 kHz as another process receives it, beside a bare publisher's stream."""

from __future__ import annotations

import time
from itertools import pairwise
from typing import Any

from common import Effort, Figure, at_least, at_most, medians, number, percentile
from processes import BARE, BOARD, board, helper

from control_board_ros.testing import free_domain

RATE = 1000.0


def run(effort: Effort) -> list[Figure]:
    """Listen to both in turns."""
    seconds, runs = effort.of(10.0, 2.0, 0.5), effort.of(3, 1, 1)
    ours, bare = [], []
    for _ in range(runs):
        with free_domain() as domain:
            with board(domain, {"state_rate": RATE}):
                ours.append(_listen(domain, BOARD, seconds))
            with helper(domain, "bare", "state"):
                bare.append(_listen(domain, BARE, seconds))
    found, reference = medians(ours), medians(bare)
    return [
        Figure(
            "B7",
            "state at 1 kHz delivered to another process",
            found["delivered"],
            "%",
            at_least(99.9),
            f"bare publisher: {number(reference['delivered'], 5)} %",
            found | {f"bare_{key}": value for key, value in reference.items()},
            digits=5,
        ),
        Figure(
            "B7",
            "state at 1 kHz, time between arrivals, p99",
            found["p99"],
            "ms",
            at_most(1.4),
            f"bare publisher: {number(reference['p99'])} ms",
        ),
    ]


def _listen(domain: int, name: str, seconds: float) -> dict[str, float]:
    with helper(domain, "load", "listen", name) as listener:
        time.sleep(seconds)
        return _judge(listener.result())


def _judge(received: dict[str, Any]) -> dict[str, float]:
    """What came of what a 1 kHz board sends between the first and the last stamp, percent."""
    stamps, arrivals = received["stamps"], received["arrivals"]
    sent = round((stamps[-1] - stamps[0]) * RATE) + 1
    gaps = [1e3 * (after - before) for before, after in pairwise(arrivals)]
    return {
        "delivered": min(100.0, 100.0 * len(stamps) / sent),
        "p50": percentile(gaps, 50),
        "p99": percentile(gaps, 99),
        "worst": max(gaps),
    }

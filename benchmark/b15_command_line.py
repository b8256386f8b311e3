# SPDX-License-Identifier: Apache-2.0
"""B15: cbctl modes from start to end, beside a bare rclpy program that makes a node."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping, Sequence
from statistics import median
from time import perf_counter

from common import Effort, Figure, at_most, number
from processes import board

from control_board_ros.testing import child_environment, free_domain

CBCTL = (sys.executable, "-m", "control_board_ros.cli", "modes")
BARE = (
    sys.executable,
    "-c",
    "import rclpy; rclpy.init(); node = rclpy.create_node('bare'); "
    "node.destroy_node(); rclpy.shutdown()",
)


def run(effort: Effort) -> list[Figure]:
    """Measure both in turns, with a board running."""
    with free_domain() as domain, board(domain):
        environment = child_environment(domain)
        turns = [
            (_seconds(CBCTL, environment), _seconds(BARE, environment))
            for _ in range(effort.of(20, 5, 1))
        ]
    cbctl, bare = (median(times) for times in zip(*turns, strict=True))
    return [
        Figure(
            "B15",
            "cbctl modes, from start to end",
            cbctl / bare,
            "×",
            at_most(1.5),
            f"{number(cbctl)} s against {number(bare)} s of a bare node",
            {"cbctl": cbctl, "bare": bare},
        )
    ]


def _seconds(command: Sequence[str], environment: Mapping[str, str]) -> float:
    """The duration of a command, s; it must succeed."""
    start = perf_counter()
    subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=True)
    return perf_counter() - start

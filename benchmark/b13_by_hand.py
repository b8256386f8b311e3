# SPDX-License-Identifier: Apache-2.0
"""B13: our cycle beside what a user would write instead: PD by hand, POSITION_CONTROL, MuJoCo."""

from __future__ import annotations

from importlib.util import find_spec
from statistics import median

from by_hand import LOOPS, MujocoByHand
from common import Effort, Figure, at_most, number
from cycles import BoardCycles, Loop, in_turns

from control_board_ros.settings import loading as settings
from control_board_ros.settings.loading import Settings

ROBOTS = ("iiwa", "panda")


def run(effort: Effort) -> list[Figure]:
    """Time all loops in turns, on the iiwa and the panda."""
    chunks, runs = effort.of(40, 20, 3), effort.of(9, 3, 1)
    figures = []
    for robot in effort.of(ROBOTS, ROBOTS, ROBOTS[:1]):
        found = measure(settings.load(robot), chunks, runs)
        ours = median(found["board"])
        for name, times in found.items():
            if name == "board":
                continue
            ratio = median(mine / other for mine, other in zip(found["board"], times, strict=True))
            figures.append(
                Figure(
                    "B13",
                    f"control cycle of the {robot} against {name}",
                    ratio,
                    "×",
                    at_most(1.5) if "PD law" in name and "MuJoCo" not in name else None,
                    f"{number(ours)} µs against {number(median(times))} µs",
                )
            )
    return figures


def measure(arm: Settings, chunks: int, runs: int) -> dict[str, list[float]]:
    """Times per cycle, µs, one per run, of the board and of every loop by hand."""
    makers = dict(LOOPS)
    if find_spec("mujoco") is not None:
        makers["a PD law by hand in MuJoCo"] = MujocoByHand
    found: dict[str, list[float]] = {name: [] for name in ("board", *makers)}
    for _ in range(runs):
        loops: dict[str, Loop] = {"board": BoardCycles(arm)}
        loops |= {name: make(arm) for name, make in makers.items()}
        for name, time in in_turns(loops, chunks).items():
            found[name].append(time)
    return found

# SPDX-License-Identifier: Apache-2.0
"""B13: our cycle beside what a user would write instead: PD by hand, POSITION_CONTROL, MuJoCo."""

from __future__ import annotations

import gc
from importlib.util import find_spec
from statistics import median

from by_hand import LOOPS, Loop, MujocoByHand
from common import Effort, Figure, at_most, number
from cycles import CHUNK, WARM_UP, BoardCycles

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
        loops: dict[str, BoardCycles | Loop] = {"board": BoardCycles(arm)}
        loops |= {name: make(arm) for name, make in makers.items()}
        gc.collect()
        gc.freeze()
        times: dict[str, list[float]] = {name: [] for name in loops}
        for _ in range(WARM_UP + chunks):
            for name, loop in loops.items():
                times[name].append(loop.chunk())
        gc.unfreeze()
        for name, loop in loops.items():
            loop.close()
            found[name].append(1e6 * median(times[name][WARM_UP:]) / CHUNK)
    return found

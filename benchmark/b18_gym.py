# SPDX-License-Identifier: Apache-2.0
"""B18: simulated steps of Gymnasium's environments per second of a core, beside bare MuJoCo's.

Bare MuJoCo steps as many of the same arms, one after the other, without motors, sensors and
board; and all of them in one world.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.util import find_spec
from statistics import median
from typing import Any

import numpy as np
from common import Effort, Figure, at_least, number

from control_board_ros.settings import loading as settings

ARMS = 64
#: Control cycles, and physics steps, of a step of the environment.
CYCLES = 50


def run(effort: Effort) -> list[Figure]:
    """Step one arm, and 64 in one process, in turns with bare MuJoCo; nothing without them."""
    if find_spec("gymnasium") is None or find_spec("mujoco") is None:
        return []
    import mujoco

    from control_board_ros.gym.env import ArmEnv, FleetEnv
    from control_board_ros.sim.bodies.mujoco import MujocoBody

    runs, steps = effort.of(9, 5, 1), effort.of(10, 4, 1)
    arm = settings.load("iiwa", {"physics": "mujoco"})
    model = MujocoBody(arm.board, arm.simulation)._model
    home = [joint.home for joint in arm.simulation.joints]
    fleet = FleetEnv(ARMS, task="Track", control="direct")
    alone = ArmEnv("Track", control="direct")
    fleet.reset(seed=1)
    alone.reset(seed=1)
    body: Any = fleet._episodes.arms.body
    world = body._model, mujoco.MjData(body._model)
    world[1].qpos[:] = home * ARMS
    datas = [mujoco.MjData(model) for _ in range(ARMS)]
    for data in datas:
        data.qpos[:] = home

    def bare(chosen: list[Any]) -> None:
        for _ in range(CYCLES):
            for data in chosen:
                mujoco.mj_step(model, data)

    def in_one() -> None:
        for _ in range(CYCLES):
            mujoco.mj_step(*world)

    still = np.zeros((ARMS, 7), np.float32)
    loops: dict[str, tuple[int, Callable[[], Any]]] = {
        "fleet": (ARMS, lambda: fleet.step(still)),
        "alone": (1, lambda: alone.step(still[0])),
        "bare": (ARMS, lambda: bare(datas)),
        "bare alone": (1, lambda: bare(datas[:1])),
        "bare world": (ARMS, in_one),
    }
    rates: dict[str, list[float]] = {name: [] for name in loops}
    for _ in range(runs):
        for name, (arms, loop) in loops.items():
            times = steps if arms > 1 else steps * 10
            begin = time.process_time()
            for _ in range(times):
                loop()
            rates[name].append(arms * CYCLES * times / (time.process_time() - begin))
    fleet.close()
    alone.close()
    return [
        _figure(f"{ARMS} arms in one process", rates["fleet"], rates["bare"], "each alone", 0.5),
        _figure(
            f"{ARMS} arms in one process", rates["fleet"], rates["bare world"], "in one world"
        ),
        _figure("one arm", rates["alone"], rates["bare alone"], "alone"),
    ]


def _figure(
    case: str, ours: list[float], bare: list[float], how: str, goal: float | None = None
) -> Figure:
    ratio = median(mine / other for mine, other in zip(ours, bare, strict=True))
    return Figure(
        "B18",
        f"steps of an environment of {case}, beside bare MuJoCo's of as many {how}",
        ratio,
        "×",
        None if goal is None else at_least(goal),
        f"{number(median(ours))} against {number(median(bare))} steps of an arm per second",
        {"ours": median(ours), "bare": median(bare)},
    )

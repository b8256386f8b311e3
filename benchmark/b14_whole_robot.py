# SPDX-License-Identifier: Apache-2.0
"""B14: the whole iCub, 32 joints in six parts, at 1 kHz in one process."""

from __future__ import annotations

import time
from importlib.util import find_spec
from statistics import median

from common import Effort, Figure, Goal, at_most, number, percentile
from processes import board, cpu_seconds, helper, resident_megabytes, seconds_to_first_state
from sensor_msgs.msg import JointState
from tap import tap

from control_board_ros.testing import free_domain, ros_node

TOPIC = "/icub/joint_states"
#: Engine, what a case says of it, and the goals: processor %, lateness p99 ms, start s.
ENGINES = (("pybullet", "", (45.0, 0.5, 1.5)), ("mujoco", ", in MuJoCo", (None, None, None)))


def run(effort: Effort) -> list[Figure]:
    """Measure start, processor and lateness of the whole iCub (extra icub), with each engine."""
    figures: list[Figure] = []
    if find_spec("icub_models") is None:
        return figures
    for physics, where, goals in ENGINES:
        figures += _with(physics, where, goals, effort)
    return figures


def _with(
    physics: str, where: str, goals: tuple[float | None, ...], effort: Effort
) -> list[Figure]:
    processor, latest, soonest = (None if goal is None else at_most(goal) for goal in goals)
    params = {"robot": "icub", "physics": physics}
    with free_domain() as domain:
        starts = [
            seconds_to_first_state(domain, TOPIC, "robot:=icub", f"physics:={physics}")
            for _ in range(effort.of(3, 1, 1))
        ]
        with helper(domain, "bare", "loop", effort.of(4.0, 1.0, 0.2)) as bare:
            reference = bare.result()["lateness"]
        with tap() as tapped, board(domain, params, tap=tapped, robot="icub") as running:
            pid = running.process.pid
            with ros_node(domain, "listening") as node:
                node.create_subscription(JointState, TOPIC, lambda _: None, 10)
                if effort.level == "full":
                    tapped.window(4.0)  # until discovery and calibration are over
                begin, used = time.monotonic(), cpu_seconds(pid)
                fared = tapped.window(effort.of(12.0, 2.0, 0.3))[0]
                share = 100.0 * (cpu_seconds(pid) - used) / (time.monotonic() - begin)
            memory = resident_megabytes(pid)
    late = 1e3 * percentile(fared.lateness, 99)
    bare_late = 1e3 * percentile(reference, 99)
    text = f"{fared.rate:.1f} Hz, {fared.overruns} overruns; bare loop: {number(bare_late)} ms"
    return [
        _figure(
            "processor at 1 kHz, joint states at 100 Hz with one subscriber",
            where,
            share,
            "%",
            processor,
            f"of one core; memory {number(memory)} MB",
        ),
        _figure("lateness of the cycle start, p99, quiet", where, late, "ms", latest, text),
        _figure(
            "from the command to the first joint state",
            where,
            median(starts),
            "s",
            soonest,
            f"of {len(starts)}: {', '.join(number(start) for start in sorted(starts))} s",
        ),
    ]


def _figure(
    case: str, where: str, value: float, unit: str, goal: Goal | None, reference: str
) -> Figure:
    return Figure(
        "B14",
        f"iCub, 32 joints: {case}{where}",
        value,
        unit,
        goal,
        reference,
    )

# SPDX-License-Identifier: Apache-2.0
"""B10: what the board costs as it is started by default, and how soon it is there."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median

from common import Effort, Figure, at_most, number
from control_board_msgs.msg import BoardState
from processes import (
    BARE,
    BOARD,
    board,
    cpu_share,
    helper,
    resident_megabytes,
    seconds_to_first_state,
)
from sensor_msgs.msg import JointState

from control_board_ros.testing import free_domain, ros_node

#: Engine, what a case says of it, and the goals: processor %, memory MB, start s.
ENGINES = (("pybullet", "", (12.0, 115.0, 0.5)), ("mujoco", ", in MuJoCo", (None, None, None)))


def run(effort: Effort) -> list[Figure]:
    """Measure start, processor and memory of the default configuration, with each engine."""
    figures = []
    for physics, where, goals in ENGINES:
        figures += _with(physics, where, goals, effort)
    return figures


def _with(
    physics: str, where: str, goals: tuple[float | None, ...], effort: Effort
) -> list[Figure]:
    processor, most, soonest = (None if goal is None else at_most(goal) for goal in goals)
    stated, params = processor is not None, {"physics": physics}
    with free_domain() as domain:
        starts = [
            seconds_to_first_state(domain, "/joint_states", f"physics:={physics}")
            for _ in range(effort.of(5, 1, 1))
        ]
        with board(domain, params) as running:
            time.sleep(effort.of(3.0, 1.0, 0.0))
            pid = running.process.pid
            seconds, runs = effort.of(20.0, 2.0, 0.3), effort.of(2, 1, 1)
            alone = [cpu_share([pid], seconds) for _ in range(runs)]
            with _listener(domain, BOARD):
                time.sleep(effort.of(3.0, 1.0, 0.0))
                shares = [cpu_share([pid], seconds) for _ in range(runs)]
            memory = resident_megabytes(pid)
        reference = f"{number(median(alone))} % without subscribers"
        if stated:
            bare = _bare("physics", domain, effort)
            with _listener(domain):
                publishing = _bare("node", domain, effort)
            reference += f"; bare pybullet at 1 kHz: {number(bare)} %, in a bare node that "
            reference += f"publishes both states: {number(publishing)} %"
    return [
        Figure(
            "B10",
            f"processor at 1 kHz control and 100 Hz state, of one core{where}",
            median(shares),
            "%",
            processor,
            reference,
        ),
        Figure("B10", f"resident memory{where}", memory, "MB", most),
        Figure(
            "B10",
            f"from the command to the first joint state{where}",
            median(starts),
            "s",
            soonest,
            f"of {len(starts)} starts: {', '.join(number(start) for start in sorted(starts))} s",
        ),
    ]


@contextmanager
def _listener(domain: int, node_name: str = BARE) -> Iterator[None]:
    """A node that subscribes to both states of another."""
    with ros_node(domain, "listening") as node:
        for kind, name in ((JointState, "/joint_states"), (BoardState, f"{node_name}/state")):
            node.create_subscription(kind, name, lambda _: None, 10)
        yield


def _bare(role: str, domain: int, effort: Effort) -> float:
    """Processor time of a bare reference, % of a core."""
    with helper(domain, "bare", role) as bare:
        time.sleep(effort.of(3.0, 1.0, 0.0))
        return cpu_share([bare.process.pid], effort.of(20.0, 2.0, 0.3))

# SPDX-License-Identifier: Apache-2.0
"""B3: simulated seconds per second, without ROS and with the node."""

from __future__ import annotations

import time
from collections import deque
from statistics import median

from common import Effort, Figure, at_least
from processes import board
from sensor_msgs.msg import JointState

from control_board_ros.settings import loading as settings
from control_board_ros.simulation import Simulation
from control_board_ros.testing import free_domain, ros_node

STATE_RATE = 100  # Hz of simulated time


def run(effort: Effort) -> list[Figure]:
    """Measure the iiwa on the way from one pose to another and back."""
    runs = effort.of(5, 2, 1)
    published = f"node publishing at {STATE_RATE} Hz of simulated time"
    figures = []
    for physics, where, alone, with_node in (
        ("pybullet", "", 50.0, 25.0),
        ("mujoco", ", in MuJoCo", None, None),
    ):
        factors = [_alone(effort, physics) for _ in range(runs)]
        figures.append(_figure(f"simulation without ROS{where}", factors, alone))
        figures.append(_figure(f"{published}{where}", _node(effort, physics), with_node))
    return figures


def _figure(case: str, factors: list[float], bound: float | None) -> Figure:
    reference = "real time"
    details = {"factor": median(factors), "slowest": min(factors), "fastest": max(factors)}
    goal = None if bound is None else at_least(bound)
    return Figure("B3", case, median(factors), "×", goal, reference, details)


def _alone(effort: Effort, physics: str) -> float:
    """One run of the board with its plant in this process."""
    arm = settings.load("iiwa", {"physics": physics})
    home = [joint.home for joint in arm.simulation.joints]
    moves = effort.of(20, 5, 1)
    with Simulation(arm.board, arm.simulation) as simulation:
        simulation.run(0.1)
        begin = time.perf_counter()
        for move in range(moves):
            simulation.board.position_move(None, [angle + 0.1 * (move % 2) for angle in home])
            simulation.run(1.0)
        return moves / (time.perf_counter() - begin)


def _node(effort: Effort, physics: str) -> list[float]:
    """Windows of a running node, by the stamps that a subscriber sees."""
    newest: deque[tuple[float, float]] = deque(maxlen=1)

    def hear(message: JointState) -> None:
        stamp = message.header.stamp
        newest.append((time.monotonic(), stamp.sec + 1e-9 * stamp.nanosec))

    params = {"physics": physics, "real_time_factor": 0.0, "state_rate": float(STATE_RATE)}
    with (
        free_domain() as domain,
        board(domain, params),
        ros_node(domain) as node,
    ):
        node.create_subscription(JointState, "/joint_states", hear, 10)
        while not newest:
            time.sleep(0.01)
        time.sleep(effort.of(1.0, 0.5, 0.1))
        factors = []
        for _ in range(effort.of(5, 2, 1)):
            (begin, first), _ = newest[0], time.sleep(effort.of(3.0, 1.0, 0.3))
            end, last = newest[0]
            factors.append((last - first) / (end - begin))
        return factors

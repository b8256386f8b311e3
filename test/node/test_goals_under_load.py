# SPDX-License-Identifier: Apache-2.0
"""Thousands of goals of 5 ms, from four clients, cancelled at random, as fast as the board goes.

Each has one result, and the board prints no traceback (the module's board looks for one).
"""

from __future__ import annotations

from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from control_board_msgs.action import Move
from control_msgs.action import FollowJointTrajectory
from goal_clients import ends_of_goals
from talk import Talker
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from control_board_ros.testing import BoardProcess

pytestmark = pytest.mark.ros
SOAK = [pytest.mark.soak, pytest.mark.timeout(4 * 3600)]

MOVED, FOLLOWS = "lbr_iiwa_joint_6", "lbr_iiwa_joint_7"
#: rad, the way of a move of 5 ms.
WAY = 5e-5


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    return {"real_time_factor": 0.0, "state_rate": 10.0, "physics": "ideal"}


def move(part: float) -> Any:
    return Move.Goal(names=[MOVED], positions=[WAY * part], speeds=[1.0])


def trajectory(part: float) -> Any:
    point = JointTrajectoryPoint(
        positions=[WAY * part], time_from_start=Duration(nanosec=5_000_000)
    )
    return FollowJointTrajectory.Goal(
        trajectory=JointTrajectory(joint_names=[FOLLOWS], points=[point])
    )


ACTIONS = {
    "move": (Move, move),
    "follow_joint_trajectory": (FollowJointTrajectory, trajectory),
}


@pytest.mark.slow
@pytest.mark.parametrize("count", [80, pytest.param(10_000, marks=SOAK)])
@pytest.mark.parametrize("action", ACTIONS)
def test_every_goal_has_one_result(
    talker: Talker, board: BoardProcess, action: str, count: int
) -> None:
    assert talker.set_mode([FOLLOWS], "posd").success
    kind, goal = ACTIONS[action]
    ends = ends_of_goals(board, kind, action, goal, count=count)
    assert ends.total() == count
    assert set(ends) <= {"succeeded", "canceled", "aborted"}
    assert ends["succeeded"]
    if count > 1000:  # few of so short goals may all end before they are cancelled
        assert ends["canceled"]
    assert set(talker.modes()) <= {"pos", "posd"}
    assert "Traceback" not in board.output

# SPDX-License-Identifier: Apache-2.0
"""Thousands of goals of 5 ms, from four clients, as fast as the board goes.

At random one lasts, and is cancelled. Each has one result, and the board prints no traceback (the
module's board looks for one).
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

#: The joint of each client's moves and its home, and that of all trajectories.
MOVED = [
    (f"lbr_iiwa_joint_{number}", home) for number, home in ((1, 0.0), (3, 0.0), (5, 0.0), (6, 0.9))
]
FOLLOWS = "lbr_iiwa_joint_7"
#: rad, and s that a goal lasts, or one that is cancelled.
WAY, SHORT, LONG = 1e-4, 5e-3, 60.0


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    return {"real_time_factor": 0.0, "state_rate": 10.0, "physics": "ideal"}


def move(client: int, part: float, lasts: bool) -> Any:
    joint, home = MOVED[client]
    speed = WAY / (LONG if lasts else SHORT)
    return Move.Goal(names=[joint], positions=[home + WAY * part], speeds=[speed])


def trajectory(_: int, part: float, lasts: bool) -> Any:
    time = Duration(sec=int(LONG)) if lasts else Duration(nanosec=int(SHORT * 1e9))
    point = JointTrajectoryPoint(positions=[WAY * part], time_from_start=time)
    return FollowJointTrajectory.Goal(
        trajectory=JointTrajectory(joint_names=[FOLLOWS], points=[point])
    )


#: Type, goal, and goals of one client at a time: the newest ends those before it.
ACTIONS = {
    "move": (Move, move, 2),
    "follow_joint_trajectory": (FollowJointTrajectory, trajectory, 1),
}


@pytest.mark.slow
@pytest.mark.parametrize("count", [40, pytest.param(10_000, marks=SOAK)])
@pytest.mark.parametrize("action", ACTIONS)
def test_every_goal_has_one_result(
    talker: Talker,
    board: BoardProcess,
    capfd: pytest.CaptureFixture[str],
    action: str,
    count: int,
) -> None:
    assert talker.set_mode([FOLLOWS], "posd").success
    kind, goal, at_a_time = ACTIONS[action]
    ends = ends_of_goals(board, kind, action, goal, count=count, at_a_time=at_a_time)
    assert ends.total() == count
    assert set(ends) <= {"succeeded", "canceled", "aborted"}
    assert ends["succeeded"]
    assert ends["canceled"]
    assert set(talker.modes()) <= {"pos", "posd"}
    assert "Traceback" not in board.output
    assert "unexpected" not in capfd.readouterr().err  # what rclpy says of a second answer

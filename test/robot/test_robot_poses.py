# SPDX-License-Identifier: Apache-2.0
"""R5, R6 over the joints of several parts: one arrival, whole or not at all."""

from __future__ import annotations

import pytest
from robots import RobotRig, parts

from control_board_ros.core.goals.pose import Pose
from control_board_ros.core.goals.poses import PoseTask, start_parking
from control_board_ros.core.selection import RequestError

NAMES = tuple(name for config in parts().values() for name in config.names)
#: In another order than the parts'.
POSE = Pose("p", NAMES[::-1], tuple(0.1 * k for k in range(len(NAMES))), 0.4)


@pytest.fixture
def rig() -> RobotRig:
    """All joints of all parts in POSITION."""
    made = RobotRig(parts())
    made.tick(2)
    assert made.robot.set_control_mode(None, "pos")
    return made


def test_the_joints_of_all_parts_arrive_together(rig: RobotRig) -> None:
    """R5: T is that of the slowest joint, wherever it is."""
    task = PoseTask(rig.robot, POSE)
    cycles = round(task.remaining_time() / rig.robot.period)
    assert cycles == round(POSE.positions[-1] / 0.4 / rig.robot.period)
    rig.tick(cycles - 1)
    assert not any(rig.robot.check_motion_done(POSE.joints[1:]))
    rig.tick()
    assert all(rig.robot.check_motion_done())
    rig.tick(500)
    outcome = task.outcome()
    assert outcome is not None
    assert outcome.success, outcome.message
    assert rig.robot.get_encoder(POSE.joints) == pytest.approx(POSE.positions, abs=0.01)


def test_a_joint_of_one_part_refuses_it_for_all(rig: RobotRig) -> None:
    """R5, R3: nothing moves, in any part; parking switches what has power."""
    assert rig.robot.set_control_mode(NAMES[-1], "vel")
    with pytest.raises(RequestError, match=f"{NAMES[-1]} is in VELOCITY"):
        PoseTask(rig.robot, POSE)
    assert all(rig.robot.check_motion_done())
    start_parking(rig.robot, POSE)
    assert {mode.code for mode in rig.robot.get_control_mode()} == {"pos"}
    assert not all(rig.robot.check_motion_done())

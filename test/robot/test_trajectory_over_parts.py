# SPDX-License-Identifier: Apache-2.0
"""A trajectory of several parts: whole or not at all, one end (SPEC R3, T1, T2)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from robots import RobotRig, parts

from control_board_ros.core.goals.follower import Follower
from control_board_ros.core.goals.path import Points, make_path
from control_board_ros.core.goals.trajectory_goal import (
    Code,
    GoalError,
    TrajectoryGoal,
    Wish,
    Wishes,
    start_goal,
)

NONE = Wishes()
ARMS = ["r_elbow", "l_shoulder", "l_elbow"]


class Following(RobotRig):
    """Two arms and a hand in POSITION_DIRECT, with what follows."""

    def __init__(self) -> None:
        super().__init__(parts())
        self.follower = Follower(self.robot)
        self.tick(2)
        assert self.robot.set_control_mode(None, "posd")
        self.tick()

    def start(
        self, joints: list[str], *rows: list[float], wishes: Wishes = NONE
    ) -> TrajectoryGoal:
        """Start a goal from now, with a point each 0.2 s."""
        return start_goal(
            self.follower, self.robot, joints, points(*rows), self.robot.time, wishes
        )

    def follow(self, goal: TrajectoryGoal | None, cycles: int) -> None:
        """Let time pass, until the goal ends at most."""
        for _ in range(cycles):
            measurement = self.plant.read()
            if goal is not None:
                goal.check()
                if goal.outcome is not None:
                    return
            self.follower.step(measurement.time)
            self.plant.write(self.robot.tick(measurement))


def points(*rows: list[float]) -> Points:
    """Points at rest, 0.2 s apart."""
    return Points([0.2 * (k + 1) for k in range(len(rows))], list(rows), [], [])


@pytest.fixture
def rig() -> Following:
    return Following()


def test_joints_of_several_parts_arrive_in_one_goal(rig: Following) -> None:
    """Named in any order; the feedback has all joints of the robot in its order."""
    before = rig.robot.get_encoder()
    goal = rig.start(ARMS, [0.1, 0.2, 0.3])
    rig.follow(goal, 100)
    desired = goal.desired()
    assert desired.positions.shape == (rig.robot.count,)
    moving = rig.robot.get_ref_position()
    np.testing.assert_allclose(desired.positions, moving, atol=1e-9)
    assert 0.0 < goal.elapsed < 0.2
    rig.follow(goal, 2000)
    assert goal.outcome is not None
    assert goal.outcome.code is Code.SUCCESSFUL
    assert goal.outcome.text == "goal reached"
    np.testing.assert_allclose(rig.robot.get_encoder(ARMS), [0.1, 0.2, 0.3], atol=2e-3)
    fingers = ["finger", "thumb", "wrist"]
    np.testing.assert_allclose(rig.robot.get_encoder(fingers), before[4:], atol=1e-3)


@pytest.mark.parametrize(
    ("joints", "wishes", "code", "told"),
    [
        (["l_elbow", "nose"], Wishes(), Code.INVALID_JOINTS, "nose"),
        (["l_elbow", "l_elbow"], Wishes(), Code.INVALID_JOINTS, "twice"),
        (
            ["l_elbow", "r_elbow"],
            Wishes(path=[Wish("nose", 1.0, 0.0)]),
            Code.INVALID_GOAL,
            "path_tolerance names 'nose'",
        ),
        (["l_elbow", "r_elbow", "thumb"], Wishes(), Code.INVALID_GOAL, "3"),
    ],
)
def test_what_is_wrong_starts_nothing(
    rig: Following, joints: list[str], wishes: Wishes, code: Code, told: str
) -> None:
    """R3, M7: the whole goal is refused; nothing moves in any part."""
    with pytest.raises(GoalError, match=told) as refused:
        rig.start(joints, [0.1, 0.2], wishes=wishes)
    assert refused.value.code is code
    assert not rig.follower.busy


def test_a_part_that_takes_whole_goals_only(rig: Following) -> None:
    """Its joints are named together or not at all; parts that are not named do not matter."""
    left = rig.robot.parts["left"]
    left.reconfigure(replace(left.config, allow_partial_joints_goal=False))
    with pytest.raises(GoalError, match="l_shoulder missing"):
        rig.start(["l_elbow", "r_elbow"], [0.1, 0.2])
    rig.start(["r_elbow", "thumb"], [0.1, 0.2])
    rig.start(ARMS, [0.1, 0.2, 0.3])


def test_a_part_that_takes_whole_trajectories_only(rig: Following) -> None:
    """T1: of a trajectory on the topic, too: refused whole, and counted."""
    left = rig.robot.parts["left"]
    left.reconfigure(replace(left.config, allow_partial_joints_goal=False))
    before = rig.robot.rejected_commands.sum()
    names = ["l_elbow", "r_elbow"]
    path = make_path(tuple(names), *points([0.1, 0.1]))
    reply = rig.follower.follow(names, path, rig.robot.time)
    assert not reply
    assert "l_shoulder missing" in reply.message
    assert not rig.follower.busy
    assert rig.robot.rejected_commands.sum() == before + 2


def test_where_a_part_fails_the_others_stop(rig: Following) -> None:
    """T2: one end for all of them, with the reason of the part that failed."""
    goal = rig.start(ARMS, [0.5, 0.5, 0.5], [1.0, 1.0, 1.0])
    rig.follow(goal, 100)
    assert rig.robot.set_control_mode("r_elbow", "pos")
    rig.follow(goal, 1)
    assert goal.outcome is not None
    assert goal.outcome.code is Code.INVALID_GOAL
    assert "r_elbow is in POSITION" in goal.outcome.text
    rig.follow(None, 1000)
    assert not rig.follower.busy
    still = rig.robot.get_encoder(ARMS[1:])
    assert (still < 0.9).all()
    rig.follow(None, 100)
    np.testing.assert_allclose(rig.robot.get_encoder(ARMS[1:]), still, atol=1e-3)


def test_a_parts_own_goal_takes_its_joints(rig: Following) -> None:
    """T1: the newest goal of a joint wins; the robot's ends whole, with the reason."""
    whole = rig.start(ARMS, [1.0, 1.0, 1.0])
    rig.follow(whole, 20)
    left = rig.robot.parts["left"]
    start_goal(rig.follower, left, ["l_elbow"], points([0.1]), left.time)
    rig.follow(whole, 2)
    assert whole.outcome is not None
    assert "l_elbow: another trajectory took over" in whole.outcome.text

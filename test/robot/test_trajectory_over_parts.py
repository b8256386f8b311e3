# SPDX-License-Identifier: Apache-2.0
"""A trajectory of several parts: whole or not at all, one end (SPEC R3, T1, T2)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from following import Following
from robots import parts

from control_board_ros.core.config.config import joined
from control_board_ros.core.goals.path import Points, make_path
from control_board_ros.core.goals.trajectory_goal import Code, GoalError, start_goal

ARMS = ["r_elbow", "l_shoulder", "l_elbow"]


def points(*rows: list[float]) -> Points:
    """Points at rest, 0.2 s apart."""
    return Points([0.2 * (k + 1) for k in range(len(rows))], list(rows), [], [])


@pytest.fixture
def rig() -> Following:
    """Two arms and a hand."""
    return Following(joined(parts()))


def test_joints_of_several_parts_arrive_in_one_goal(rig: Following) -> None:
    """Named in any order; the feedback has all joints of the robot in its order."""
    before = rig.board.get_encoder()
    goal = rig.send(points([0.1, 0.2, 0.3]), ARMS)
    rig.cycle(100)
    desired = goal.desired()
    assert desired.positions.shape == (rig.board.count,)
    moving = rig.board.get_ref_position()
    np.testing.assert_allclose(desired.positions, moving, atol=1e-9)
    assert 0.0 < goal.elapsed < 0.2
    rig.cycle(2000)
    assert goal.outcome is not None
    assert goal.outcome.code is Code.SUCCESSFUL
    assert goal.outcome.text == "goal reached"
    np.testing.assert_allclose(rig.board.get_encoder(ARMS), [0.1, 0.2, 0.3], atol=2e-3)
    fingers = ["finger", "thumb", "wrist"]
    np.testing.assert_allclose(rig.board.get_encoder(fingers), before[4:], atol=1e-3)


def test_a_part_that_accepts_whole_goals_only(rig: Following) -> None:
    """Its joints are named together or not at all; parts that are not named do not matter."""
    left = rig.board.parts["left"]
    left.reconfigure(replace(left.config, allow_partial_joints_goal=False))
    with pytest.raises(GoalError, match="l_shoulder missing"):
        rig.send(points([0.1, 0.2]), ["l_elbow", "r_elbow"])
    rig.send(points([0.1, 0.2]), ["r_elbow", "thumb"])
    rig.send(points([0.1, 0.2, 0.3]), ARMS)


def test_a_part_that_accepts_whole_trajectories_only(rig: Following) -> None:
    """T1: of a trajectory on the topic, too: refused whole, and counted."""
    left = rig.board.parts["left"]
    left.reconfigure(replace(left.config, allow_partial_joints_goal=False))
    before = rig.board.rejected_commands.sum()
    names = ["l_elbow", "r_elbow"]
    path = make_path(tuple(names), *points([0.1, 0.1]))
    reply = rig.follower.follow(names, path, rig.board.time)
    assert not reply
    assert "l_shoulder missing" in reply.message
    assert not rig.follower.busy
    assert rig.board.rejected_commands.sum() == before + 2


def test_where_a_part_fails_the_others_stop(rig: Following) -> None:
    """T2: one end for all of them, with the reason of the part that failed."""
    goal = rig.send(points([0.5, 0.5, 0.5], [1.0, 1.0, 1.0]), ARMS)
    rig.cycle(100)
    assert rig.board.set_control_mode("r_elbow", "pos")
    rig.cycle(1)
    assert goal.outcome is not None
    assert goal.outcome.code is Code.INVALID_GOAL
    assert "r_elbow is in POSITION" in goal.outcome.text
    rig.cycle(1000)
    assert not rig.follower.busy
    still = rig.board.get_encoder(ARMS[1:])
    assert (still < 0.9).all()
    rig.cycle(100)
    np.testing.assert_allclose(rig.board.get_encoder(ARMS[1:]), still, atol=1e-3)


def test_a_goal_of_a_part_preempts_its_joints(rig: Following) -> None:
    """T1: the newest goal of a joint wins; the robot's ends whole, with the reason."""
    whole = rig.send(points([1.0, 1.0, 1.0]), ARMS)
    rig.cycle(20)
    left = rig.board.parts["left"]
    start_goal(rig.follower, left, ["l_elbow"], points([0.1]), left.time)
    rig.cycle(2)
    assert whole.outcome is not None
    assert "l_elbow: replaced by another trajectory" in whole.outcome.text

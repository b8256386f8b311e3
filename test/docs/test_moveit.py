# SPDX-License-Identifier: Apache-2.0
"""config/moveit/: the files for MoveIt name the board's joints and keep to its limits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from control_board_ros.core.board import Board
from control_board_ros.interface import FOLLOW_JOINT_TRAJECTORY
from control_board_ros.settings.loading import load

MOVEIT = Path(__file__).resolve().parents[2] / "config/moveit"
ROBOTS = ("iiwa", "panda")


def read(robot: str, name: str) -> Any:
    return yaml.safe_load((MOVEIT / robot / name).read_text(encoding="utf-8"))


def test_there_is_one_folder_per_robot() -> None:
    assert sorted(path.name for path in MOVEIT.iterdir()) == sorted(ROBOTS)


@pytest.mark.parametrize("robot", ROBOTS)
def test_moveit_finds_the_action_of_every_joint(robot: str) -> None:
    """MoveIt calls <name>/<action_ns> for the joints of the controller <name>."""
    manager = read(robot, "moveit_controllers.yaml")["moveit_simple_controller_manager"]
    (name,) = manager["controller_names"]
    controller = manager[name]
    assert f"/{name}/{controller['action_ns']}" == FOLLOW_JOINT_TRAJECTORY.of("/control_board")
    assert controller["type"] == "FollowJointTrajectory"
    assert tuple(controller["joints"]) == Board(load(robot).board).names


@pytest.mark.parametrize("robot", ROBOTS)
def test_plans_keep_to_what_the_board_follows(robot: str) -> None:
    """Rounded to four digits, to the safe side."""
    told = read(robot, "joint_limits.yaml")["joint_limits"]
    board = load(robot).board
    assert tuple(told) == board.names
    for joint in board.joints:
        limits, row = joint.limits, told[joint.name]
        assert limits.lower <= row["min_position"] < limits.lower + 1.1e-4
        assert limits.upper >= row["max_position"] > limits.upper - 1.1e-4
        assert limits.velocity >= row["max_velocity"] > limits.velocity - 1.1e-4
        assert limits.acceleration >= row["max_acceleration"] > limits.acceleration - 1.1e-4
        assert row["has_position_limits"]
        assert row["has_velocity_limits"]
        assert row["has_acceleration_limits"]

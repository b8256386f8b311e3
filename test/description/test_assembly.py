# SPDX-License-Identifier: Apache-2.0
"""description/robots.py: several robots as one description."""

from __future__ import annotations

import numpy as np
import pytest

from control_board_ros.description.robots import Piece, assemble, load_robot
from control_board_ros.description.urdf import UrdfError
from control_board_ros.settings.loading import load


def test_two_arms_side_by_side() -> None:
    """Each joint as on the arm alone; what mimics follows its own leader."""
    alone = load_robot("panda")
    pair = load_robot("panda_pair")
    assert pair.independent == tuple(
        side + name for side in ("left_", "right_") for name in alone.independent
    )
    limits = [(joint.lower, joint.upper, joint.effort) for joint in alone.joints]
    assert [(joint.lower, joint.upper, joint.effort) for joint in pair.joints] == limits * 2
    assert {m.follower: m.leader for m in pair.mimics.values()} == {
        f"{side}_panda_finger_joint2": f"{side}_panda_finger_joint1" for side in ("left", "right")
    }
    assert pair.tree.base == "world"


def test_a_gripper_on_an_arm() -> None:
    """The arm carries it: what its last joints move is more."""
    arm, both = load("iiwa"), load("iiwa_gripper", {"parts.gripper": []})
    assert both.board.names == arm.board.names
    more = np.array([joint.inertia_max for joint in both.board.joints])
    less = np.array([joint.inertia_max for joint in arm.board.joints])
    assert (more[:6] > less[:6]).all()


def test_shipped_robots_of_parts() -> None:
    """Their tables name the joints of the arms and grippers."""
    pair, gripper = load("panda_pair"), load("iiwa_gripper")
    assert [*pair.parts] == ["left", "right"]
    assert (pair.robot_name, gripper.robot_name) == ("panda_pair", "iiwa_gripper")
    assert {name: len(joints) for name, joints in gripper.parts.items()} == {
        "arm": 7,
        "gripper": 1,
    }
    for made in (pair, gripper):
        assert (made.warnings, made.notes) == ((), ())
        assert set(made.board.names) == set(made.urdf.independent)
    single = load("panda")
    for mine, theirs in zip(pair.part("right").board.joints, single.board.joints, strict=True):
        for name in ("lower", "upper", "torque", "velocity"):
            assert getattr(mine.limits, name) == getattr(theirs.limits, name)
        assert mine.limits.acceleration == pytest.approx(theirs.limits.acceleration, rel=0.05)
        assert mine.impedance.stiffness == theirs.impedance.stiffness


def test_names_that_clash() -> None:
    """One line: which, and what to do."""
    with pytest.raises(UrdfError, match="'lbr_iiwa_link_0' is there twice"):
        assemble("two", [Piece("iiwa"), Piece("iiwa")])
    with pytest.raises(UrdfError, match="parent link 'table' is not in the URDF"):
        assemble("one", [Piece("iiwa", on="table")])

# SPDX-License-Identifier: Apache-2.0
"""The table of parts, joint prefixes, and the settings of each part (SPEC R1, R4)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from marks import needs_icub
from parameter_files import refusal, written

from control_board_ros.settings.loading import load
from control_board_ros.settings.parts import as_name

TABLE = """\
robot: iiwa
robot_name: pair
calibration_groups: ["lbr_iiwa_joint_6,lbr_iiwa_joint_1", "lbr_iiwa_joint_2"]
startup_levels: ["upper", "lower"]
parts:
  upper: [lbr_iiwa_joint_7, lbr_iiwa_joint_6]
  lower: {joints: [lbr_iiwa_joint_1, lbr_iiwa_joint_2]}
lbr_iiwa_joint_6.home: 0.4
"""
J1, J2, J6, J7 = (f"lbr_iiwa_joint_{k}" for k in (1, 2, 6, 7))


def test_the_joints_follow_the_parts(tmp_path: Path) -> None:
    """R1: in the order of the parts; joints in no part are fixed."""
    made = load(written(tmp_path, TABLE))
    assert made.parts == {"upper": (J7, J6), "lower": (J1, J2)}
    assert made.board.names == made.simulation.names == (J7, J6, J1, J2)
    assert made.levels == (("upper",), ("lower",))
    assert made.robot_name == "pair"


def test_a_part_has_the_settings_of_a_board(tmp_path: Path) -> None:
    """Its joints, its parameters, its calibration groups and poses, and no other's."""
    upper = load(written(tmp_path, TABLE), {"poses.ready." + J6: 0.2, "poses.up." + J1: 1.0}).part(
        "upper"
    )
    assert upper.board.names == (J7, J6)
    assert upper.board.calibration_groups == ((J6,),)
    assert upper.values["calibration_groups"] == [J6]
    assert upper.values[f"{J6}.home"] == 0.4
    assert not [name for name in upper.values if J1 in name or J2 in name]
    assert set(upper.poses) == {"home", "park", "ready"}
    narrow = upper.changed({f"{J6}.limits.upper": 1.0})
    assert narrow.board.joints[1].limits.upper == 1.0
    assert narrow.board.joints[0] is upper.board.joints[0]


def test_a_later_file_changes_the_table(tmp_path: Path) -> None:
    """An empty list leaves a part out."""
    made = load(written(tmp_path, TABLE), {"parts.upper": [], "startup_levels": []})
    assert made.parts == {"lower": (J1, J2)}
    assert made.board.calibration_groups == ((J1,), (J2,))
    again = load(
        written(tmp_path, TABLE), {"parts.upper": [J7], "parts.middle": ["lbr_iiwa_joint_4"]}
    )
    assert list(again.parts) == ["upper", "lower", "middle"]
    assert again.board.names == (J7, J1, J2, "lbr_iiwa_joint_4")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"parts.upper": [J6, J1]}, ["parts.lower", J1, "upper has it", "one part"]),
        ({"parts.upper": [J6, "elbow"]}, ["parts.upper", "'elbow'", "joints: "]),
        ({"parts.upper": [J6, J6]}, ["parts.upper", J6, "one part"]),
        ({"parts.robot": [J6]}, ["'robot'", "part's name"]),
        ({"parts.left arm": [J6]}, ["'left arm'", "part's name"]),
        ({"parts.upper": "elbow"}, ["parts.upper", "'elbow'"]),
        ({"parts.upper.speed": 1.0}, ["parts.upper.speed", "no such parameter"]),
        ({"parts": [J6]}, ["parts", "name the joints of each part"]),
        ({"joints": [J6]}, ["joints", "beside parts"]),
        ({"startup_levels": ["upper,legs"]}, ["startup_levels", "'legs'", "upper, lower"]),
        ({"startup_levels": ["upper", "upper"]}, ["startup_levels", "each once"]),
        ({"robot_name": "left arm"}, ["robot_name", "'left arm'", "letters"]),
        ({"joint_prefix": "left/"}, ["joint_prefix", "'left/'", "letters"]),
    ],
)
def test_wrong_tables_get_one_line(
    tmp_path: Path, changes: dict[str, Any], words: list[str]
) -> None:
    text = refusal(written(tmp_path, TABLE), changes)
    assert all(word in text for word in words), text


def test_joints_with_a_prefix(tmp_path: Path) -> None:
    """Files name joints as the URDF does; everything else has the prefix."""
    given = {"joint_prefix": "left_", "poses.ready." + J6: 0.2, "left_" + J7 + ".home": 0.1}
    made = load(written(tmp_path, TABLE), given)
    plain = load(written(tmp_path, TABLE))
    assert made.board.names == tuple("left_" + name for name in plain.board.names)
    assert made.values[f"left_{J6}.home"] == 0.4
    assert made.values[f"left_{J7}.home"] == 0.1
    assert made.poses["ready"].joints == ("left_" + J6,)
    assert made.part("upper").board.calibration_groups == (("left_" + J6,),)
    assert f'<joint name="left_{J7}"' in made.description
    kept = [joint.limits for joint in plain.board.joints]
    assert [joint.limits for joint in made.board.joints] == kept


def test_a_prefix_with_followers() -> None:
    """Joints that mimic follow those of the same robot."""
    made = load("panda", {"joint_prefix": "r_"})
    assert all(name.startswith("r_") for name in made.board.names)
    leaders = {mimic.leader for mimic in made.urdf.mimics.values()}
    assert all(leader.startswith("r_") for leader in leaders)


def test_names_for_nodes() -> None:
    assert [as_name(text) for text in ("two arms", "3d", "", "é-x")] == [
        "two_arms",
        "robot_3d",
        "robot",
        "x",
    ]


@needs_icub
def test_the_icub() -> None:
    """Six parts, 32 joints; the parts as on the robot."""
    made = load("icub")
    assert {name: len(joints) for name, joints in made.parts.items()} == {
        "head": 3,
        "torso": 3,
        "left_arm": 7,
        "right_arm": 7,
        "left_leg": 6,
        "right_leg": 6,
    }
    assert made.parts["torso"] == ("torso_yaw", "torso_roll", "torso_pitch")
    assert (made.robot_name, made.warnings, made.notes) == ("icub", (), ())
    groups = [[len(g) for g in made.part(p).board.calibration_groups] for p in made.parts]
    assert groups == [[1, 1, 1], [], [4, 1, 2], [4, 1, 2], [], []]
    for side in ("left", "right"):
        alone, part = load(f"icub_{side}_arm"), made.part(f"{side}_arm")
        assert part.board.names == alone.board.names
        for mine, theirs in zip(part.board.joints, alone.board.joints, strict=True):
            assert (mine.limits, mine.motor) == (theirs.limits, theirs.motor)

# SPDX-License-Identifier: Apache-2.0
"""Couplings declared in a parameter file (SPEC Y3), and refusals of bad ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from marks import needs_icub
from parameter_files import refusal, written

from control_board_ros.description.robots import SHIPPED
from control_board_ros.node.wiring.transforms import frames_of
from control_board_ros.settings.loading import load

HAND = str(SHIPPED / "icub_left_hand.urdf")
START = f"robot: {HAND}\n"
INDEX = """\
couplings:
  index:
    axes: [index]
    joints: [l_hand_index_2_joint, l_hand_index_3_joint]
    matrix: [0.5, 0.5]
"""


def test_an_axis_is_in_place_of_its_joints(tmp_path: Path) -> None:
    """Y3: it is a joint of the board; limits are as far as those of the physical joints let it."""
    made = load(written(tmp_path, START + INDEX))
    names = made.board.names
    assert "index" in names
    assert len(names) == 19
    assert not {"l_hand_index_2_joint", "l_hand_index_3_joint"} & set(names)
    own = made.board.joints[names.index("index")].limits
    assert (own.hard_lower, own.hard_upper) == pytest.approx((0.0, np.pi), abs=1e-5)
    assert own.velocity == pytest.approx(7.0)
    coupling = made.board.coupling
    assert coupling is not None
    assert coupling is made.physical
    assert len(coupling.physical_joints) == 20
    axes = np.zeros(19)
    axes[names.index("index")] = 1.0
    where = dict(zip(coupling.physical_joints, coupling.positions(axes), strict=True))
    assert {name for name, at in where.items() if at} == {
        "l_hand_index_2_joint",
        "l_hand_index_3_joint",
    }
    assert made.values["couplings.index.matrix"] == [0.5, 0.5]


def test_a_later_file_changes_and_removes_couplings(tmp_path: Path) -> None:
    """Y3: key by key; without axes there is no coupling."""
    path = written(tmp_path, START + INDEX)
    other = load(path, {"couplings.index.matrix": [0.4, 0.6]})
    assert other.board.coupling is not None
    assert 0.6 in other.board.coupling.matrix
    assert load(path, {"couplings.index.axes": []}).board.coupling is None


def test_a_prefix_is_that_of_axes_too(tmp_path: Path) -> None:
    """Y3: two hands of one file side by side."""
    made = load(written(tmp_path, START + INDEX + "index.home: 0.3\n"), {"joint_prefix": "b_"})
    assert "b_index" in made.board.names
    assert made.values["b_index.home"] == 0.3


MOTORS = """\
robot: iiwa
joints: [lbr_iiwa_joint_1, lbr_iiwa_joint_2, lbr_iiwa_joint_3]
couplings:
  shoulder:
    axes: [lbr_iiwa_joint_1, lbr_iiwa_joint_2]
    motor_matrix: [1.0, 0.0, -1.5, 1.5]
"""


def test_motors_are_coupled_by_a_matrix_of_their_own(tmp_path: Path) -> None:
    """Y3: the axes are physical joints then; others have their own motors."""
    made = load(written(tmp_path, MOTORS))
    assert made.board.coupling is None
    assert made.physical is None
    motors = made.board.motor_coupling
    assert motors is not None
    assert motors.matrix.tolist() == [[1, 0, 0], [-1.5, 1.5, 0], [0, 0, 1]]


TWO = (
    INDEX
    + """\
  more:
    axes: [more]
    joints: [l_hand_index_3_joint]
    matrix: [1.0]
"""
)
BOTH = INDEX.replace("[index]", "[a, b]").replace("0.5, 0.5", "1.0, 1.0, 1.0, -1.0")
LENGTHS = "ground=36, crank=12, coupler=30, rocker=14"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (INDEX.replace("[0.5, 0.5]", "[0.5]"), ["index.matrix", "2 numbers", "it has 1"]),
        (INDEX.replace("[0.5, 0.5]", "[0.5, 0.0]"), ["not all zeros for l_hand_index_3_joint"]),
        (
            INDEX.replace("[index]", "[a, b]").replace("0.5, 0.5", "1.0, 1.0, 1.0, 1.0"),
            ["singular"],
        ),
        (TWO, ["more.joints", "l_hand_index_3_joint in one coupling; index has it"]),
        (INDEX.replace("index_3_joint", "index_9_joint"), ["robot, not", "mean 'l_hand_index_"]),
        (INDEX.replace("[index]", "[l_hand_ring_1_joint]"), ["another name for the axis"]),
        (INDEX.replace("matrix", "matrx"), ["did you mean 'matrix'"]),
        (INDEX + '    functions: ["", "five_bar(a=1)"]\n', ["functions", "four_bar(ground=…"]),
        (INDEX + '    functions: ["", "four_bar(ground=1)"]\n', ["a number each"]),
        (INDEX + f'    functions: ["", "four_bar({LENGTHS}, zero=x)"]\n', ["a number each"]),
        (INDEX + f'    functions: ["", "four_bar(-{LENGTHS}, zero=0)"]\n', ["four_bar"]),
        (INDEX + '    functions: [""]\n', ["2 functions, one for each joint"]),
        (INDEX + "    offsets: [0.1]\n", ["2 offsets, one for each joint"]),
        (
            INDEX + f'    functions: ["", "four_bar({LENGTHS}, zero=0.9)"]\n',
            ["links of l_hand_index_3_joint reach each other"],
        ),
        (INDEX + "index.gravity_compensation: true\n", ["false for an axis of a coupling"]),
        (
            INDEX + "index.limits.hard_upper: 3.5\nindex.limits.upper: 3.4\n",
            ["hard_upper", "keeps l_hand_index_2_joint within 0…1.571", "to 1.75"],
        ),
    ],
)
def test_bad_couplings(tmp_path: Path, text: str, expected: list[str]) -> None:
    """Y3: each is refused in a line: where, what, what is allowed."""
    refused = refusal(written(tmp_path, START + text))
    for part in expected:
        assert part in refused


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (MOTORS.replace("-1.5, 1.5", "2.0, 0.0"), "singular"),
        (MOTORS.replace(", -1.5, 1.5", ""), "4 numbers"),
        (
            MOTORS.replace(
                "axes: [lbr_iiwa_joint_1, lbr_iiwa_joint_2]", "axes: [x, lbr_iiwa_joint_2]"
            ),
            "not 'x'",
        ),
        (
            MOTORS.replace("joint_2, lbr_iiwa_joint_3]\n", "joint_3]\n", 1),
            "all axes of couplings.shoulder, or none; lbr_iiwa_joint_2 is missing",
        ),
        (MOTORS + "lbr_iiwa_joint_2.brake.present: true\n", "motors are coupled"),
        (MOTORS + "lbr_iiwa_joint_2.drive: [torque]\n", "motors are coupled"),
        (
            MOTORS + "  again: {axes: [lbr_iiwa_joint_2], motor_matrix: [1.0]}\n",
            "lbr_iiwa_joint_2 in one coupling of motors",
        ),
    ],
)
def test_bad_couplings_of_motors(tmp_path: Path, text: str, expected: str) -> None:
    """Y3: likewise."""
    assert expected in refusal(written(tmp_path, text))


def test_axes_of_one_coupling_are_on_one_board(tmp_path: Path) -> None:
    """Y3: some of them alone cannot be driven."""
    text, limits = START + BOTH, "a.limits: {hard_lower: 0.4, hard_upper: 0.8}\n"
    limits += "b.limits: {hard_lower: -0.2, hard_upper: 0.2}\n"
    assert set(load(written(tmp_path, text + limits)).board.names) >= {"a", "b"}
    refused = refusal(written(tmp_path, text + limits + "joints: [a, l_hand_ring_1_joint]\n"))
    assert "all axes of the coupling index, or none; b is missing" in refused


@pytest.mark.slow
@needs_icub
def test_the_whole_icub_with_hands() -> None:
    """Y3: 53 axes, 75 physical joints, and the three motors of each shoulder."""
    made = load("icub_hands")
    assert len(made.board.names) == 53
    assert made.physical is not None
    assert len(made.physical.physical_joints) == 75
    assert not made.warnings
    assert [len(made.parts[name]) for name in ("head", "left_arm", "right_arm")] == [6, 16, 16]
    arm = made.part("left_arm")
    assert arm.physical is not None
    assert len(arm.physical.physical_joints) == 27
    assert arm.board.motor_coupling is not None
    assert made.part("torso").physical is None
    assert made.part("torso").board.motor_coupling is None
    shoulder = arm.board.motor_coupling.matrix[:3, :3]
    share = 40 / 65  # of iCubGenova04, matrixM2J in robotology/robots-configuration
    axes_by_motors = [[1.0, 0.0, 0.0], [1.0, share, 0.0], [0.0, -share, share]]
    np.testing.assert_allclose(shoulder @ axes_by_motors, np.eye(3), atol=1e-12)
    assert "couplings.l_pinky.axes" in arm.values
    assert "couplings.r_pinky.axes" not in arm.values


@needs_icub
def test_the_mk3_hand_has_the_ranges_of_its_joints() -> None:
    """Y3: 7 axes and 11 joints; a finger's axis goes as far as both of its joints together."""
    made = load("icub_hand_mk3")
    assert len(made.board.names) == 7
    assert made.physical is not None
    assert len(made.physical.physical_joints) == 11
    limits = {joint.name: joint.limits.hard_upper for joint in made.board.joints}
    assert np.degrees(limits["l_index"]) == pytest.approx(200.3, abs=0.1)
    assert np.degrees(limits["l_thumb"]) == pytest.approx(140.0, abs=0.1)


def test_frames_of_links_follow_the_axes(tmp_path: Path) -> None:
    """Y3: /tf has every link of a finger turned by its joint, not by the axis."""
    made = load(written(tmp_path, START + INDEX))
    frames = frames_of(made.urdf, made.board.names)
    assert len(frames.moving) == 20
    at = np.zeros(19)
    at[made.board.names.index("index")] = 1.0
    turned = frames.poses(at) - frames.poses(np.zeros(19))
    moved = {edge.child for edge, way in zip(frames.moving, turned, strict=True) if way.any()}
    assert moved == {"l_hand_index_2", "l_hand_index_3"}
    for edge, pose in zip(frames.moving, frames.poses(at), strict=True):
        if edge.child in moved:
            assert 2.0 * np.arccos(pose[6]) == pytest.approx(0.5)

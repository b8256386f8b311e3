# SPDX-License-Identifier: Apache-2.0
"""The named robots, and any other one by its path."""

from __future__ import annotations

from pathlib import Path

import pytest
from iiwa import JOINTS
from marks import needs_icub

from control_board_ros.description import robots
from control_board_ros.description.geometry import origin_of
from control_board_ros.description.merge import inertial_of
from control_board_ros.description.robots import ROBOTS, load_robot
from control_board_ros.description.urdf import Urdf, UrdfError
from control_board_ros.settings.loading import load


def test_iiwa() -> None:
    made = load_robot("iiwa")
    assert made.independent == JOINTS
    assert made.warnings == ()
    assert made.joints[1].effort == 300.0


def test_panda_has_one_finger_to_drive() -> None:
    made = load_robot("panda")
    assert made.independent == (*(f"panda_joint{i}" for i in range(1, 8)), "panda_finger_joint1")
    assert made.mimics["panda_finger_joint2"].leader == "panda_finger_joint1"
    assert made.warnings == ()


@needs_icub
@pytest.mark.parametrize(("name", "side"), [("icub_left_arm", "l"), ("icub_right_arm", "r")])
def test_icub_arms_are_cut_out_of_the_robot(name: str, side: str) -> None:
    made = load_robot(name)
    words = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")
    words += ("wrist_prosup", "wrist_pitch", "wrist_yaw")
    assert made.independent == tuple(f"{side}_{word}" for word in words)
    text = made.description
    assert "neck" not in text
    assert 'name="chest_mount" type="fixed"' in text  # the chest is oriented as in the robot
    assert f"{side}_upper_arm" in text  # behind the fixed force sensor
    assert made.warnings == ()


def test_missing_extra_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(robots, "share_folders", lambda: [tmp_path])
    with pytest.raises(UrdfError, match=r"pip install 'control_board_ros\[icub\]'"):
        load_robot("icub_left_arm")


def numbers(robot: Urdf) -> dict[str, object]:
    """What moves: joints with their frames, and masses with theirs; no shapes."""
    found: dict[str, object] = {joint.name: joint for joint in robot.joints}
    for joint in robot.tree.joints.values():
        position, rotation = origin_of(joint)
        found["frame of " + joint.get("name", "")] = [*position, *rotation.ravel()]
    for name, link in robot.tree.links.items():
        if (inertial := inertial_of(link)) is not None:
            moments = inertial.tensor.ravel()
            found["mass of " + name] = [inertial.mass, *inertial.centre, *moments]
    return found


@pytest.mark.parametrize("name", ["iiwa", "panda"])
def test_without_pybullet_data_the_same_arm_is_plain(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Python from 3.12 on: joints, frames and masses are the same, number by number."""
    with_meshes = numbers(load_robot(name))
    monkeypatch.setattr(robots, "package_folder", lambda _: None)
    plain = load_robot(name)
    assert Path(plain.source).parent == robots.SHIPPED
    assert plain.warnings == ()
    assert numbers(plain) == with_meshes
    assert plain.tree.root.findall(".//collision/geometry/cylinder")


def test_a_path_beside_the_configuration(tmp_path: Path) -> None:
    source = ROBOTS["iiwa"].path()
    (tmp_path / "arm.urdf").write_text(source.read_text())
    assert load_robot("arm.urdf", tmp_path).name == "lbr_iiwa"
    assert load_robot(str(tmp_path / "arm.urdf")).name == "lbr_iiwa"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("iwa", "did you mean 'iiwa'"),
        ("", "known: iiwa"),
        ("none.urdf", "No such file"),
        ("~nobody-of-that-name/x.urdf", "r.urdf|cannot|No such"),
        ("a\0b.urdf", "null byte"),
        ("/dev/zero", "regular"),
    ],
)
def test_unknown_robots(name: str, words: str) -> None:
    with pytest.raises(UrdfError, match=words) as caught:
        load_robot(name)
    assert "\n" not in str(caught.value)


def test_who_drives_a_real_panda_is_told_of_its_masses() -> None:
    """A simulated one has the masses of its URDF, and says nothing."""
    real = load("panda", {"plant": "somebodys"})
    assert any("not those of a real Panda" in line for line in real.warnings)
    pair = load("panda_pair", {"plant": "somebodys"})
    assert any("need cbctl identify" in line for line in pair.warnings)
    for quiet in ({}, {"plant": "virtual/moteus"}):
        assert not any("real Panda" in line for line in load("panda", quiet).warnings)
    assert not any("real" in line for line in load("iiwa", {"plant": "somebodys"}).warnings)

# SPDX-License-Identifier: Apache-2.0
"""R5: poses in parameter files, and those that a user saves."""

from __future__ import annotations

import fcntl
import math
import os
from pathlib import Path

import pytest
from iiwa import JOINTS

from control_board_ros.core.goals.pose import HOME, PARK, Pose
from control_board_ros.core.selection import RequestError
from control_board_ros.description.meshes import above
from control_board_ros.settings.loading import load
from control_board_ros.settings.params_file import SettingsError
from control_board_ros.settings.poses import MAX_POSES, UserPoses, pose_file

ROBOTS = ("iiwa", "panda", "panda_pair", "iiwa_gripper", "icub_left_arm", "icub_right_arm", "icub")
ARM = str(Path(__file__).parents[1] / "support" / "arm.urdf")


@pytest.mark.parametrize("robot", ROBOTS)
def test_every_shipped_robot_has_home_and_park(robot: str) -> None:
    """R5: home is where it starts; park is elsewhere, for all joints, within all limits."""
    settings = load(robot)
    home, park = settings.poses[HOME], settings.poses[PARK]
    assert settings.warnings == ()
    assert home.joints == park.joints == settings.board.names
    assert home.positions == tuple(settings.values[f"{name}.home"] for name in home.joints)
    assert home.positions != park.positions
    assert park.speed > 0.0
    for joint, position in zip(settings.board.joints, park.positions, strict=True):
        assert joint.limits.lower <= position <= joint.limits.upper


def test_a_foreign_robot_has_both_of_its_homes() -> None:
    """Park is home unless it is given; both keep within the limits."""
    settings = load(None, {"robot": ARM})
    name = settings.board.names[0]
    moved = load(None, {"robot": ARM, f"{name}.home": 0.2})
    assert moved.poses[HOME].positions[0] == 0.2
    assert moved.poses[PARK].positions == moved.poses[HOME].positions
    only = load(None, {"robot": ARM, f"poses.park.{name}": 0.1, "poses.park.speed": 0.3})
    assert only.poses[PARK] == Pose(PARK, (name,), (0.1,), 0.3)


def test_poses_of_files() -> None:
    """A later layer adds poses and changes single joints; parameters show what is in force."""
    settings = load("iiwa", {f"poses.wave.{JOINTS[3]}": -1, f"poses.park.{JOINTS[0]}": 0.5})
    assert list(settings.poses) == [HOME, PARK, "wave"]
    assert settings.poses["wave"] == Pose("wave", (JOINTS[3],), (-1.0,))
    assert settings.poses[PARK].positions == (0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert settings.values[f"poses.wave.{JOINTS[3]}"] == -1.0
    assert settings.values["poses.park.speed"] == 0.35


def test_a_board_of_some_joints_has_the_poses_of_these() -> None:
    """Positions of joints that the board does not have are ignored."""
    settings = load("iiwa", {"joints": [*JOINTS[2:4]], f"poses.other.{JOINTS[0]}": 0.1})
    assert settings.poses[PARK].joints == (JOINTS[2], JOINTS[3])
    assert list(settings.poses) == [HOME, PARK]


def test_a_pose_beyond_the_limits_is_cut_with_a_warning() -> None:
    """Limits may be narrower than where the pose was made for: the board starts."""
    settings = load("iiwa", {f"{JOINTS[1]}.limits.lower": 0.2})
    assert settings.poses[PARK].positions[1] == 0.2
    (warning,) = settings.warnings
    assert f"poses.park.{JOINTS[1]}: 0 is outside the limits of the joint; 0.2 is used" in warning


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("poses.park.elbow", 0.0, r"no such parameter"),
        ("poses.park.lbr_iiwa_joint_9", 0.0, r"did you mean 'poses\.park\.lbr_iiwa_joint_\d'"),
        (f"poses.park.{JOINTS[0]}", "up", "use a number"),
        ("poses.park.speed", -1.0, "use a number of at least 0"),
        ("poses.a-b.speed", 1.0, "no such parameter"),
        ("poses.wave.speed", 1.0, r"poses\.wave: names no joint; add poses\.wave\.<joint>"),
    ],
)
def test_wrong_poses_end_the_start_with_one_line(name: str, value: object, text: str) -> None:
    with pytest.raises(SettingsError, match=text) as caught:
        load("iiwa", {name: value})
    assert "\n" not in str(caught.value)


# -- the user's file --------------------------------------------------------------------------


@pytest.fixture
def user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> UserPoses:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    return UserPoses("arm")


def test_poses_are_saved_below_the_users_folder(user: UserPoses, tmp_path: Path) -> None:
    """XDG; whole, in order, replaced by name; a number comes back as it was."""
    assert user.path == tmp_path / "control_board_ros" / "poses" / "arm.yaml"
    assert user.read() == {}
    wave = Pose("wave", ("a", "b"), (0.1, 1e-17), 0.25)
    user.save(wave)
    user.save(Pose("yes", ("a",), (1.0,)))
    assert user.save(Pose("yes", ("a",), (2.0,))) == user.read()
    assert user.read() == {"wave": wave, "yes": Pose("yes", ("a",), (2.0,))}
    assert [path.name for path in user.path.parent.iterdir() if path.name[0] != "."] == [
        "arm.yaml"
    ]
    assert user.path.read_text().startswith("# Poses of arm")


def test_boards_of_one_robot_share_a_pose(user: UserPoses) -> None:
    """R1: each saves its own joints, all of them; those of the others stay."""
    left, right = ("l_a", "l_b"), ("r_a", "r_b")
    user.save(Pose("ready", left, (0.1, 0.2), 0.3), left)
    user.save(Pose("ready", right, (0.3, 0.4), 0.5), right)
    assert user.read()["ready"] == Pose("ready", left + right, (0.1, 0.2, 0.3, 0.4), 0.5)
    user.save(Pose("ready", ("l_b",), (0.7,)), left)
    both = user.read()["ready"]
    assert both == Pose("ready", (*right, "l_b"), (0.3, 0.4, 0.7))
    assert both.of(left) == Pose("ready", ("l_b",), (0.7,))


def test_a_robots_name_is_no_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert pose_file("../../x y").parent == tmp_path / "control_board_ros" / "poses"
    assert pose_file("..").name == "%2E..yaml"
    monkeypatch.delenv("XDG_CONFIG_HOME")
    monkeypatch.setenv("HOME", "/home/somebody")
    assert pose_file("r") == Path("/home/somebody/.config/control_board_ros/poses/r.yaml")


def test_robots_of_any_script_have_files_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What 1.0.0 saved in a file of several robots is found until a pose is saved."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    robots = ("ü", "臂", "_", "a b", "a_b", "a/b", ".a", "a", "")
    assert len({pose_file(robot) for robot in robots}) == len(robots)
    old = Pose("old", ("elbow",), (0.1,))
    UserPoses("_").save(old)  # by 1.0.0: for 臂 and ü
    assert UserPoses("臂").read() == {"old": old}
    UserPoses("臂").save(Pose("new", ("elbow",), (0.2,)))
    assert list(UserPoses("臂").read()) == ["old", "new"]
    assert list(UserPoses("ü").read()) == ["old"]


def test_a_user_without_a_home_has_no_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a container that runs as a number: the board starts."""
    for name in ("XDG_CONFIG_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os, "getuid", lambda: 54321)
    assert UserPoses("r").read() == {}
    assert above(Path("/tmp/x"), "x") is None


BROKEN = {
    "wave: {positions: {a: 0.1}": "not YAML",
    "- wave\n": "is no mapping; write NAME:",
    "wave: 3\n": ":1: wave: is no pose",
    "\nwave: {speed: 1.0}\n": ":2: wave: has no positions",
    "wave: {positions: {a: up}}\n": "wave.positions.a: 'up' is no number",
    "wave: {positions: {a: .nan}}\n": "wave.positions.a: nan is no number",
    "wave: {positions: {a: [1]}}\n": "is no number",
    "wave: {positions: {a: 1}, speed: -1}\n": "wave.speed: -1 is below 0",
    "wave: {positions: {a: 1}, speed: 1.0e+9}\n": "1000000000.0 is no number below 1e+09",
    "wave: {positions: {a: 1}, sped: 1}\n": "is no pose",
    "a b: {positions: {a: 1}}\n": "is no name",
    "wave: !!python/name:os.system {}\n": "tag",
}


@pytest.mark.parametrize("text", BROKEN)
def test_a_broken_file_is_reported_and_never_overwritten(user: UserPoses, text: str) -> None:
    """One line with the place; saving loses nothing of it."""
    user.path.parent.mkdir(parents=True)
    user.path.write_text(text)
    for act in (user.read, lambda: user.save(Pose("p", ("a",), (0.0,)))):
        with pytest.raises(RequestError) as caught:
            act()
        assert BROKEN[text] in str(caught.value)
        assert str(caught.value).startswith(str(user.path))
        assert "\n" not in str(caught.value)
    assert user.path.read_text() == text


def test_a_file_that_cannot_be_written_is_reported(user: UserPoses) -> None:
    user.path.parent.parent.mkdir()
    user.path.parent.touch()
    with pytest.raises(RequestError, match=r"cannot be written \(.*\); make the folder writable"):
        user.save(Pose("p", ("a",), (0.0,)))


def test_the_number_of_poses_is_limited(user: UserPoses) -> None:
    """A flood of requests makes no file that cannot be read again."""
    text = "".join(f"p{k}: {{positions: {{a: 0.0}}}}\n" for k in range(MAX_POSES))
    user.path.parent.mkdir(parents=True)
    user.path.write_text(text)
    user.save(Pose("p7", ("a",), (1.0,)))
    with pytest.raises(RequestError, match="holds 100 poses already"):
        user.save(Pose("one_more", ("a",), (1.0,)))
    assert len(user.read()) == MAX_POSES


@pytest.mark.parametrize(
    "pose",
    [
        Pose("bad", ("a",), (0.1,), 1e9),
        Pose("bad", ("a",), (0.1,), math.inf),
        Pose("bad", ("a",), (0.1,), -1.0),
        Pose("bad", ("a",), (-1e300,)),
        Pose("bad", ("a",), (math.nan,)),
        Pose("b a d", ("a",), (0.1,)),
        Pose("bad", (), ()),
    ],
)
def test_no_pose_is_written_that_could_not_be_read(user: UserPoses, pose: Pose) -> None:
    """What is written is read back before it replaces the old file: no pose is lost by another."""
    kept = user.save(Pose("good", ("a",), (0.5,), 1.0))
    text = user.path.read_text()
    with pytest.raises(RequestError, match=r"not saved$") as caught:
        user.save(pose)
    assert "\n" not in str(caught.value)
    assert user.path.read_text() == text
    assert user.read() == kept
    assert not [path for path in user.path.parent.iterdir() if path.name.endswith("_.yaml")]
    assert len(list(user.path.parent.iterdir())) == 2  # the file and its lock


def test_a_lock_of_another_program_is_awaited_briefly_and_reported(
    user: UserPoses,
) -> None:
    """No service waits for another program."""
    pose = Pose("ready", ("a",), (0.5,))
    user.save(pose)
    with (user.path.parent / f".{user.path.name}.lock").open("w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(RequestError, match="another program is saving poses") as caught:
            user.save(Pose("other", ("a",), (0.1,)))
        assert "\n" not in str(caught.value)
    assert set(user.read()) == {"ready"}
    assert set(user.save(Pose("other", ("a",), (0.1,)))) == {"ready", "other"}

# SPDX-License-Identifier: Apache-2.0
"""R5: poses are listed, saved and started by the services' own callbacks."""

from __future__ import annotations

import contextlib
from types import SimpleNamespace
from typing import Any

import pytest
from control_board_msgs.srv import ListPoses, SavePose
from rig import Rig, board_config, joint

from control_board_ros.core.goals.pose import Pose
from control_board_ros.core.selection import RequestError
from control_board_ros.node.wiring.messages import filled
from control_board_ros.operations import Poses
from control_board_ros.settings.poses import UserPoses

CONFIGURED = {
    name: Pose(name, ("a", "b"), positions)
    for name, positions in (("home", (0.0, 0.5)), ("park", (0.0, 0.0)))
}


class Asked:
    """The poses of a board of two joints in POSITION, of which the plant starts in home."""

    def __init__(self) -> None:
        self.rig = Rig(board_config(joint("a"), joint("b")), home=[0.0, 0.5])
        self.rig.tick(2)
        assert self.rig.board.set_control_mode(None, "pos")
        board = self.rig.board
        self.user = UserPoses("arm")
        self.poses = Poses(
            board, lambda: contextlib.nullcontext(board), lambda: CONFIGURED, self.user
        )

    def list(self, **request: Any) -> Any:
        fields = self.poses.list_poses(ListPoses.Request(**request))
        return filled(ListPoses.Response(), fields)

    def save(self, **request: Any) -> Any:
        return filled(SavePose.Response(), self.poses.save_pose(SavePose.Request(**request)))


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> Asked:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    return Asked()


def test_poses_are_listed_and_saved(asked: Asked) -> None:
    """The configuration's, then the user's; as measured, or as given; in the user's file."""
    listed = asked.list()
    assert (listed.success, list(listed.poses), list(listed.names)) == (True, ["home", "park"], [])
    home = asked.list(name="home")
    assert (list(home.names), list(home.positions)) == (["a", "b"], [0.0, 0.5])
    saved = asked.save(name="here", speed=0.5)
    assert (saved.success, list(saved.poses)) == (True, ["home", "park", "here"])
    assert saved.message == f"saved in {asked.user.path}"
    here = asked.list(name="here")
    assert (list(here.positions), here.speed) == (pytest.approx([0.0, 0.5], abs=0.02), 0.5)
    assert asked.save(name="turned", names=["b"], positions=[0.4], speed=1.0).success
    turned = asked.list(name="turned")
    assert (list(turned.names), list(turned.positions), turned.speed) == (["b"], [0.4], 1.0)


def test_a_saved_pose_is_a_goal(asked: Asked) -> None:
    """At the goal's own speed, or the pose's."""
    assert asked.save(name="turned", names=["b"], positions=[1.5], speed=1.0).success
    for speed, time in ((0.0, 1.0), (0.5, 2.0)):
        begin = asked.poses.move(SimpleNamespace(pose="turned", speed=speed))
        assert begin(asked.rig.board).remaining_time() == pytest.approx(time, rel=0.02)
    unknown = r"pose 'prak' unknown; did you mean 'park'\?; poses: home, park, turned"
    with pytest.raises(RequestError, match=unknown):
        asked.poses.move(SimpleNamespace(pose="prak", speed=0.0))


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        ({"name": "home"}, "pose 'home' is one of the configuration"),
        ({"name": "../up"}, "is no name"),
        ({"name": "p", "names": ["elbow"]}, "'elbow' unknown"),
        ({"name": "p", "positions": [0.0] * 3}, "3 positions for 2 joints"),
        ({"name": "p", "positions": [0.0, 9.0]}, "outside its limits"),
        ({"name": "p", "speed": 1e9}, "speed 1e\\+09 is not valid; above 0 and below 1e\\+09"),
        ({"name": "p", "speed": float("nan")}, "speed nan is not valid"),
    ],
)
def test_a_pose_that_is_wrong_is_not_saved(
    asked: Asked, request_: dict[str, Any], text: str
) -> None:
    with pytest.raises(RequestError, match=text):
        asked.save(**request_)
    assert list(asked.list().poses) == ["home", "park"]


def test_a_broken_pose_file_is_reported(asked: Asked) -> None:
    """Those of the configuration are there all the same."""
    asked.user.path.parent.mkdir(parents=True)
    asked.user.path.write_text("wave: 3\n")
    listed = asked.list()
    assert (listed.success, list(listed.poses)) == (False, ["home", "park"])
    assert listed.message.startswith(f"{asked.user.path}:1: wave: is no pose")
    assert asked.poses.move(SimpleNamespace(pose="home", speed=1.0))


def test_a_pose_of_other_joints_names_them(asked: Asked) -> None:
    """R1: saved by another board of the robot."""
    asked.user.save(Pose("up", ("c",), (0.0,)))
    with pytest.raises(RequestError, match=r"pose 'up' in .* is of other joints, c; "):
        asked.poses.move(SimpleNamespace(pose="up", speed=0.0))
    assert list(asked.list().poses) == ["home", "park"]

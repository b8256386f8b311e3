# SPDX-License-Identifier: Apache-2.0
"""What a board publishes as its description is a stranger's: read within bounds, or not at all."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from control_board_ros.client import BoardError
from control_board_ros.conformance.limits import SPEED, TORQUE, read_limits
from control_board_ros.panel.robot import NO_ROBOT, read
from control_board_ros.recording.reading import kinds_of
from control_board_ros.urdf_xml import UrdfError, published_joints, published_robot

BOMB = (
    '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
    '<robot name="&b;"><joint name="j" type="prismatic"/></robot>'
)
BAD = {
    "entities": BOMB,
    "doctype": '<!DOCTYPE robot><robot><joint name="j" type="prismatic"/></robot>',
    "deep": "<robot>" + "<link>" * 100 + "</link>" * 100 + '<joint name="j"/></robot>',
    "no xml": "robot",
    "empty": "",
    "half": '<robot><joint name="j" type="prismatic"/>',
    "many": "<robot>" + "<link/>" * 200_001 + "</robot>",
    "zeros": "\0" * 10,
}


def board(urdf: str) -> Any:
    """A client of a board with a description."""

    def get_joint_limits(_: str) -> Any:
        raise BoardError("it does not offer get_limits")

    return SimpleNamespace(get_robot_description=lambda: urdf, get_joint_limits=get_joint_limits)


@pytest.mark.parametrize("urdf", BAD.values(), ids=BAD)
def test_a_bad_description_is_refused_by_every_reader(urdf: str) -> None:
    with pytest.raises(UrdfError):
        published_robot(urdf)
    assert published_joints(urdf) == {}
    assert kinds_of(urdf, ("j",)) == {"j": "revolute"}
    assert read(urdf, "") is NO_ROBOT
    found = read_limits(board(urdf), "j")
    ends = found.lower, found.upper
    assert (*ends, found.velocity, found.torque) == (-math.inf, math.inf, SPEED, TORQUE)


def test_joints_keep_the_readable_limits() -> None:
    joint = '<joint name="{}" type="{}"><limit {}/></joint>'
    joints = published_joints(
        "<robot>"
        + joint.format("a", "revolute", 'lower="-1" upper="2" velocity="3" effort="4"')
        + joint.format("b", "continuous", 'lower="-1" upper="2" velocity="nan"')
        + joint.format("c", "prismatic", 'lower="wide" upper="2" effort="much"')
        + joint.format("d", "revolute", 'upper="2"')
        + '<joint name="e"/></robot>'
    )
    ends = {name: (one.lower, one.upper) for name, one in joints.items()}
    none = (-math.inf, math.inf)
    assert ends == {"a": (-1.0, 2.0), "b": none, "c": none, "d": (0.0, 2.0), "e": none}
    assert [(one.velocity, one.effort) for one in joints.values()] == [
        (3.0, 4.0),
        *[(None, None)] * 4,
    ]


def test_limits_that_a_description_gives() -> None:
    urdf = (
        '<robot><joint name="a\'b" type="revolute"><limit lower="-1" upper="2"/></joint></robot>'
    )
    found = read_limits(board(urdf), "a'b")
    assert (found.lower, found.upper, found.velocity) == (-1.0, 2.0, SPEED)


def test_a_text_is_what_it_is_whatever_encoding_it_declares() -> None:
    urdf = '<?xml version="1.0" encoding="iso-8859-1"?><robot><joint name="ö"/></robot>'
    assert list(published_joints(urdf)) == ["ö"]

# SPDX-License-Identifier: Apache-2.0
"""YARP's clients on a running board: names, answers, and the way that cb_hw_fw_pos drives it."""

from __future__ import annotations

from typing import Any

import pytest
from control_board_msgs.srv import GetReferences
from std_msgs.msg import Int8MultiArray, Int32MultiArray
from talk import Talker
from waiting import GUARD, until
from yarp_control_msgs import msg, srv

from control_board_ros.interface import (
    CLOCK,
    COMMAND_TOPICS,
    PUBLISHED,
    SERVICES,
    TF,
    TF_STATIC,
    YARP,
)
from control_board_ros.recording.topics import topics_for_yarp

BASE = "/icub/left_arm"
KINDS = {
    "get_modes": srv.GetControlModes,
    "set_modes": srv.SetControlModes,
    "get_position": srv.GetPosition,
    "get_velocity": srv.GetVelocity,
    "get_available_modes": srv.GetAvailableControlModes,
    "get_joints_names": srv.GetJointsNames,
}
ARRIVED = 2e-3  # rad


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    """As there, a name without a slash in front gets one."""
    return {
        "yarp_interface": True,
        "yarp_msgs_name": BASE.removeprefix("/"),
        "control_rate": 250.0,
    }


class YarpClient:
    """Knows only what is below msgs_name, as a program of YARP's users does."""

    def __init__(self, talker: Talker) -> None:
        self._talker, self._node = talker, talker.node
        self._clients = {
            name: self._node.create_client(kind, f"{BASE}/{name}") for name, kind in KINDS.items()
        }
        self._publishers: dict[str, Any] = {}

    def call(self, name: str, **request: Any) -> Any:
        client = self._clients[name]
        assert client.wait_for_service(GUARD), f"no service {name}"
        return self._talker.answer(client.call_async(KINDS[name].Request(**request)))

    def send(self, name: str, message: Any) -> None:
        if name not in self._publishers:
            made = self._node.create_publisher(type(message), f"{BASE}/{name}", 10)
            self._publishers[name] = made
            until(lambda: made.get_subscription_count() > 0)
        self._publishers[name].publish(message)


@pytest.fixture(scope="module")
def yarp(peer: Talker) -> YarpClient:
    return YarpClient(peer)


@pytest.fixture(autouse=True)
def at_rest(talker: Talker) -> None:
    """Every test begins with all joints in POSITION, at their first pose."""


def near(yarp: YarpClient, names: list[str], target: list[float]) -> bool:
    """Whether joints have reached their targets, by get_position."""
    found = yarp.call("get_position", names=names)
    assert found.response == "OK"
    pairs = zip(found.positions, target, strict=True)
    return all(abs(position - wanted) < ARRIVED for position, wanted in pairs)


def test_names_and_types(talker: Talker) -> None:
    """Beside the board's own, which are as ever."""
    node, board = talker.node, ("control_board", "/")
    until(lambda: board in node.get_node_names_and_namespaces())
    there = {
        name: kinds
        for found in (
            node.get_publisher_names_and_types_by_node(*board),
            node.get_subscriber_names_and_types_by_node(*board),
            node.get_service_names_and_types_by_node(*board),
        )
        for name, kinds in found
    }
    own = {*PUBLISHED, *COMMAND_TOPICS, *SERVICES} - {CLOCK, TF, TF_STATIC}
    assert {endpoint.of("/control_board") for endpoint in own} <= there.keys()
    for endpoint in YARP:  # its readings are in the board's namespace
        below = BASE if endpoint.name.startswith("~") else "/control_board"
        assert there[endpoint.of(below)] == [endpoint.type]


def test_recordings_hold_the_commands_of_yarp_s_clients(talker: Talker) -> None:
    """Whatever they are called here."""
    found = topics_for_yarp(talker.node, ["/control_board", "/gone/board"])
    assert {topic.name: topic.type for topic in found} == {
        row.of(BASE): row.type for row in YARP if row.kind == "command"
    }


def test_it_is_driven_as_cb_hw_fw_pos_does(yarp: YarpClient, talker: Talker) -> None:
    """Its steps: names, modes (POSITION for every joint), positions, then Position messages.

    With continuous_pos_write the messages come with every cycle of its controllers, else once.
    """
    joints = [talker.names[3], talker.names[0]]  # as a hardware description orders them
    known = yarp.call("get_joints_names")
    assert (known.response, list(known.names)) == ("OK", talker.names)
    modes = yarp.call("get_modes", names=joints)
    assert (modes.response, list(modes.modes)) == ("OK", ["POSITION", "POSITION"])
    start = yarp.call("get_position", names=joints)
    assert start.response == "OK"
    target = [position + 0.1 for position in start.positions]
    message = msg.Position(names=joints, positions=target, ref_velocities=[1.0, 1.0])
    yarp.send("position", message)
    until(lambda: near(yarp, joints, target))

    message = msg.Position(names=joints, positions=list(start.positions))

    def back() -> bool:
        yarp.send("position", message)
        return near(yarp, joints, list(start.positions))

    until(back)
    assert set(yarp.call("get_modes").modes) == {"POSITION"}


def test_direct_positions_and_velocities(yarp: YarpClient, talker: Talker) -> None:
    """In their modes; what comes along with velocities stays set."""
    names = [talker.names[2], talker.names[4]]
    answer = yarp.call("set_modes", names=names, modes=["POSITION_DIRECT", "VELOCITY"])
    assert answer.response == "OK"
    yarp.send("position_direct", msg.PositionDirect(names=names[:1], positions=[0.02]))
    until(lambda: near(yarp, names[:1], [0.02]))
    message = msg.Velocity(names=names[1:], velocities=[0.3], ref_accelerations=[2.5])

    def turns() -> bool:
        yarp.send("velocity", message)  # until it does: velocities expire
        return bool(yarp.call("get_velocity", names=names[1:]).velocities[0] > 0.2)

    until(turns)
    read = talker.call("get_references", GetReferences, names=names[1:])
    assert list(read.accelerations) == [2.5]


def test_modes_are_published_with_the_states(yarp: YarpClient, talker: Talker) -> None:
    """First letters, as there, and whole vocabs beside them."""
    talker.subscribe("letters", Int8MultiArray, "/joint_states/controlModes")
    talker.subscribe("vocabs", Int32MultiArray, "/joint_states/controlModeVocabs")
    answer = yarp.call("set_modes", names=talker.names[:1], modes=["VELOCITY"])
    assert answer.response == "OK"
    for key, velocity, position in (("letters", ord("v"), ord("p")), ("vocabs", 7103862, 7565168)):
        message = talker.wait(key, lambda m, v=velocity: m.data[0] == v)
        assert list(message.data[1:]) == [position] * 6

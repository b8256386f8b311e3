# SPDX-License-Identifier: Apache-2.0
"""YARP's clients on a running board: names, answers, and the way that cb_hw_fw_pos drives it."""

from __future__ import annotations

from typing import Any

import pytest
from control_board_msgs.srv import GetReferences, InjectFault
from interface_table import (
    PUBLISHED,
    SERVICES,
    SUBSCRIBED,
    YARP_PUBLISHED,
    YARP_SERVICES,
    YARP_SUBSCRIBED,
)
from std_msgs.msg import Int8MultiArray, Int32MultiArray
from talk import TIMEOUT, Talker, until
from yarp_control_msgs import msg, srv

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
        "allow_fault_injection": True,
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
        assert client.wait_for_service(TIMEOUT), f"no service {name}"
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
    """Whether joints are where they shall be, as get_position tells."""
    told = yarp.call("get_position", names=names)
    assert told.response == "OK"
    pairs = zip(told.positions, target, strict=True)
    return all(abs(position - wanted) < ARRIVED for position, wanted in pairs)


def test_names_and_types(talker: Talker) -> None:
    """Beside the board's own, which are as ever."""
    node, board = talker.node, ("control_board", "/")
    until(lambda: board in node.get_node_names_and_namespaces())
    for table, yarp_table, found in (
        (PUBLISHED, YARP_PUBLISHED, node.get_publisher_names_and_types_by_node(*board)),
        (SUBSCRIBED, YARP_SUBSCRIBED, node.get_subscriber_names_and_types_by_node(*board)),
        (SERVICES, YARP_SERVICES, node.get_service_names_and_types_by_node(*board)),
    ):
        there = dict(found)
        for name in table:
            assert (
                f"/control_board{name[1:]}" if name[0] == "~" else "/" + name.strip("/")
            ) in there
        for name, row in yarp_table.items():
            kind = row if isinstance(row, str) else row[0]
            assert there[BASE + name[1:] if name[0] == "~" else f"/{name}"] == [kind]


def test_recordings_hold_the_commands_of_yarp_s_clients(talker: Talker) -> None:
    """Whatever they are called here."""
    found = topics_for_yarp(talker.node, ["/control_board", "/gone/board"])
    assert {topic.name: topic.type for topic in found} == {
        BASE + name[1:]: kind for name, (kind, _) in YARP_SUBSCRIBED.items()
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


def test_modes_are_set_and_read(yarp: YarpClient, talker: Talker) -> None:
    """Also PWM, which is OPENLOOP here, and an impedance pair (I9)."""
    names = talker.names[:3]
    asked = ["PWM", "IMPEDANCE_POS", "IDLE"]
    answer = yarp.call("set_modes", names=names, modes=asked)
    assert (answer.response, answer.opt_descr) == ("OK", "")
    assert list(yarp.call("get_modes", names=names).modes) == ["PWM", "POSITION", "IDLE"]
    shown = talker.wait("modes", lambda m: m.control_modes[0] == "open")
    assert list(shown.interaction_modes[:2]) == ["stif", "comp"]
    listed = yarp.call("get_available_modes", only_implemented=True)
    assert list(listed.modes) == [
        "FORCE_IDLE",
        "IDLE",
        "IMPEDANCE_POS",
        "IMPEDANCE_VEL",
        "MIXED",
        "OPENLOOP",
        "POSITION",
        "POSITION_DIRECT",
        "PWM",
        "TORQUE",
        "VELOCITY",
    ]
    settable = yarp.call("get_available_modes", only_implemented=False)
    assert set(settable.modes) == {*listed.modes, "CURRENT", "VELOCITY_DIRECT"}


def test_a_fault_is_left_by_force_idle(yarp: YarpClient, talker: Talker) -> None:
    """F2, and a group that cannot be set as a whole stays as it is."""
    names = talker.names[:2]
    request = {"names": names[1:], "fault": "external"}
    assert talker.call("inject_fault", InjectFault, **request).success
    until(lambda: list(yarp.call("get_modes", names=names).modes) == ["POSITION", "HW_FAULT"])
    refused = yarp.call("set_modes", names=names, modes=["VELOCITY", "VELOCITY"])
    assert refused.response == "SET_ERROR"
    assert "send FORCE_IDLE first" in refused.opt_descr
    assert list(yarp.call("get_modes", names=names).modes) == ["POSITION", "HW_FAULT"]

    def cleared() -> bool:  # the cause lasts for 20 ms
        return yarp.call("set_modes", names=names[1:], modes=["FORCE_IDLE"]).response == "OK"

    until(cleared)
    assert yarp.call("set_modes", names=names, modes=["VELOCITY"] * 2).response == "OK"
    assert list(yarp.call("get_modes", names=names).modes) == ["VELOCITY"] * 2


@pytest.mark.parametrize(
    ("name", "request_", "word", "told"),
    [
        ("get_modes", {"names": ["elbow"]}, "NAMES_ERROR", "joint 'elbow' unknown"),
        ("get_position", {"names": ["elbow"]}, "NAMES_ERROR", "joint 'elbow' unknown"),
        ("get_velocity", {"names": ["x"] * 60_000}, "NAMES_ERROR", "joint 'x' unknown"),
        ("set_modes", {"names": ["elbow"], "modes": ["IDLE"]}, "INVALID", "'elbow' unknown"),
        ("set_modes", {"modes": ["IDLE"]}, "INVALID", "1 modes for 7 joints"),
        ("set_modes", {"modes": ["SWIM"] * 7}, "SET_ERROR", "mode 'SWIM' cannot be set"),
        ("set_modes", {"modes": ["HW_FAULT"] * 7}, "SET_ERROR", "'HW_FAULT' cannot be set"),
        ("get_joints_names", {"joint_indexes": [-1]}, "GET_NAME_ERROR", "joints are 0 to 6"),
        ("get_joints_names", {"joint_indexes": [7]}, "GET_NAME_ERROR", "index 7 out of range"),
        ("get_joints_names", {"joint_indexes": [0] * 8}, "SIZE_ERROR", "8 indices for 7 joints"),
    ],
)
def test_every_refusal_has_its_word_and_its_reason(
    yarp: YarpClient, name: str, request_: dict[str, Any], word: str, told: str
) -> None:
    """And changes nothing."""
    answer = yarp.call(name, **request_)
    assert answer.response == word
    assert told in answer.opt_descr
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
    talker.hear("letters", Int8MultiArray, "/joint_states/controlModes")
    talker.hear("vocabs", Int32MultiArray, "/joint_states/controlModeVocabs")
    answer = yarp.call("set_modes", names=talker.names[:1], modes=["VELOCITY"])
    assert answer.response == "OK"
    for key, velocity, position in (("letters", ord("v"), ord("p")), ("vocabs", 7103862, 7565168)):
        told = talker.wait(key, lambda m, v=velocity: m.data[0] == v)
        assert list(told.data[1:]) == [position] * 6


def test_no_message_ends_the_node(yarp: YarpClient, talker: Talker) -> None:
    """M4, P13: ignored and counted for the joints that are named, or for all."""
    nan, many = float("nan"), 50_000
    wrong: list[tuple[str, Any]] = [
        ("position", msg.Position(positions=[0.1])),
        ("position", msg.Position(names=["elbow"], positions=[0.1])),
        ("position", msg.Position(positions=[nan] * 7)),
        ("position", msg.Position(positions=[0.1] * 7, ref_velocities=[-1.0] * 7)),
        ("position", msg.Position(positions=[0.1] * 7, ref_velocities=[1.0])),
        ("position", msg.Position(names=["x"] * many, positions=[0.1] * many)),
        ("position_direct", msg.PositionDirect(positions=[0.1] * 7)),
        ("velocity", msg.Velocity(velocities=[0.1] * 7)),
    ]
    rest = pytest.approx(list(yarp.call("get_position").positions), abs=2e-3)
    before = talker.state(lambda s: list(s.position_reference) == rest)
    for name, message in wrong:
        yarp.send(name, message)
    # Two of them name no joint of the board.
    state = talker.state(
        lambda s: all(
            b - a == len(wrong) - 2
            for a, b in zip(before.rejected_commands, s.rejected_commands, strict=True)
        )
    )
    assert list(state.position_reference) == rest
    assert set(yarp.call("get_modes").modes) == {"POSITION"}

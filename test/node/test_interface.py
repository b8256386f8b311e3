# SPDX-License-Identifier: Apache-2.0
"""The graph of a running node, its parameters, and what it publishes."""

from __future__ import annotations

import itertools
import time
from statistics import median
from typing import Any

import pytest
from control_board_msgs import msg, srv
from qos import LATCHED
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from talk import Talker, patient, stamp_of
from waiting import until

from control_board_ros.interface import (
    ACTIONS,
    CLOCK,
    COMMAND_TOPICS,
    PUBLISHED,
    SERVICES,
    TF,
    TF_STATIC,
)

pytestmark = pytest.mark.ros

NODE = ("control_board", "/")
BOARD = "/control_board"
#: Only where simulated and real time differ, or with publish_tf.
ON_REQUEST = {CLOCK, TF, TF_STATIC}
#: What every ROS node publishes.
OF_EVERY_NODE = {"/rosout", "/parameter_events"}


def qos_of(info: Any) -> tuple[bool, bool]:
    profile = info.qos_profile
    return (
        profile.reliability is ReliabilityPolicy.RELIABLE,
        profile.durability is DurabilityPolicy.TRANSIENT_LOCAL,
    )


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    """The rates are the default ones: they are what is read and set here."""
    return {"allow_fault_injection": True}


@pytest.fixture(autouse=True)
def graph(talker: Talker) -> None:
    """The graph is known: the board's node and what belongs to it."""
    until(lambda: NODE in talker.node.get_node_names_and_namespaces())


def of_the_board(infos: list[Any]) -> Any:
    (found,) = [info for info in infos if info.node_name == NODE[0]]
    return found


def test_topics(talker: Talker) -> None:
    """Every topic of the interface, its type and QoS; and no other."""
    node = talker.node
    published = dict(node.get_publisher_names_and_types_by_node(*NODE))
    topics = {name for name in published if "/_action/" not in name} - OF_EVERY_NODE
    assert topics == {topic.of(BOARD) for topic in set(PUBLISHED) - ON_REQUEST}
    received = dict(node.get_subscriber_names_and_types_by_node(*NODE))
    assert set(received) == {topic.of(BOARD) for topic in COMMAND_TOPICS}
    for topic in {*PUBLISHED, *COMMAND_TOPICS} - ON_REQUEST:
        name = topic.of(BOARD)
        assert (published | received)[name] == [topic.type]
        found = (
            node.get_publishers_info_by_topic
            if topic in PUBLISHED
            else (node.get_subscriptions_info_by_topic)
        )
        assert qos_of(of_the_board(found(name))) == (topic.qos.reliable, topic.qos.latched), name


def test_services_and_actions(talker: Talker) -> None:
    """Each with its type; of services besides only those of parameters."""
    found = dict(talker.node.get_service_names_and_types_by_node(*NODE))
    own = {
        name: kinds[0]
        for name, kinds in found.items()
        if not kinds[0].startswith(("rcl_interfaces/", "type_description_interfaces/"))
        and "/_action/" not in name
    }
    assert own == {service.of(BOARD): service.type for service in SERVICES}
    found = dict(get_action_server_names_and_types_by_node(talker.node, *NODE))
    assert found == {action.of(BOARD): [action.type] for action in ACTIONS}


def test_command_topics_accept_qos_overrides(talker: Talker) -> None:
    """The QoS of command topics can be overridden by parameters."""
    listed = talker.call(
        "list_parameters", ListParameters, prefixes=["qos_overrides"], depth=0
    ).result.names
    for topic in COMMAND_TOPICS:
        assert f"qos_overrides.{topic.of(BOARD)}.subscription.reliability" in listed
    answer = talker.call("get_parameters", GetParameters, names=["control_rate", "robot"])
    assert answer.values[0].double_value == 1000.0
    assert answer.values[1].string_value == "iiwa"


@pytest.mark.slow
def test_parameters_change_at_run_time_all_or_nothing(talker: Talker) -> None:
    """Gains and rates change while the board runs; one wrong value changes nothing."""
    gain = f"{talker.names[0]}.position_pid.kp"
    before = talker.call("get_parameters", GetParameters, names=[gain]).values[0].double_value

    def period() -> float:
        first = stamp_of(talker.state())
        talker.state(lambda s: stamp_of(s) > first + 0.5)
        stamps = [stamp_of(s) for s in talker.seen["state"]]
        return median(b - a for a, b in itertools.pairwise(stamps) if a >= first)

    assert talker.change(**{gain: 1.1 * before, "state_rate": 20.0}).successful
    assert period() == pytest.approx(1.0 / 20.0, rel=0.15)
    wrong = talker.change(**{gain: before, "state_rate": -1.0})
    assert not wrong.successful
    assert "state_rate" in wrong.reason
    read = talker.call("get_parameters", GetParameters, names=[gain, "state_rate"]).values
    assert [value.double_value for value in read] == [pytest.approx(1.1 * before), 20.0]
    assert not talker.change(control_rate=500.0).successful
    assert talker.change(**{gain: before, "state_rate": 100.0}).successful
    assert period() == pytest.approx(1.0 / 100.0, rel=0.15)


def test_the_urdf_is_latched(talker: Talker) -> None:
    """robot_description holds the URDF also for late subscribers."""
    talker.subscribe("description", String, "/robot_description", LATCHED)
    text = talker.wait("description", lambda _: True).data
    assert all(f'"{name}"' in text for name in talker.names)
    assert "<robot" in text


def test_joint_states_are_stamped_with_system_time(talker: Talker) -> None:
    """At real time, joint_states carries the time of the reading as system time."""
    begun = time.time()
    talker.subscribe("joint_states", JointState, "/joint_states")
    message = talker.wait("joint_states", lambda _: True, fresh=True)
    assert list(message.name) == talker.names
    assert len(message.position) == len(message.velocity) == len(message.effort) == 7
    assert begun - 2.0 < stamp_of(message) < time.time()


def test_modes_of_all_and_some(talker: Talker) -> None:
    """M1: one mode for all, one per joint; ~/modes publishes each change once."""
    names = talker.names
    answer = talker.set_mode([], "POSITION_DIRECT")
    assert answer.success
    assert list(answer.names) == names
    assert list(answer.modes) == ["posd"] * 7
    answer = talker.set_mode(names[:2], "vel", "Torque")
    assert list(answer.modes) == ["vel", "torq"]
    shown = talker.wait("modes", lambda m: m.control_modes[0] == "vel")
    assert list(shown.control_modes) == ["vel", "torq"] + ["posd"] * 5
    assert list(shown.control_mode_vocabs[:2]) == [7103862, 1903325044]
    read = talker.call("get_control_mode", srv.GetControlMode, names=[names[1], names[0]])
    assert (list(read.modes), list(read.vocabs)) == (["torq", "vel"], [1903325044, 7103862])


def test_a_megabyte_of_names_is_refused_at_once(talker: Talker) -> None:
    """P1 of the promises: no message hangs the board; its first names are enough to say no."""
    answer = talker.set_mode([f"joint_{i}" for i in range(60_000)], "pos")
    assert not answer.success
    assert answer.message.startswith("joint 'joint_0' unknown")
    assert len(answer.message) < 600


def test_power_cycle_and_configure(talker: Talker) -> None:
    """N1, N2: back to power-on; the board configures itself again."""
    assert talker.set_mode(talker.names[:1], "vel").success
    talker.wait("modes", lambda m: m.control_modes[0] == "vel")
    assert talker.call("power_cycle", Trigger).success
    talker.wait("modes", lambda m: set(m.control_modes) == {"pos"})
    answer = talker.call("configure", Trigger)
    assert not answer.success
    assert "configured already" in answer.message


def test_faults_are_reported_and_cleared(talker: Talker) -> None:
    """F1, F2, F5: an injected fault shows on ~/faults and leaves by FORCE_IDLE only."""
    name, begun = talker.names[2], time.time()
    answer = talker.call("inject_fault", srv.InjectFault, names=[name], fault="external")
    assert answer.success, answer.message
    fault = talker.wait("faults", lambda f: len(f.faults) == 1).faults[0]
    assert (fault.name, fault.active, fault.code) == (name, True, 0)
    assert begun - 2.0 < fault.stamp.sec + 1e-9 * fault.stamp.nanosec < time.time()
    refused = talker.set_mode([name], "pos")
    assert not refused.success
    assert "FORCE_IDLE" in refused.message
    until(lambda: talker.set_mode([name], "fidl").success)  # the cause lasts for 20 ms
    talker.wait("faults", lambda f: not f.faults)
    last = talker.call("get_faults", srv.GetFaults, names=[name]).faults[0]
    assert (last.active, last.code, last.stamp) == (False, 0, fault.stamp)
    none = talker.call("get_faults", srv.GetFaults, names=talker.names[:1]).faults[0]
    assert (none.code, none.text, none.stamp.sec) == (-1, "no fault", 0)
    with patient(talker.node, talker.board) as client:
        assert client.get_freeze_frame(talker.names[0]) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    "qos",
    [
        QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT),
        QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        QoSProfile(depth=10, deadline=Duration(seconds=1)),
        QoSProfile(depth=10),
    ],
    ids=["best effort", "transient local", "deadline", "plain"],
)
def test_every_publisher_is_received_once(talker: Talker, qos: QoSProfile) -> None:
    """Best-effort and transient-local publishers move the arm like plain ones."""
    name = talker.names[6]
    assert talker.set_mode([name], "posd").success
    topic, talked = f"{talker.board}/command/position_direct", QoSProfile(depth=10)
    publisher = talker.node.create_publisher(msg.PositionDirectCommand, topic, qos)
    until(publisher.get_subscription_count)
    step = msg.PositionDirectCommand(names=[name], positions=[0.1])
    talker.until_state(
        lambda: publisher.publish(step), lambda s: s.position_reference[6] == pytest.approx(0.1)
    )
    # Wrong commands count once each, by whichever way they came.
    before = talker.state().rejected_commands[6]
    for count in range(1, 11):
        publisher.publish(msg.PositionDirectCommand(names=[name], positions=[float("nan")]))
        talker.command(
            "command/position_direct",
            msg.PositionDirectCommand(names=[name], positions=[float("nan")]),
            talked,
        )
        talker.state(lambda s, n=count: s.rejected_commands[6] == before + 2 * n)
    for _ in range(5):
        assert talker.state().rejected_commands[6] == before + 20
    talker.node.destroy_publisher(publisher)
    until(lambda: talker.node.count_subscribers(topic) == 1)  # that for best effort is gone


def test_a_hundred_calls_at_once_are_all_answered(talker: Talker) -> None:
    """No call is lost, and every answer is one that fits."""
    asked = [
        talker.ask("set_control_mode", srv.SetControlMode, modes=["pos" if i % 2 else "posd"])
        for i in range(200)
    ]
    for i, future in enumerate(asked):
        answer = talker.answer(future)
        assert answer.success
        assert set(answer.modes) == {"pos" if i % 2 else "posd"}
    assert talker.call("power_cycle", Trigger).success

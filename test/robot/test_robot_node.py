# SPDX-License-Identifier: Apache-2.0
"""A robot of two parts on ROS: its nodes, topics and services (SPEC R, INTERFACE)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from cbctl_process import Cbctl
from control_board_msgs import action, msg, srv
from control_msgs.action import FollowJointTrajectory
from diagnostic_msgs.msg import DiagnosticArray
from qos import LATCHED
from rcl_interfaces.srv import GetParameters
from robots import LOWER, UPPER
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from talk import Talker, stamp_of
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from waiting import until

from control_board_ros.interface import ACTIONS, COMMAND_TOPICS, SERVICES
from control_board_ros.settings.loading import load
from control_board_ros.testing import BoardProcess

pytestmark = pytest.mark.ros
NAMES = [*UPPER, *LOWER]
Talkers = dict[str, Talker]


@pytest.mark.slow
def test_every_node_has_its_names(talkers: Talkers) -> None:
    """R1: a part is a board as any other; the robot has all services, over all parts."""
    node = talkers["robot"].node

    def offered() -> tuple[set[str], set[str]]:
        services = {name for name, _ in node.get_service_names_and_types()}
        topics = {n for n, _ in node.get_topic_names_and_types() if node.count_subscribers(n)}
        return services, topics

    wanted = {e.of(f"/pair/{n}") for e in SERVICES for n in ("robot", "upper", "lower")}
    wanted |= {
        f"{e.of(f'/pair/{n}')}/_action/send_goal"
        for e in ACTIONS
        for n in ("robot", "upper", "lower")
    }
    subscribed = {e.of(f"/pair/{n}") for e in COMMAND_TOPICS for n in ("robot", "upper", "lower")}
    until(lambda: wanted <= offered()[0] and subscribed <= offered()[1])
    assert node.count_publishers("/pair/robot_description") == 1
    assert node.count_publishers("/pair/upper/robot_description") == 0


def test_readings_of_the_robot_and_of_each_part(talkers: Talkers) -> None:
    """Merged in the order of the parts; a part's below its own name; the URDF once."""
    robot = talkers["robot"]
    for key, topic in (("all", "/pair/joint_states"), ("own", "/pair/lower/joint_states")):
        robot.subscribe(key, JointState, topic)
    robot.subscribe("urdf", String, "/pair/robot_description", LATCHED)
    assert list(robot.wait("all", lambda _: True).name) == NAMES
    assert list(robot.wait("own", lambda _: True).name) == LOWER
    assert "lbr_iiwa_joint_1" in robot.wait("urdf", lambda _: True).data
    assert list(robot.state().names) == NAMES
    assert list(talkers["upper"].state().names) == UPPER


@pytest.mark.slow
def test_diagnostics_once_for_the_robot(talkers: Talkers) -> None:
    """One status for the loop, one per part, which reports the worst joint."""
    robot = talkers["robot"]
    robot.subscribe("diagnostics", DiagnosticArray, "/diagnostics")
    found = robot.wait("diagnostics", lambda d: d.status[1].message == "3 POSITION")
    assert [s.name for s in found.status] == ["pair: loop", "pair: upper", "pair: lower"]
    talkers["upper"].call("inject_fault", srv.InjectFault, names=UPPER[:1], fault="overheating")
    wrong = robot.wait("diagnostics", lambda d: d.status[1].level == b"\x02")
    assert wrong.status[1].message.startswith(f"{UPPER[0]}: HW_FAULT: overheating")
    assert wrong.status[2].level == b"\x00"


def test_a_request_over_parts(talkers: Talkers) -> None:
    """R3: answers joint by joint in the order asked, the same cycle on all parts."""
    robot = talkers["robot"]
    asked = [LOWER[1], UPPER[2], LOWER[0]]
    reply = robot.set_mode(asked, "vel", "posd", "idl")
    assert (list(reply.names), list(reply.modes)) == (asked, ["vel", "posd", "idl"])
    assert list(reply.answers) == ["accepted"] * 3
    upper = talkers["upper"].wait("modes", lambda m: m.control_modes[2] == "posd")
    lower = talkers["lower"].wait("modes", lambda m: m.control_modes[0] == "idl")
    whole = robot.wait("modes", lambda m: m.control_modes[3] == "idl")
    assert stamp_of(upper) == stamp_of(lower) == stamp_of(whole)
    assert list(whole.names) == NAMES


def test_whole_body_references_in_one_message(talkers: Talkers) -> None:
    """All parts of one message, and none of it elsewhere."""
    robot = talkers["robot"]
    assert robot.set_mode([], "posd").success
    start = list(robot.state().position_reference)
    targets = [p + 0.001 * (k + 1) for k, p in enumerate(start)]
    command = msg.PositionDirectCommand(names=NAMES, positions=targets)
    robot.until_state(
        lambda: robot.command("command/position_direct", command),
        lambda s: list(s.position_reference) == pytest.approx(targets, abs=1e-9),
    )
    assert list(robot.state().rejected_commands) == [0] * len(NAMES)


def test_a_move_over_parts(talkers: Talkers) -> None:
    """An action of the robot moves joints of both parts."""
    robot, asked = talkers["robot"], [LOWER[3], UPPER[1]]
    goal = robot.goal("move", action.Move, names=asked, positions=[-1.1, 0.8], speeds=[1.0, 1.0])
    result = robot.result(goal).result
    assert result.success, result.message
    state = robot.state()
    found = dict(zip(state.names, state.position, strict=True))
    assert [found[name] for name in asked] == pytest.approx([-1.1, 0.8], abs=0.01)
    goal = robot.goal("go_to_pose", action.GoToPose, pose="home", speed=1.0)
    result = robot.result(goal).result
    assert result.success, result.message


@pytest.mark.slow
def test_a_trajectory_over_parts(talkers: Talkers) -> None:
    """R3, T1: one goal for joints of both parts, with one result; by the topic, too."""
    robot, names = talkers["robot"], [UPPER[0], LOWER[0]]
    robot.set_mode([], "posd")
    point = JointTrajectoryPoint(positions=[0.4, -0.3], time_from_start=Duration(sec=1))
    path = JointTrajectory(joint_names=names, points=[point])
    feedback: list[Any] = []
    goal = robot.goal("follow_joint_trajectory", FollowJointTrajectory, feedback, trajectory=path)
    result = robot.result(goal).result
    assert (result.error_code, result.error_string) == (0, "goal reached")
    assert list(feedback[0].joint_names) == NAMES
    state = robot.state()
    found = dict(zip(state.names, state.position, strict=True))
    assert [found[name] for name in names] == pytest.approx([0.4, -0.3], abs=0.01)
    back = JointTrajectoryPoint(positions=[0.0, 0.0], time_from_start=Duration(sec=1))
    robot.command("joint_trajectory", JointTrajectory(joint_names=names, points=[back]))
    both = [NAMES.index(name) for name in names]
    robot.state(lambda s: all(abs(s.position[k]) < 0.01 for k in both))
    talkers["lower"].set_mode(LOWER[:1], "pos")
    refused = robot.result(
        robot.goal("follow_joint_trajectory", FollowJointTrajectory, trajectory=path)
    ).result
    assert refused.error_code == FollowJointTrajectory.Result.INVALID_GOAL
    assert LOWER[0] in refused.error_string


def test_a_stop_of_the_robot_ends_trajectories_of_parts(talkers: Talkers) -> None:
    """T1, P3: also where that is no trajectory of the robot's own."""
    robot, upper = talkers["robot"], talkers["upper"]
    upper.set_mode([], "posd")
    start = list(upper.state().position)
    point = JointTrajectoryPoint(positions=[start[0] + 1.0])
    point.time_from_start.sec = 20
    path = JointTrajectory(joint_names=UPPER[:1], points=[point])
    upper.command("joint_trajectory", path)
    upper.state(lambda s: s.velocity_reference[0] > 0.0)
    assert robot.call("stop", srv.Stop).success
    upper.state(lambda s: s.velocity_reference[0] == 0.0 and abs(s.velocity[0]) < 1e-3)
    first = upper.state().position_reference[0]
    for _ in range(20):
        assert upper.state().position_reference[0] == first


def test_a_fault_stays_in_its_part_and_an_emergency_does_not(talkers: Talkers) -> None:
    """R2: `external` at the robot is the emergency stop of all parts."""
    robot, upper = talkers["robot"], talkers["upper"]
    upper.call("inject_fault", srv.InjectFault, names=[], fault="external", persistent=True)
    upper.wait("modes", lambda m: set(m.control_modes) == {"hwfa"})
    assert set(talkers["lower"].modes()) == {"pos"}
    faults = robot.wait("faults", lambda f: len(f.faults) == len(UPPER))
    assert [fault.name for fault in faults.faults] == UPPER
    robot.call("inject_fault", srv.InjectFault, names=LOWER[:1], fault="external", persistent=True)
    robot.wait("modes", lambda m: set(m.control_modes) == {"hwfa"})
    assert talkers["lower"].call("clear_injected_faults", Trigger).success
    reply = robot.set_mode([], "fidl")
    answers = dict(zip(reply.names, reply.answers, strict=True))
    assert {answers[name] for name in LOWER} == {"accepted"}, "only its own faults were cleared"
    assert {answers[name] for name in UPPER} == {"refused"}
    assert robot.call("clear_injected_faults", Trigger).success
    assert robot.set_mode([], "fidl").success


def parameter(talker: Talker, name: str) -> Any:
    """A parameter's value, as the node of the talker shows it."""
    value = talker.call("get_parameters", GetParameters, names=[name]).values[0]
    return value.double_value


def test_a_parameter_is_the_same_at_every_node(talkers: Talkers) -> None:
    """Set at the part or at the robot, limits show, and act, at both; a rate is the robot's."""
    robot, lower = talkers["robot"], talkers["lower"]
    name = f"{LOWER[0]}.limits.upper"
    before = parameter(robot, name)
    assert lower.change(lbr_iiwa_joint_1__limits__upper=1.5).successful
    assert parameter(robot, name) == parameter(lower, name) == 1.5
    assert robot.change(lbr_iiwa_joint_1__limits__upper=1.2).successful
    assert parameter(robot, name) == parameter(lower, name) == 1.2
    robot.command("command/position", msg.PositionCommand(names=LOWER[:1], positions=[2.0]))
    until(
        lambda: (
            robot.call("get_references", srv.GetReferences, names=LOWER[:1]).positions[0] == 1.2
        )
    )
    refused = robot.change(
        lbr_iiwa_joint_1__limits__upper=1.3, lbr_iiwa_joint_2__limits__upper=-9.0
    )
    assert not refused.successful
    assert parameter(lower, name) == 1.2
    assert robot.change(lbr_iiwa_joint_1__limits__upper=before).successful
    assert robot.change(state_rate=50.0).successful
    assert robot.change(state_rate=100.0).successful
    assert not lower.change(state_rate=50.0).successful


@pytest.mark.slow
def test_a_saved_robot_starts_again(board: BoardProcess, tmp_path: Path) -> None:
    """R1: cbctl param save at the robot holds all of its parts; at a part, what is the part's."""
    cbctl = Cbctl(board.environment)
    for node, others in (("robot", True), ("lower", False)):
        path = tmp_path / f"{node}.yaml"
        saved = cbctl("--board", f"/pair/{node}", "param", "save", str(path))
        assert saved.out.endswith(f"control_board --ros-args --params-file {path}\n"), saved.err
        settings = load(path)
        assert settings.parts == {"upper": tuple(UPPER), "lower": tuple(LOWER)}
        assert settings.robot_name == "pair"
        assert f"{LOWER[0]}.position_pid.kp" in settings.where
        assert (f"{UPPER[0]}.position_pid.kp" in settings.where) is others
        assert ("physics" in settings.where) is others


def test_references_over_parts_all_or_none(talkers: Talkers) -> None:
    """R3, M7: a joint of another part that cannot holds the others back, and each answers."""
    robot, asked = talkers["robot"], [LOWER[1], UPPER[2]]
    assert robot.set_mode([UPPER[2]], "vel").success
    for together, values in ((True, []), (False, [LOWER[1]])):
        reply = robot.call(
            "send_reference",
            srv.SendReference,
            kind="position",
            names=asked,
            values=[0.1, 0.1],
            together=together,
        )
        assert not reply.success
        assert list(reply.names) == asked
        assert list(reply.codes) == ["together" if together else "", "other_mode"]
        done = dict(zip(NAMES, robot.state().motion_done, strict=True))
        assert [name for name, ended in done.items() if not ended] == values
    own = {"kind": "velocity", "names": [UPPER[2]], "values": [0.1], "together": True}
    assert talkers["upper"].call("send_reference", srv.SendReference, **own).success

# SPDX-License-Identifier: Apache-2.0
"""The action ~/follow_joint_trajectory and ~/controller_state over ROS (SPEC T1 to T3).

What a trajectory does is tested in simulated time, in test/core/test_trajectory_goal.py.
"""

from __future__ import annotations

import time
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration, Time
from control_board_msgs import srv
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import (
    JointComponentTolerance,
    JointTolerance,
    JointTrajectoryControllerState,
)
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool
from talk import Talker, stamp_of
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from unique_identifier_msgs.msg import UUID
from waiting import until

pytestmark = pytest.mark.ros

Result = FollowJointTrajectory.Result


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    """Stamps are simulated time then, exact on a busy machine too."""
    rates = {"real_time_factor": 4.0, "control_rate": 250.0, "state_rate": 25.0}
    return {"lbr_iiwa_joint_6.home": 0.0, **rates}


def trajectory(
    names: list[str], *points: tuple[float, list[float]], begin: float = 0.0
) -> JointTrajectory:
    made = JointTrajectory(
        joint_names=names,
        points=[
            JointTrajectoryPoint(
                positions=positions,
                time_from_start=Duration(sec=int(t), nanosec=round(t % 1.0 * 1e9)),
            )
            for t, positions in points
        ],
    )
    made.header.stamp = Time(sec=int(begin), nanosec=int(begin % 1.0 * 1e9))
    return made


def send(talker: Talker, feedback: Any = None, **goal: Any) -> Any:
    return talker.goal("follow_joint_trajectory", FollowJointTrajectory, feedback, **goal)


def end(talker: Talker, handle: Any) -> tuple[int, int, str]:
    answer = talker.result(handle)
    return answer.status, answer.result.error_code, answer.result.error_string


def positions(talker: Talker, names: list[str]) -> list[float]:
    """The last accepted direct positions, as the board says when asked."""
    return list(talker.call("get_references", srv.GetReferences, names=names).direct_positions)


@pytest.fixture
def names(talker: Talker) -> list[str]:
    """The last two joints, in POSITION_DIRECT and at 0."""
    chosen = talker.names[5:7]
    assert talker.set_mode(chosen, "posd").success
    zero = {"kind": "position_direct", "names": chosen, "values": [0.0, 0.0]}
    assert talker.call("send_reference", srv.SendReference, **zero).success
    return chosen


def test_a_goal_succeeds_with_feedback(talker: Talker, names: list[str]) -> None:
    """T1: desired, actual and error of all joints, in the board's order."""
    feedback: list[Any] = []
    goal = trajectory(names, (1.0, [0.1, 0.05]), (2.0, [0.2, 0.1]))
    status, code, text = end(talker, send(talker, feedback, trajectory=goal))
    assert (status, code) == (GoalStatus.STATUS_SUCCEEDED, Result.SUCCESSFUL), text
    assert text == "goal reached"
    assert positions(talker, names) == pytest.approx([0.2, 0.1])
    talker.state(lambda s: s.position[5:7] == pytest.approx([0.2, 0.1], abs=0.02))
    until(lambda: len(feedback) >= 2)
    for one in feedback:
        assert list(one.joint_names) == talker.names
        for point in (one.desired, one.actual, one.error):
            assert len(point.positions) == len(point.velocities) == 7
        differences = [
            d - a for d, a in zip(one.desired.positions, one.actual.positions, strict=True)
        ]
        assert list(one.error.positions) == pytest.approx(differences)
        passed = one.desired.time_from_start.sec + 1e-9 * one.desired.time_from_start.nanosec
        if passed < 2.0:
            assert one.desired.positions[5] == pytest.approx(0.1 * passed, abs=1e-3)
    assert stamp_of(feedback[-1]) > stamp_of(feedback[0])


def test_an_attended_goal_ends_with_its_program(talker: Talker, names: list[str]) -> None:
    """One whose heartbeats end: the joints stop; one without any goes on alone."""
    feedback: list[Any] = []
    handle = send(talker, feedback, trajectory=trajectory(names, (600.0, [1.0, 1.0])))
    alive = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    for _ in range(5):
        talker.command("goal_heartbeat", UUID(uuid=list(range(16))), alive)  # of another goal
    until(lambda: len(feedback) > 60)  # 3 s
    assert handle.status == GoalStatus.STATUS_EXECUTING

    def beat() -> int:
        talker.command("goal_heartbeat", handle.goal_id, alive)
        return len(feedback) > 120

    until(beat, period=0.1)
    status, code, text = end(talker, handle)
    assert (status, code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert text == "ended before its time; its program has been silent for 2 s"
    talker.state(lambda s: not any(s.velocity_reference[5:7]))
    assert max(positions(talker, names)) < 0.9


def test_cancelling_stops_the_joints(talker: Talker, names: list[str]) -> None:
    """T2: CANCELED with code SUCCESSFUL, as ros2_controllers has it."""
    handle = send(talker, trajectory=trajectory(names, (60.0, [1.0, 1.0])))
    talker.state(lambda s: s.position_reference[6] > 0.02)
    assert talker.answer(talker.within(handle.cancel_goal_async)).goals_canceling
    status, code, text = end(talker, handle)
    assert (status, code) == (GoalStatus.STATUS_CANCELED, Result.SUCCESSFUL)
    assert text == f"cancelled; {names[0]}, {names[1]} stopped"
    held = talker.state(lambda s: s.velocity_reference[6] == 0.0).position_reference[6]
    assert 0.02 < held < 0.9
    for _ in range(10):
        assert talker.state().position_reference[6] == held


def test_a_new_goal_preempts(talker: Talker, names: list[str]) -> None:
    """T1: the old one aborts at once with INVALID_GOAL; the new one succeeds."""
    old = send(talker, trajectory=trajectory(names, (60.0, [1.0, 1.0])))
    new = send(talker, trajectory=trajectory(names[1:], (0.4, [0.1])))
    status, code, text = end(talker, old)
    assert (status, code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert "preempted by a new goal" in text
    assert end(talker, new)[0] == GoalStatus.STATUS_SUCCEEDED


@pytest.mark.parametrize(
    ("changes", "code", "text"),
    [
        ({"names": ["elbow"]}, Result.INVALID_JOINTS, "joint 'elbow' unknown"),
        ({"begin": 1.0}, Result.OLD_HEADER_TIMESTAMP, "its last point was due"),
        (
            {"component_goal_tolerance": [JointComponentTolerance()]},
            Result.INVALID_GOAL,
            "component_goal_tolerance is not empty",
        ),
    ],
)
def test_wrong_goals_have_their_code_and_text(
    talker: Talker, names: list[str], changes: dict[str, Any], code: int, text: str
) -> None:
    """T1: the codes 0 to -3; nothing moves."""
    talker.state(lambda s: stamp_of(s) > 2.0)  # a stamp of 1.0 is long ago
    goal = trajectory(
        changes.pop("names", names[1:]),
        (0.5, [0.3]),
        begin=changes.pop("begin", 0.0),
    )
    status, found, said = end(talker, send(talker, trajectory=goal, **changes))
    assert (status, found) == (GoalStatus.STATUS_ABORTED, code)
    assert text in said
    assert positions(talker, names) == [0.0, 0.0]


def test_tolerances_end_a_goal(talker: Talker, names: list[str]) -> None:
    """T1: -4 on the way, -5 at its end, each with joint and amount; a slow joint is enough."""
    tight = JointTolerance(name=names[1], position=1e-6)
    goal = trajectory(names, (0.2, [0.3, 0.3]))
    status, code, text = end(talker, send(talker, trajectory=goal, path_tolerance=[tight]))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, Result.PATH_TOLERANCE_VIOLATED)
    assert text.startswith(f"{names[1]} is ")
    assert "its path tolerance is 1e-06 rad" in text
    goal = trajectory(names, (0.0, [1.0, 1.0]))
    status, code, text = end(
        talker,
        send(
            talker,
            trajectory=goal,
            goal_tolerance=[tight],
            goal_time_tolerance=Duration(nanosec=50_000_000),
        ),
    )
    assert (status, code) == (GoalStatus.STATUS_ABORTED, Result.GOAL_TOLERANCE_VIOLATED)
    assert "after the last point" in text


def test_a_mode_set_while_time_is_paused_aborts_the_goal(talker: Talker, names: list[str]) -> None:
    """T2: also when no control cycle runs."""
    handle = send(talker, trajectory=trajectory(names, (60.0, [1.0, 1.0])))
    assert talker.call("pause", SetBool, data=True).success
    assert talker.set_mode(names[1:], "pos").success
    status, code, text = end(talker, handle)
    assert (status, code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert f"{names[1]} is in POSITION" in text


@pytest.mark.slow
def test_controller_state_for_plotting_tools(talker: Talker, names: list[str]) -> None:
    """Reference, feedback, error and output of all joints, as often as ~/state."""
    talker.subscribe(
        "controller", JointTrajectoryControllerState, f"{talker.board}/controller_state"
    )
    talker.wait("controller", lambda _: True)
    begun = time.time_ns()
    handle = send(talker, trajectory=trajectory(names, (4.0, [0.2, 0.1])))
    assert end(talker, handle)[1] == Result.SUCCESSFUL
    under_way = talker.wait(
        "controller", lambda m: 0.02 < m.reference.positions[5] < 0.18, after=begun
    )
    assert list(under_way.joint_names) == talker.names
    assert under_way.speed_scaling_factor == 1.0
    assert under_way.reference.velocities[5] == pytest.approx(0.05, abs=1e-6)
    differences = [
        r - f
        for r, f in zip(under_way.reference.positions, under_way.feedback.positions, strict=True)
    ]
    assert list(under_way.error.positions) == pytest.approx(differences)
    assert under_way.output.positions == under_way.reference.positions


def test_tolerances_of_parameters_change_while_the_board_runs(
    talker: Talker, names: list[str]
) -> None:
    """constraints.*, as `ros2 param set` writes them: for the goals that come after."""
    goal = trajectory(names, (0.2, [0.3, 0.3]))
    tight = f"{names[1]}.constraints.trajectory"
    assert talker.change(**{tight: 1e-6}).successful
    assert end(talker, send(talker, trajectory=goal))[1] == Result.PATH_TOLERANCE_VIOLATED
    assert talker.change(**{tight: 0.0, "allow_partial_joints_goal": False}).successful
    code, text = end(talker, send(talker, trajectory=goal))[1:]
    assert code == Result.INVALID_JOINTS
    assert "send all joints" in text
    refused = talker.change(**{"constraints.goal_time": -1.0})
    assert not refused.successful
    assert "constraints.goal_time" in refused.reason
    assert talker.change(allow_partial_joints_goal=True).successful
    assert end(talker, send(talker, trajectory=goal))[1] == Result.SUCCESSFUL

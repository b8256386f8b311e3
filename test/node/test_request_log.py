# SPDX-License-Identifier: Apache-2.0
"""~/requests: what the board was asked and what it answered, each once, and no reading."""

from __future__ import annotations

import json
import math
import time
from types import SimpleNamespace
from typing import Any

import pytest
from control_board_msgs import action, msg, srv
from control_msgs.action import FollowJointTrajectory
from std_srvs.srv import Trigger
from talk import talking_to
from trajectory_msgs.msg import JointTrajectoryPoint

from control_board_ros.interface import (
    FOLLOW_JOINT_TRAJECTORY,
    GET_CONTROL_MODE,
    LIST_POSES,
    REQUEST_LOG,
    SERVICES,
    SET_CONTROL_MODE,
    SET_IMPEDANCE,
    STEP,
)
from control_board_ros.node.wiring import request_log
from control_board_ros.node.wiring.request_log import CHARACTERS, GoalRecord, RequestLog, left_out
from control_board_ros.testing import board_process

HISTORY = REQUEST_LOG.qos


class KeptLog:
    """A log whose messages are kept."""

    def __init__(self, joints: int = 2) -> None:
        self.messages: list[Any] = []
        member: Any = SimpleNamespace(
            snapshots=SimpleNamespace(now=lambda: 12_000_000_034),
            board=SimpleNamespace(count=joints),
        )
        self.receivers = 1
        publisher = SimpleNamespace(
            publish=self.messages.append, get_subscription_count=lambda: self.receivers
        )
        self.log = RequestLog(publisher, member)

    def answered(self, endpoint: Any, request: Any, response: Any) -> Any:
        self.log.answered(endpoint, request, response, time.perf_counter())
        assert self.messages == []  # an answer does not wait for it
        self.log.publish()
        return self.messages.pop()


def test_an_answer_holds_all_of_request_and_response() -> None:
    request = srv.SetControlMode.Request(names=["a", "b"], modes=["pos", "vel"])
    response = srv.SetControlMode.Response(
        success=False,
        message="b: no",
        names=["a", "b"],
        modes=["pos", "pos"],
        answers=["accepted", "refused"],
        reasons=["", "no"],
    )
    record = KeptLog().answered(SET_CONTROL_MODE, request, response)
    assert (record.kind, record.name, record.event) == ("service", "set_control_mode", "answered")
    assert list(record.names) == ["a", "b"]
    assert json.loads(record.request) == {"modes": ["pos", "vel"]}
    assert (record.success, record.message) == (False, "b: no")
    assert list(record.answers) == ["accepted", "refused"]
    assert list(record.reasons) == ["", "no"]
    assert json.loads(record.response) == {"modes": ["pos", "pos"]}
    assert (record.header.stamp.sec, record.header.stamp.nanosec) == (12, 34)
    assert 0.0 <= record.duration < 60.0


def test_messages_that_nobody_receives_are_made_later(monkeypatch: pytest.MonkeyPatch) -> None:
    """In their order, and not while the answer goes out; who comes later finds them made."""
    kept = KeptLog()
    kept.receivers = 0
    for k in range(3):
        response = Trigger.Response(success=True, message=f"{k}")
        kept.log.answered(SET_CONTROL_MODE, Trigger.Request(), response, time.perf_counter())
    kept.log.publish()
    assert kept.messages == []
    monkeypatch.setattr(request_log, "DELAY", 0.0)
    kept.log.publish()
    assert [record.message for record in kept.messages] == ["0", "1", "2"]


def test_read_only_calls_are_not_logged() -> None:
    out = {service.short for service in SERVICES if left_out(service)}
    assert out >= {GET_CONTROL_MODE.short, LIST_POSES.short, STEP.short}
    assert {"set_control_mode", "stop", "save_pose", "power_cycle"}.isdisjoint(out)
    kept = KeptLog()
    kept.log.answered(GET_CONTROL_MODE, None, srv.GetControlMode.Response(), 0.0)
    kept.log.publish()
    assert kept.messages == []


def test_numbers_that_json_has_not_are_texts() -> None:
    request = srv.SetImpedance.Request(stiffness=[math.nan, 1.5], damping=[math.inf])
    record = KeptLog().answered(SET_IMPEDANCE, request, srv.SetImpedance.Response())
    assert json.loads(record.request) == {"stiffness": ["nan", 1.5], "damping": ["inf"]}


def test_long_texts_are_truncated_and_marked() -> None:
    request = srv.SetControlMode.Request(names=["x" * 10_000] * 5000, modes=["y"] * 5000)
    record = KeptLog().answered(SET_CONTROL_MODE, request, srv.SetControlMode.Response())
    assert len(record.names) == 33
    assert record.names[-1] == "… 4968 more"
    assert len(record.names[0]) == CHARACTERS + 1
    assert json.loads(record.request)["modes"][-1] == "… 4968 more"


def test_the_robot_of_many_joints_shows_all_of_them() -> None:
    names = [f"joint_{k}" for k in range(40)]
    request = srv.SetControlMode.Request(names=names, modes=["pos"])
    record = KeptLog(joints=40).answered(SET_CONTROL_MODE, request, srv.SetControlMode.Response())
    assert list(record.names) == names


def test_a_goal_of_a_trajectory_names_its_joints() -> None:
    point = JointTrajectoryPoint(positions=[1.0, 2.0])
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names, goal.trajectory.points = ["a", "b"], [point] * 100
    handle = SimpleNamespace(request=goal, goal_id=SimpleNamespace(uuid=bytes(16)), status=6)
    kept = KeptLog()
    asked = GoalRecord(kept.log, FOLLOW_JOINT_TRAJECTORY, handle)
    asked.accepted()
    result = FollowJointTrajectory.Result(error_code=-4, error_string="too far")
    assert asked.ended(result) is result
    kept.log.publish()
    begun, ended = kept.messages
    assert (begun.event, begun.success, begun.goal) == ("accepted", True, "00" * 16)
    assert list(begun.names) == ["a", "b"]
    points = json.loads(begun.request)["trajectory"]["points"]
    assert points[0]["positions"] == [1.0, 2.0]
    assert points[-1] == "… 68 more"
    assert (ended.event, ended.success, ended.message) == ("aborted", False, "too far")
    assert json.loads(ended.response) == {"error_code": -4, "error_string": "too far"}


@pytest.mark.slow
@pytest.mark.ros
def test_each_node_of_a_robot_publishes_its_requests_to_late_subscribers() -> None:
    names = ["lbr_iiwa_joint_1", "lbr_iiwa_joint_2"]
    parts = {"one": names[:1], "two": names[1:]}
    params = {"robot": "iiwa", "robot_name": "pair", "parts": parts, "physics": "ideal"}
    with board_process(params, robot="pair") as board:
        with talking_to(board) as robot, talking_to(board, "part", "/pair/one") as part:
            assert part.call("power_cycle", Trigger).success
            robot.wait("modes", lambda m: set(m.control_modes) == {"pos"})
            assert robot.set_mode(names, "pos").success
            assert not robot.set_mode(names[1:], "no").success
            assert robot.call("get_control_mode", srv.GetControlMode).success
            goal = robot.goal("move", action.Move, names=names[:1], positions=[0.1], speeds=[1.0])
            assert robot.result(goal).result.success
            goal = robot.goal("move", action.Move, names=["no"], positions=[0.0])
            assert not robot.result(goal).result.success
            assert robot.call("stop", srv.Stop, names=names).success
            part.subscribe("requests", msg.Request, f"{part.board}/requests", HISTORY.profile())
            part.wait("requests", lambda m: m.name == "power_cycle")
        with talking_to(board, "late") as late:
            late.subscribe("requests", msg.Request, f"{board.name}/requests", HISTORY.profile())
            late.wait("requests", lambda m: m.name == "stop")
            events = late.seen["requests"]
    found = [(m.name, m.event, m.success) for m in events]
    assert found == [
        ("set_control_mode", "answered", True),
        ("set_control_mode", "answered", False),
        ("move", "accepted", True),
        ("move", "succeeded", True),
        ("move", "refused", False),
        ("stop", "answered", True),
    ]
    assert "no" in events[1].message
    assert list(events[1].names) == names[1:]
    assert json.loads(events[2].request)["positions"] == [0.1]
    assert events[2].goal == events[3].goal != events[4].goal
    assert events[3].duration > 0.05
    stamps = [(m.header.stamp.sec, m.header.stamp.nanosec) for m in events]
    assert stamps == sorted(stamps)

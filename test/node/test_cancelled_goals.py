# SPDX-License-Identifier: Apache-2.0
"""A goal that is cancelled before it began moves nothing, and ends no other goal."""

from __future__ import annotations

from collections.abc import Coroutine
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any, cast

import pytest
from action_msgs.msg import GoalStatus

from control_board_ros.interface import ACTIONS, FOLLOW_JOINT_TRAJECTORY
from control_board_ros.node.wiring import actions, trajectories
from control_board_ros.node.wiring.request_log import RequestLog


class Handle:
    """A goal of rclpy whose cancelling was accepted before its turn came."""

    is_cancel_requested = True
    goal_id = SimpleNamespace(uuid=bytes(16))
    status = GoalStatus.STATUS_CANCELED

    def __init__(self, request: Any) -> None:
        self.request, self.ended = request, ""

    def canceled(self) -> None:
        self.ended = "canceled"


def never(*_: Any, **__: Any) -> Any:
    raise AssertionError("the board was touched")


def ended(execution: Coroutine[Any, Any, Any]) -> Any:
    """The result of a coroutine that waits for nothing."""
    with pytest.raises(StopIteration) as done:
        execution.send(None)
    return done.value.value


@pytest.mark.parametrize("action", ACTIONS, ids=lambda action: action.short)
def test_a_goal_cancelled_before_it_began(action: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    executed: dict[str, Any] = {}

    def serve(_node: Any, _kind: Any, name: str, execute: Any, **_: Any) -> None:
        executed[name] = execute

    timer = SimpleNamespace(reset=never)
    node = SimpleNamespace(create_timer=lambda *_, **__: timer, get_logger=lambda: None)
    member = SimpleNamespace(exclusive=never, loop=SimpleNamespace(hooks=[], paused=False))
    snapshots = SimpleNamespace(now=lambda: 0)
    board = SimpleNamespace(count=1)
    published: list[Any] = []
    requests = RequestLog(
        SimpleNamespace(publish=published.append, get_subscription_count=lambda: 1),
        SimpleNamespace(snapshots=snapshots, board=board),
    )
    monkeypatch.setattr(actions, "ActionServer", serve)
    made = [
        actions.Actions(node, member, never, never, requests),
        trajectories.FollowTrajectory(node, member, never, never, requests),
    ]
    handle = Handle(action.load().Goal())
    result = ended(executed[action.name](handle))
    assert len(made) == 2
    assert handle.ended == "canceled"
    text = result.error_string if action is FOLLOW_JOINT_TRAJECTORY else result.message
    assert text == "cancelled before it began"
    requests.publish()
    assert [(one.name, one.event) for one in published] == [(action.short, "canceled")]


def test_an_error_in_the_end_of_the_last_goal_is_not_one_of_the_new(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """T1: the new goal is watched, and the error reported."""
    monkeypatch.setattr(actions, "ActionServer", lambda *_, **__: None)
    resets: list[bool] = []
    errors: list[Exception] = []
    timer = SimpleNamespace(reset=lambda: resets.append(True))
    node = SimpleNamespace(create_timer=lambda *_, **__: timer, get_logger=lambda: None)
    board = SimpleNamespace(count=1, time=1.0)
    loop = SimpleNamespace(hooks=[], paused=False, time_base=SimpleNamespace(offset=0))
    member: Any = SimpleNamespace(exclusive=lambda: nullcontext(board), loop=loop)
    new = SimpleNamespace(take_over=lambda _: None)
    requests: Any = None
    follow = trajectories.FollowTrajectory(
        cast(Any, node),
        member,
        lambda *_: cast(Any, new),
        lambda error, _: errors.append(error),
        requests,
    )
    last = SimpleNamespace(outcome=None)  # what no goal that ends has
    follow._goal = actions.Goal(None, cast(Any, last), cast(Any, None))
    handle = Handle(FOLLOW_JOINT_TRAJECTORY.load().Goal())
    follow._start(handle)
    assert follow._goal.handle is handle
    assert resets
    assert [type(error) for error in errors] == [AssertionError]


def test_an_error_in_the_end_of_a_goal_is_none_of_the_next(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """T: the new trajectory runs, is watched, and is not reported as refused."""
    monkeypatch.setattr(trajectories, "read_goal", lambda _: ((), ()))
    monkeypatch.setattr(trajectories, "start_time", lambda *_: 0.0)
    done: list[str] = []
    loop = SimpleNamespace(time_base=None, hooks=[])
    board = nullcontext(SimpleNamespace(count=1))
    timer = SimpleNamespace(reset=lambda: done.append("watched"))
    server = object.__new__(trajectories.FollowTrajectory)
    server._member = cast(Any, SimpleNamespace(exclusive=lambda: board, loop=loop))
    server._start_goal = cast(Any, lambda *_: SimpleNamespace(take_over=lambda _: None))
    server._timer = cast(Any, timer)
    server._on_error = lambda error, _: done.append(str(error))
    ended = SimpleNamespace(outcome=SimpleNamespace(code=0, text=""), cancelled=False)
    old = SimpleNamespace(task=ended, close=lambda **_: 1 / 0)
    server._goal = cast(Any, old)
    goal = SimpleNamespace(header=SimpleNamespace(stamp=0), joint_names=[])
    server._beaten = None
    server._start(SimpleNamespace(goal_id=1, request=SimpleNamespace(trajectory=goal)))
    assert done == ["watched", "division by zero"]
    assert server._goal is not old

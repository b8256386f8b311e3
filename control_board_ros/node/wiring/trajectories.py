# SPDX-License-Identifier: Apache-2.0
"""Joint trajectories, which the core follows (SPEC T): action, topic and ~/controller_state.

The control loop checks a goal of ~/follow_joint_trajectory in every cycle; a timer sends its
feedback and its result.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTrajectoryControllerState
from rclpy.action.server import CancelResponse
from rclpy.node import Node
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectoryPoint

from ...core.goals.follower import Follower
from ...core.goals.path import MAX_POINTS, Points, Sample, Wish, Wishes, make_path
from ...core.goals.trajectory_goal import Code, End, GoalError, TrajectoryGoal
from ...core.group import JointGroup
from ...core.selection import RequestError
from ...core.state import Snapshot
from ...core.terms.reply import Reply
from ...interface import FOLLOW_JOINT_TRAJECTORY
from ...operations import doubles, truncated
from ..loop.loop import ControlLoop, Member
from ..loop.timing import TimeBase
from .actions import PERIOD, Goal, action_server, goal_timer
from .messages import NANOSECONDS, set_stamp
from .request_log import GoalRecord, RequestLog
from .topics import Callback, Warn

#: Silence of a program that sends heartbeats of its goal, after which the goal ends, s.
SILENCE = 2.0
#: A stamp so far from the board's time is one of another clock, s.
OTHER_CLOCK = 3600.0

#: Starts a goal of joints, points, start time and tolerances.
StartGoal = Callable[[Sequence[str], Points, float, Wishes], TrajectoryGoal]


class FollowTrajectory:
    """The action server; one goal at a time, a new one preempts.

    ``start_goal`` starts a goal; its follower is stepped after the check of this server.
    """

    def __init__(
        self,
        node: Node,
        member: Member,
        start_goal: StartGoal,
        on_error: Callable[[Exception, str], None],
        requests: RequestLog,
    ) -> None:
        self._member, self._start_goal, self._on_error = member, start_goal, on_error
        self._requests = requests
        self._logger = node.get_logger()
        self._goal: Goal[TrajectoryGoal] | None = None
        self._beaten: Any = None  # id of the last heartbeat, which precedes its goal
        self._unheard = math.nan  # looks at the goal since its last heartbeat; NaN: it had none
        # before the follower's step: reading and reference agree
        member.loop.hooks.insert(0, self._check)
        self._timer = goal_timer(node, self._look)
        self._server = action_server(node, FOLLOW_JOINT_TRAJECTORY, self._execute, self._cancel)

    async def _execute(self, handle: Any) -> Any:
        """Start a goal and wait for its end; the result of a refused one has its code and text."""
        record = GoalRecord(self._requests, FOLLOW_JOINT_TRAJECTORY, handle)
        if handle.is_cancel_requested:  # it preempts no other goal
            handle.canceled()
            return record.ended(result(End(Code.SUCCESSFUL, "cancelled before it began")))
        try:
            self._start(handle)
        except GoalError as error:
            end = End(error.code, error.text)
        except RequestError as error:
            end = End(Code.INVALID_GOAL, str(error))
        except Exception as error:  # noqa: BLE001 - or the default result would be SUCCESSFUL
            self._on_error(error, FOLLOW_JOINT_TRAJECTORY.short)
            end = End(Code.INVALID_GOAL, "internal error; see the board's log")
        else:
            assert self._goal is not None
            record.accepted()
            return record.ended(result(await self._goal.ended))
        self._logger.warning(f"{FOLLOW_JOINT_TRAJECTORY.short} refused: {end.text}")
        handle.abort()
        return record.refused(result(end))

    def _start(self, handle: Any) -> None:
        request, old = handle.request, self._goal
        points, wishes = read_goal(request)
        with self._member.exclusive() as board:
            joints = truncated(request.trajectory.joint_names, board.count)
            start = start_time(request.trajectory.header.stamp, board, self._member.loop.time_base)
            task = self._start_goal(joints, points, start, wishes)
            if old is not None:
                task.take_over(old.task)
            self._goal = Goal(handle, task, Future())
            self._unheard = 0.0 if self._beaten == handle.goal_id else math.nan
        self._timer.reset()
        if old is not None:
            try:
                self._finish(old)
            except Exception as error:  # noqa: BLE001 - the new goal runs
                self._on_error(error, FOLLOW_JOINT_TRAJECTORY.short)

    def _cancel(self, handle: Any) -> CancelResponse:
        """Stop immediately; the timer delivers the result."""
        goal = self._goal
        if goal is not None and goal.handle.goal_id == handle.goal_id:
            with self._member.exclusive():
                goal.task.cancel()
        return CancelResponse.ACCEPT

    def beat(self, message: Any) -> None:
        """Note a heartbeat, the id of a goal."""
        goal, self._beaten = self._goal, message
        if goal is not None and goal.handle.goal_id == message:
            self._unheard = 0.0

    def _check(self, _board: JointGroup, _time: float) -> None:
        """In every control cycle."""
        goal = self._goal
        if goal is not None:
            goal.task.check()

    def _look(self) -> None:
        """Send feedback, and the result at the end."""
        goal = self._goal
        if goal is None:
            self._timer.cancel()
            return
        self._unheard += 1  # looks, not time: while this program stands still no one is silent
        with self._member.exclusive() as board:
            if self._unheard > SILENCE / PERIOD:
                goal.task.abandon(f"its program has been silent for {SILENCE:g} s")
            goal.task.check()  # simulated time may be stopped
            message = feedback(board, goal.task)
            set_stamp(message.header.stamp, self._member.loop.time_base.stamp(board.time))
        goal.handle.publish_feedback(message)
        if goal.task.outcome is not None:
            self._goal = None
            self._finish(goal)

    def _finish(self, goal: Goal[TrajectoryGoal]) -> None:
        end = goal.task.outcome
        assert end is not None
        goal.close(cancelled=goal.task.cancelled, success=end.code is Code.SUCCESSFUL)
        self._logger.info(f"{FOLLOW_JOINT_TRAJECTORY.short}: {end.text}")
        goal.ended.set_result(end)


def result(end: End) -> Any:
    return FollowJointTrajectory.Result(error_code=int(end.code), error_string=end.text)


def read_goal(request: Any) -> tuple[Points, Wishes]:
    """Points and tolerances of a goal.

    Raises:
        RequestError: it has points or tolerances of several degrees of freedom.
    """
    for name in (
        "multi_dof_trajectory.points",
        "component_path_tolerance",
        "component_goal_tolerance",
    ):
        value = request
        for part in name.split("."):
            value = getattr(value, part)
        if len(value):
            raise RequestError(
                f"{name} is not empty, and joints here have one degree of freedom; leave it empty"
            )
    time = request.goal_time_tolerance
    return read_points(request.trajectory), Wishes(
        path=wishes_of(request.path_tolerance),
        goal=wishes_of(request.goal_tolerance),
        goal_time=time.sec + time.nanosec / NANOSECONDS,
    )


def wishes_of(tolerances: Sequence[Any]) -> list[Wish]:
    return [Wish(t.name, t.position, t.velocity) for t in tolerances]


def feedback(board: JointGroup, task: TrajectoryGoal) -> Any:
    """Desired and actual positions of all joints, in the board's order."""
    desired, elapsed = task.desired(), duration(task.elapsed)
    actual = Sample(board.get_encoder(), board.get_encoder_speed(), np.zeros(0))
    error = Sample(
        desired.positions - actual.positions, desired.velocities - actual.velocities, np.zeros(0)
    )
    return FollowJointTrajectory.Feedback(
        joint_names=list(board.names),
        desired=point(desired, elapsed),
        actual=point(actual, elapsed),
        error=point(error, elapsed),
    )


def point(sample: Sample, elapsed: Duration | None = None) -> JointTrajectoryPoint:
    return JointTrajectoryPoint(
        positions=doubles(sample.positions),
        velocities=doubles(sample.velocities),
        accelerations=doubles(sample.accelerations),
        time_from_start=elapsed or Duration(),
    )


def duration(seconds: float) -> Duration:
    """A time from a start on as a message; 0 before it."""
    whole, rest = divmod(max(round(seconds * NANOSECONDS), 0), NANOSECONDS)
    return Duration(sec=whole, nanosec=rest)


def controller_state(
    names: Sequence[str], snapshot: Snapshot, nanoseconds: int
) -> JointTrajectoryControllerState:
    """A snapshot for the plotting tools of trajectory controllers.

    The output is the position reference, which a trajectory sets.
    """
    none = np.zeros(0)
    reference = Sample(snapshot.position_reference, snapshot.velocity_reference, none)
    actual = Sample(snapshot.position, snapshot.velocity, none)
    error = Sample(
        reference.positions - actual.positions, reference.velocities - actual.velocities, none
    )
    message = JointTrajectoryControllerState(
        joint_names=list(names),
        reference=point(reference),
        feedback=point(actual),
        error=point(error),
        output=point(Sample(reference.positions, none, none)),
        speed_scaling_factor=1.0,
    )
    set_stamp(message.header.stamp, nanoseconds)
    return message


def read_points(message: Any) -> Points:
    """The points of a JointTrajectory.

    Raises:
        RequestError: a point has effort.
    """
    points = message.points[: MAX_POINTS + 1]  # one too many is enough to refuse it
    for i, point in enumerate(points):
        if len(point.effort):
            raise RequestError(f"point {i} has effort, which is not followed; leave effort empty")
    return Points(
        [p.time_from_start.sec + p.time_from_start.nanosec / NANOSECONDS for p in points],
        [point.positions for point in points],
        [point.velocities for point in points],
        [point.accelerations for point in points],
    )


def start_time(stamp: Any, board: JointGroup, base: TimeBase) -> float:
    """Start of a trajectory with this stamp, time of the board, s; stamp 0: now.

    Raises:
        RequestError: the stamp is of another clock (T5).
    """
    nanoseconds = stamp.sec * NANOSECONDS + stamp.nanosec
    if not nanoseconds:
        return board.time
    start: float = (nanoseconds - base.offset) / NANOSECONDS
    if abs(start - board.time) > OTHER_CLOCK:
        here = base.stamp(board.time) / NANOSECONDS
        raise RequestError(
            f"it is stamped {nanoseconds / NANOSECONDS:.3f} s and the board's clock shows "
            f"{here:.3f} s; stamp it by that clock (use_sim_time), or send 0 for now"
        )
    return start


def followed(loop: ControlLoop) -> Follower:
    """The follower of a loop's board, which the loop steps."""
    with loop.main.exclusive():
        follower = Follower(loop.board)
    loop.hooks.append(lambda _board, time: follower.step(time))
    loop.exclusive_hooks.append(follower.check)
    return follower


def trajectory_callback(member: Member, follower: Follower, warn: Warn) -> Callback:
    """The callback of ~/joint_trajectory.

    A trajectory is followed from header.stamp on (0: now); one without points stops its joints.
    """

    def follow(board: JointGroup, message: Any) -> Reply | None:
        joints = truncated(message.joint_names, board.count)
        try:
            names = board.selector.select(joints).names
            if not message.points:
                follower.hold(names, "a trajectory without points came")
                return None
            path = make_path(names, *read_points(message))
            start = start_time(message.header.stamp, board, member.loop.time_base)
        except RequestError as error:
            return board.reject(joints, f"refused, {error}")
        return follower.follow(names, path, start)

    def on_message(message: Any) -> None:
        with member.exclusive() as board:
            reply = follow(board, message)
        if reply is not None and reply.message:
            warn(f"trajectory: {reply.message}", "times" if reply else "ignored")

    return on_message

# SPDX-License-Identifier: Apache-2.0
"""Trajectories as goals, which end within tolerances (SPEC T1 to T4).

The owner of the follower checks a goal before its step::

    goal = start_goal(follower, board, ["elbow"], points, board.time)
    while goal.outcome is None:
        measurement = plant.read()
        goal.check()
        follower.step(measurement.time)
        plant.write(board.tick(measurement))
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..group import JointGroup
from ..selection import RequestError, Selection
from ..terms.arguments import Array, Joints
from ..terms.joint_kind import JointKind
from ..terms.reply import summary
from .follower import TURN, Follower, admitted, at_nearest_turn, cuts, incomplete, overdue
from .path import (
    QUANTITIES,
    Excess,
    Path,
    Points,
    Run,
    Sample,
    Tolerances,
    Wishes,
    excess,
    explain,
    goal_tolerances,
    make_path,
)

PREEMPTED, REACHED = "preempted by a new goal", "goal reached"
NOBODY: NDArray[np.intp] = np.array([], dtype=np.intp)


class Code(IntEnum):
    """The error codes of control_msgs' FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class End(NamedTuple):
    """How a goal ended; the text is for people."""

    code: Code
    text: str


class GoalError(Exception):
    """A goal that is refused; nothing has changed."""

    def __init__(self, code: Code, text: str) -> None:
        super().__init__(text)
        self.code, self.text = code, text


def start_goal(
    follower: Follower,
    group: JointGroup,
    joints: Joints,
    points: Points,
    start: float,
    wishes: Wishes = Wishes(),  # noqa: B008 - a tuple
) -> TrajectoryGoal:
    """Start a goal whole, or refuse it.

    Args:
        follower: of the board.
        group: whose joints move: of a part of a robot, or of several parts (R3).
        joints: as in every request.
        points: one number per joint in each field that is there.
        start: time of the board at which the trajectory begins, s.
        wishes: tolerances; what is not named is as configured.

    Raises:
        GoalError: with the code and the reason; nothing has changed, but that joints in another
            mode count a rejected command (M4).
    """
    try:
        selection = group.selector.select(joints)
    except RequestError as error:
        raise GoalError(Code.INVALID_JOINTS, str(error)) from error
    if text := incomplete(follower.board, selection.names):
        raise GoalError(Code.INVALID_JOINTS, text)
    try:
        path = make_path(selection.names, *points)
        defaults = configured(follower.board, selection)
        tolerances = goal_tolerances(defaults, selection.names, group.names, wishes)
    except RequestError as error:
        raise GoalError(Code.INVALID_GOAL, str(error)) from error
    path = at_nearest_turn(follower.board, selection, path)
    check_start(group, selection, path, start)
    return TrajectoryGoal(follower, group, selection.joints, path, start, tolerances)


def check_start(group: JointGroup, selection: Selection, path: Path, start: float) -> None:
    """Raise GoalError unless joints can follow a path that begins at this time of the board, s."""
    if text := overdue(group, path, start):
        raise GoalError(Code.OLD_HEADER_TIMESTAMP, text)
    good, refusal = admitted(group, selection, path)
    if not good.all():
        raise GoalError(Code.INVALID_GOAL, refusal.message)


def configured(board: JointGroup, selection: Selection) -> Tolerances:
    """The tolerances of the parameters; a goal's velocity is that of a joint at rest.

    Of joints of several parts, the first that has waited long enough after the last point ends it.
    """
    parts = [
        (board.config.joints[j].constraints, zone.config.constraints)
        for j in selection.joints.tolist()
        for zone in board.config.zones()
        if j in zone.joints
    ]
    times = [part.goal_time for _, part in parts if part.goal_time > 0.0]
    return Tolerances(
        path=np.array([[joint.trajectory for joint, _ in parts], [0.0] * len(parts)]),
        goal=np.array(
            [
                [joint.goal for joint, _ in parts],
                [part.stopped_velocity_tolerance for _, part in parts],
            ]
        ),
        goal_time=min(times, default=0.0),
    )


class TrajectoryGoal:
    """A trajectory that is active, or waiting for its start; ``start_goal`` makes it.

    Its joints are the board's numbers, of the path's columns; all are in POSITION_DIRECT.

    Attributes: joints, names (theirs), start, notes (what a limit cuts), outcome (None while
    active), cancelled.
    """

    def __init__(
        self,
        follower: Follower,
        group: JointGroup,
        joints: NDArray[np.intp],
        path: Path,
        start: float,
        tolerances: Tolerances,
    ) -> None:
        board = follower.board
        self._follower, self._group, self._board = follower, group, board
        self._tolerances = tolerances
        self.joints, self._duration, self.start = joints, path.duration, start
        self._run = follower.take(joints, path, start, held=True)
        self.notes = list(cuts(board, self._run).values())
        self._before: list[Run] = []  # of the goals before it: followed until it begins (T5)
        self._begun = False
        self.names = [board.names[j] for j in joints]
        self.outcome: End | None = None
        self.cancelled = False

    @property
    def elapsed(self) -> float:
        """Time since the start, s; negative before it."""
        return self._board.time - self.start

    def check(self) -> None:
        """Find out, between two cycles, whether it has ended; stop its joints where it failed."""
        self._follower.check()
        if self.outcome is not None:
            return
        if self._run.left:
            self._end(Code.INVALID_GOAL, f"ended before its time; {self._run.left}")
        elif self._run.last is not None:
            self._compare(self._run.last)

    def cancel(self) -> None:
        """Stop the joints within their acceleration limits."""
        if self.outcome is None:
            self.cancelled = True
            self._end(Code.SUCCESSFUL, f"cancelled; {', '.join(self.names)} stopped")

    def abandon(self, why: str) -> None:
        """End it before its time, and stop the joints as :meth:`cancel` does."""
        if self.outcome is None:
            self._end(Code.INVALID_GOAL, f"ended before its time; {why}")

    def take_over(self, old: TrajectoryGoal) -> None:
        """Preempt a goal: joints of both go on with it until this one begins, the others stop."""
        if old.outcome is not None:
            return
        others = old._followed()
        self._before = [run for run in (*old._before, old._run) if self._follower.follows(run)]
        for run in self._before:
            run.held = False
        old.outcome = End(Code.INVALID_GOAL, PREEMPTED)
        self._follower.brake(others[~np.isin(others, self.joints)], PREEMPTED)

    def desired(self) -> Sample:
        """What the joints of the group shall do now, shapes (n,): outside the goal, references."""
        state, joints = self._board.state, self._group.joints
        rows = state.position_reference, state.velocity_reference, np.zeros(state.n)
        made = Sample(*(row[joints.start : joints.stop].copy() for row in rows))
        if self._run.last is not None:
            for whole, row in zip(made, self._run.last, strict=True):
                whole[self._run.joints - joints.start] = row
        return made

    def _compare(self, last: Sample) -> None:
        """Compare what was sent last with the reading of the same time."""
        state, limits = self._board.state, self._tolerances
        errors = np.stack(
            [
                last.positions - state.position[self.joints],
                last.velocities - state.velocity[self.joints],
            ]
        )
        late = self.elapsed - self._duration
        on_the_way = late < 0.0 or not self._begun  # one point alone is judged as a way, too
        self._begun = True
        if on_the_way and (miss := excess(errors, limits.path)):
            text = f"{self._explain(miss, 'path')}, {self.elapsed:.3g} s after the start"
            self._miss(Code.PATH_TOLERANCE_VIOLATED, text, errors, limits.path)
        elif late >= 0.0:
            miss = excess(errors, limits.goal) or self._astray(errors)
            if miss is None:
                self._end(Code.SUCCESSFUL, summary([REACHED, *self.notes]), NOBODY)
                self._follower.leave(self._run)
            elif 0.0 < limits.goal_time < late:
                text = f"{self._explain(miss, 'goal')}, {late:.3g} s after the last point"
                self._miss(Code.GOAL_TOLERANCE_VIOLATED, text, errors, limits.goal)

    def _astray(self, errors: Array) -> Excess | None:
        """The continuous joint that is on another turn than the goal's last point (T4)."""
        for k, j in enumerate(self.joints.tolist()):
            away = abs(float(errors[0, k]))
            if away > 0.5 * TURN and self._board.config.joints[j].kind is JointKind.CONTINUOUS:
                return Excess(k, QUANTITIES[0], away, 0.5 * TURN)
        return None

    def _explain(self, excess: Excess, which: str) -> str:
        kind = self._board.config.joints[int(self.joints[excess.column])].kind
        return explain(excess, self.names[excess.column], kind, which)

    def _miss(self, code: Code, text: str, errors: Array, tolerances: Array) -> None:
        """End it: joints beyond a tolerance stop where they are, others at their references."""
        state, joints = self._board.state, self.joints
        beyond = ((tolerances > 0.0) & (np.abs(errors) > tolerances)).any(axis=0)
        present = Sample(
            np.where(beyond, state.position[joints], state.position_reference[joints]),
            np.where(beyond, state.velocity[joints], state.velocity_reference[joints]),
            np.zeros(len(joints)),
        )
        self._end(code, text, present=present)

    def _end(
        self,
        code: Code,
        text: str,
        stopped: NDArray[np.intp] | None = None,
        present: Sample | None = None,
    ) -> None:
        """Set the outcome; stop joints, by default all that still follow it."""
        joints = self._followed() if stopped is None else stopped
        self.outcome = End(code, text)
        for run in (self._run, *self._before):
            if run.spline is None:
                self._follower.leave(run)
        self._follower.brake(joints, text, present)

    def _acting(self) -> Run | None:
        """Its run, or while that waits, the one of a goal before it; not what others sent."""
        runs = (self._run, *reversed(self._before))
        return next((run for run in runs if run.spline is not None), None)

    def _followed(self) -> NDArray[np.intp]:
        """The joints that still follow it."""
        run = self._acting()
        return run.joints if run is not None and self._follower.follows(run) else NOBODY

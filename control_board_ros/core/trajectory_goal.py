# SPDX-License-Identifier: Apache-2.0
"""A trajectory that is followed to its end, within tolerances (SPEC T1 to T3).

Callers holding the board make the goal, which begins it, and call ``check`` before every tick::

    goal = start_goal(follower, board, ["elbow"], points, board.time)
    while goal.outcome is None:
        measurement = plant.read()
        goal.check()
        follower.step(measurement.time)
        plant.write(board.tick(measurement))
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..protocols import Joints
from .board import Board
from .follower import Follower, cuts
from .path import Path, Points, Sample, make_path
from .path_run import Run
from .reply import summary
from .robot import Robot
from .selection import RequestError, Selection, Selector
from .tolerances import Excess, Tolerances, Wish, chosen, excess, explain
from .vocabs import CommandKind

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


class Wishes(NamedTuple):
    """The tolerances that a goal names: on the way, at the last point, and time after it (s)."""

    path: Sequence[Wish] = ()
    goal: Sequence[Wish] = ()
    goal_time: float = 0.0


def start_goal(
    follower: Follower,
    board: Board,
    joints: Joints,
    points: Points,
    start: float,
    wishes: Wishes = Wishes(),  # noqa: B008 - a tuple
) -> TrajectoryGoal:
    """Start a goal whole, or refuse it.

    Args:
        follower: of the board.
        board: which moves.
        joints: as in every request.
        points: one number per joint in each field that is there.
        start: time of the board at which the trajectory begins, s.
        wishes: tolerances; what is not named is as configured.

    Raises:
        GoalError: with the code and the reason; nothing has changed, but that joints in another
            mode count a rejected command (M4).
    """
    selection = selected(board.selector, joints)
    check_complete(board, selection.names)
    path = made_path(selection, points)
    tolerances = tolerances_of(board, selection, board.names, wishes)
    check_start(board, selection, path, start)
    return TrajectoryGoal(follower, board, selection.joints, path, start, tolerances)


def selected(selector: Selector, joints: Joints) -> Selection:
    """The joints of a goal; GoalError where one is not there."""
    try:
        return selector.select(joints)
    except RequestError as error:
        raise GoalError(Code.INVALID_JOINTS, str(error)) from error


def check_complete(board: Board, names: Sequence[str]) -> None:
    """Raise GoalError where a board takes goals for all of its joints only."""
    if len(names) < board.count and not board.config.allow_partial_joints_goal:
        missing = [name for name in board.names if name not in names]
        text = f"{', '.join(missing)} missing; send all joints, or set allow_partial_joints_goal"
        raise GoalError(Code.INVALID_JOINTS, text)


def made_path(selection: Selection, points: Points) -> Path:
    """The path through a goal's points; GoalError where they make none."""
    try:
        return make_path(selection.names, *points)
    except RequestError as error:
        raise GoalError(Code.INVALID_GOAL, str(error)) from error


def tolerances_of(
    board: Board, selection: Selection, known: Sequence[str], wishes: Wishes
) -> Tolerances:
    """The tolerances of a board's joints: those that a goal names, else those configured.

    Args:
        board: with its configuration.
        selection: of its joints.
        known: joints for which the goal may name tolerances.
        wishes: of the goal.

    Raises:
        GoalError: a wish that is not a number, or for a joint that is not there.
    """
    defaults = configured(board, selection.joints)
    try:
        return chosen(defaults, selection.names, known, **wishes._asdict())
    except RequestError as error:
        raise GoalError(Code.INVALID_GOAL, str(error)) from error


def check_start(board: Board | Robot, selection: Selection, path: Path, start: float) -> None:
    """Raise GoalError unless joints can follow a path that begins at this time of the board, s."""
    late = board.time - (start + path.duration)
    if late > 0.0:
        text = f"its last point was due {late:.3g} s ago; send a later stamp, or 0 for now"
        raise GoalError(Code.OLD_HEADER_TIMESTAMP, text)
    good = board.accepts[CommandKind.POSITION_DIRECT, selection.joints]
    if not good.all():  # the board counts them and says why
        others = [name for name, fine in zip(selection.names, good, strict=True) if not fine]
        refusal = board.set_position(others, path.positions[-1, ~good])
        raise GoalError(Code.INVALID_GOAL, refusal.message)


def configured(board: Board, joints: NDArray[np.intp]) -> Tolerances:
    """The tolerances that the parameters give; a goal's velocity is that of a joint at rest."""
    constraints, n = board.config.constraints, len(joints)
    own = [board.config.joints[j].constraints for j in joints]
    return Tolerances(
        path=np.array([[one.trajectory for one in own], [0.0] * n]),
        goal=np.array([[one.goal for one in own], [constraints.stopped_velocity_tolerance] * n]),
        goal_time=constraints.goal_time,
    )


def references(board: Board) -> Sample:
    """The references of a board's joints as they are, shapes (n,)."""
    state = board.state
    rows = (state.position_reference, state.velocity_reference, np.zeros(state.n))
    return Sample(*(row.copy() for row in rows))


class TrajectoryGoal:
    """A trajectory under way, or waiting for its start; see ``start_goal``.

    Args:
        follower: of the board that follows it.
        board: which moves.
        joints: indices, of the path's columns; all in POSITION_DIRECT.
        path: to follow.
        start: time of the board at which the path begins, s.
        tolerances: of the same joints.

    Attributes: joints, names (theirs), start, notes (what a limit cuts), outcome (None while it is
    under way), cancelled.
    """

    def __init__(
        self,
        follower: Follower,
        board: Board,
        joints: NDArray[np.intp],
        path: Path,
        start: float,
        tolerances: Tolerances,
    ) -> None:
        self._follower, self._board, self._tolerances = follower, board, tolerances
        self.joints, self._duration, self.start = joints, path.duration, start
        self._run = follower.take(joints, path, start, held=True)
        self.notes = list(cuts(board, self._run).values())
        self._before: Run | None = None  # what its joints follow until it begins
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
            self._judge(self._run.last)

    def cancel(self) -> None:
        """Stop the joints within their acceleration limits."""
        if self.outcome is None:
            self.cancelled = True
            self._end(Code.SUCCESSFUL, f"cancelled; {', '.join(self.names)} stopped")

    def preempt(self) -> None:
        """Stop the joints: a new goal is for others."""
        if self.outcome is None:
            self._end(Code.INVALID_GOAL, PREEMPTED)

    def take_over(self, old: TrajectoryGoal) -> None:
        """Preempt a goal: joints of both go on with it until this one begins, the others stop."""
        if old.outcome is not None:
            return
        if (before := old._acting()) is not None:
            before.held = False
            self._before = before
        others = old._followed()
        old._end(Code.INVALID_GOAL, PREEMPTED, others[~np.isin(others, self.joints)])

    def desired(self) -> Sample:
        """What the joints of the board shall do now, shapes (n,): outside the goal, references."""
        made = references(self._board)
        if self._run.last is not None:
            for whole, row in zip(made, self._run.last, strict=True):
                whole[self._run.joints] = row
        return made

    def _judge(self, last: Sample) -> None:
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
        if on_the_way and (found := excess(errors, limits.path)):
            text = f"{self._explain(found, 'path')}, {self.elapsed:.3g} s after the start"
            self._miss(Code.PATH_TOLERANCE_VIOLATED, text, errors, limits.path)
        elif late >= 0.0:
            found = excess(errors, limits.goal)
            if found is None:
                self._end(Code.SUCCESSFUL, summary([REACHED, *self.notes]), NOBODY)
                self._follower.leave(self._run)
            elif 0.0 < limits.goal_time < late:
                text = f"{self._explain(found, 'goal')}, {late:.3g} s after the last point"
                self._miss(Code.GOAL_TOLERANCE_VIOLATED, text, errors, limits.goal)

    def _explain(self, found: Excess, which: str) -> str:
        kind = self._board.config.joints[int(self.joints[found.column])].kind
        return explain(found, self.names[found.column], kind, which)

    def _miss(
        self, code: Code, text: str, errors: NDArray[np.float64], tolerances: NDArray[np.float64]
    ) -> None:
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
        if self._run.spline is None:
            self._follower.leave(self._run)
        self._follower.brake(joints, text, present)

    def _acting(self) -> Run | None:
        """Its run, or while that waits, the one of the goal before it; not what others sent."""
        return self._before if self._run.spline is None else self._run

    def _followed(self) -> NDArray[np.intp]:
        """The joints that still follow it."""
        run = self._acting()
        return run.joints if run is not None and self._follower.follows(run) else NOBODY

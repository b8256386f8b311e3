# SPDX-License-Identifier: Apache-2.0
"""Trajectories of a whole robot: one path, which the followers of its parts share (SPEC R3, T1).

A goal is checked whole before any part gets its share, and it ends whole: where a part fails, the
others stop. A part's own goals and the robot's take joints from each other, the newest one wins.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..protocols import Joints
from .board import Board
from .follower import Follower
from .path import Path, Points, Sample
from .reply import Reply, summary
from .robot import Robot
from .trajectory_goal import (
    PREEMPTED,
    REACHED,
    Code,
    End,
    TrajectoryGoal,
    Wishes,
    check_complete,
    check_start,
    made_path,
    references,
    selected,
    tolerances_of,
)


class RobotFollower:
    """Shares paths out among the parts of a robot, as :class:`Follower` has it for a board.

    Args:
        robot: whose joints follow.
        followers: of its parts, by name; somebody else steps them.
    """

    def __init__(self, robot: Robot, followers: Mapping[str, Follower]) -> None:
        self._robot = robot
        self._of = {robot.parts[name]: follower for name, follower in followers.items()}

    def follow(self, joints: Joints, path: Path, start: float) -> Reply:
        """As :meth:`Follower.follow`: joints in another mode are counted, the others follow."""
        late = self._robot.time - (start + path.duration)
        if late > 0.0:
            text = f"its last point was due {late:.3g} s ago; send a later stamp, or 0 for now"
            return self._robot.reject(joints, text)
        return self._robot.ask(
            joints, lambda s: self._of[s.board].follow(s.joints, path.of(s.places), start)
        )

    def stop(self, joints: Joints) -> Reply:
        """As :meth:`Follower.stop`."""
        return self._robot.ask(joints, lambda s: self._of[s.board].stop(s.joints))

    def hold(self, joints: Joints, why: str) -> None:
        """As :meth:`Follower.hold`."""
        robot = self._robot
        for share in robot.shares.of(robot.selector.select(joints)):
            self._of[share.board].hold(share.joints, why)

    def start_goal(
        self,
        joints: Joints,
        points: Points,
        start: float,
        wishes: Wishes = Wishes(),  # noqa: B008 - a tuple
    ) -> RobotGoal:
        """As :func:`start_goal`, for joints of several parts: all of them, or none.

        Raises:
            GoalError: with the code and the reason.
        """
        robot = self._robot
        whole = selected(robot.selector, joints)
        shares = robot.shares.of(whole)
        for share in shares:
            check_complete(share.board, share.selection.names)
        path = made_path(whole, points)
        tolerances = [
            tolerances_of(share.board, share.selection, robot.names, wishes) for share in shares
        ]
        check_start(robot, whole, path, start)
        return RobotGoal(
            robot,
            {
                share.board: TrajectoryGoal(
                    self._of[share.board],
                    share.board,
                    share.selection.joints,
                    path.of(share.places),
                    start,
                    own,
                )
                for share, own in zip(shares, tolerances, strict=True)
            },
        )


class RobotGoal:
    """A trajectory of several parts under way, as :class:`TrajectoryGoal` of one board.

    Args:
        robot: whose parts move.
        goals: of the parts that do, by their boards; all with the same start.

    Attributes: names, start, outcome (None while it is under way), cancelled.
    """

    def __init__(self, robot: Robot, goals: Mapping[Board, TrajectoryGoal]) -> None:
        self._robot, self._goals = robot, goals
        self.names = [name for goal in goals.values() for name in goal.names]
        self.start = next(iter(goals.values())).start
        self.outcome: End | None = None
        self.cancelled = False

    @property
    def elapsed(self) -> float:
        """Time since the start, s; negative before it."""
        return self._robot.time - self.start

    def check(self) -> None:
        """As :meth:`TrajectoryGoal.check`; where a part fails, the other parts stop."""
        for goal in self._goals.values():
            goal.check()
        if self.outcome is not None:
            return
        ends = [goal.outcome for goal in self._goals.values()]
        failed = [end for end in ends if end is not None and end.code is not Code.SUCCESSFUL]
        if failed:
            self._stop()
            self.outcome = failed[0]
            return
        if None not in ends:
            notes = [note for goal in self._goals.values() for note in goal.notes]
            self.outcome = End(Code.SUCCESSFUL, summary([REACHED, *notes]))

    def cancel(self) -> None:
        """Stop the joints of all parts within their acceleration limits."""
        if self.outcome is None:
            self.cancelled = True
            self._stop()
            text = f"cancelled; {', '.join(self.names)} stopped"
            self.outcome = End(Code.SUCCESSFUL, text)

    def take_over(self, old: RobotGoal) -> None:
        """Preempt a goal: joints of both go on with it until this one begins, the others stop."""
        if old.outcome is not None:
            return
        for board, goal in old._goals.items():
            if board in self._goals:
                self._goals[board].take_over(goal)
            else:
                goal.preempt()
        old.outcome = End(Code.INVALID_GOAL, PREEMPTED)

    def desired(self) -> Sample:
        """What the joints of the robot shall do now, shapes (n,): outside the goal, references."""
        samples = [
            self._goals[board].desired() if board in self._goals else references(board)
            for board in self._robot.parts.values()
        ]
        return Sample(*(np.concatenate(rows) for rows in zip(*samples, strict=True)))

    def _stop(self) -> None:
        """End what is under way in any part."""
        for goal in self._goals.values():
            goal.cancel()

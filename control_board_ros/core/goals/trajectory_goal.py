# SPDX-License-Identifier: Apache-2.0
"""Trajectories that are followed in POSITION_DIRECT, joint by joint (SPEC T1 to T4, M4).

A board has one follower, also for the joints of its parts. Its owner calls, between two cycles,
``follow`` for a new path, ``stop`` to stop joints, ``check`` after every request, and ``step``
before every tick. A goal ends within tolerances (SPEC T1 to T3)::

    goal = start_goal(follower, board, ["elbow"], points, board.time)
    while goal.outcome is None:
        measurement = plant.read()
        goal.check()
        follower.step(measurement.time)
        plant.write(board.tick(measurement))
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..group import JointGroup
from ..machine.explanations import explain_cut
from ..selection import RequestError, Selection
from ..terms.arguments import Array, Joints
from ..terms.joint_kind import JointKind
from ..terms.reply import JointAnswer, Reason, Reply, accepted, decided, summary
from ..terms.vocabs import CommandKind
from .path import (
    QUANTITIES,
    SAME_TIME,
    Bools,
    Excess,
    Path,
    Points,
    Run,
    Sample,
    Spline,
    Tolerances,
    Wishes,
    braking,
    excess,
    explain,
    goal_tolerances,
    make_path,
)

#: Why joints leave a path for a newer one.
REPLACED_BY_PATH = "replaced by another trajectory"


#: One turn of a continuous joint, rad.
TURN = 2.0 * math.pi
#: Paths that wait for their start at most; of more, the one that would begin first is left out.
MAX_WAITING = 100


class Follower:
    """Follows paths, each for joints of its own; a joint follows the newest one."""

    def __init__(self, board: JointGroup) -> None:
        self.board = board
        self._runs: list[Run] = []
        self._version = board.state.modes_version
        # The last direct positions of this follower: different ones are other commands'.
        self._known = self._last.copy()
        self._stops = board.state.stops.copy()

    @property
    def _last(self) -> Array:
        """The last direct positions that the board accepted, shape (n,)."""
        row: Array = self.board.engine.references.last[CommandKind.POSITION_DIRECT]
        return row

    @property
    def busy(self) -> bool:
        """Whether any path is active or waiting."""
        return bool(self._runs)

    def follow(self, joints: Joints, path: Path, start: float) -> Reply:
        """Follow a path from a time on (SPEC M4, T1).

        Until a start in the future the joints continue their present motion; past points of a
        path are left out. The path begins at the reference then in force, with its velocity.

        Args:
            joints: of the path's columns.
            path: to follow.
            start: time of the board at which the path begins, s.

        Returns:
            False where joints are not in POSITION_DIRECT (the others follow), where all of the
            path is past, or where joints are missing that may not be. Its message also reports the
            effect of limits.
        """
        board = self.board
        self.check()
        selection = board.selector.select(joints)
        if text := incomplete(board, selection.names) or overdue(board, path, start):
            return board.reject(selection.names, text)
        path = at_nearest_turn(board, selection, path)
        good, refusal = admitted(board, selection, path)
        verdicts = dict.fromkeys(selection.names, JointAnswer())
        verdicts |= zip(refusal.joints, refusal.each(), strict=True)
        if good.any():
            run = self.take(selection.joints[good], path.of(good), start)
            verdicts |= {name: JointAnswer(text=text) for name, text in cuts(board, run).items()}
        return decided(tuple(verdicts), list(verdicts.values()))

    def take(
        self, joints: NDArray[np.intp], path: Path, start: float, *, held: bool = False
    ) -> Run:
        """Follow a path, as :meth:`follow`, with joints that are known to be in POSITION_DIRECT.

        ``held``: stay at the last point, and watch the joints, until the run is ended.
        """
        board = self.board
        run = Run(joints, [board.state.interaction_modes[j] for j in joints], path, start, held)
        self._begin_due(board.time)
        self._supersede(joints, start)
        self._known[joints] = self._last[joints]
        self._stops[joints] = board.state.stops[joints]
        self._runs.append(run)
        return run

    def follows(self, run: Run) -> bool:
        """Whether a run is active or waiting."""
        return any(other is run for other in self._runs)

    def leave(self, run: Run) -> None:
        """End a run without a log entry: its joints hold its last reference."""
        self._runs = [other for other in self._runs if other is not run]

    def brake(self, joints: NDArray[np.intp], why: str, present: Sample | None = None) -> None:
        """End the paths of joints, and brake them at their acceleration limits.

        Args:
            joints: indices, shape (k,).
            why: for the log.
            present: state at which they begin to brake, shape (k,); None: at their references.
        """
        if not joints.size:
            return
        board = self.board
        references, rates = board.state.position_reference, board.state.velocity_reference
        if present is None:
            present = Sample(references[joints], rates[joints], np.zeros(len(joints)))
        self.end(joints.tolist(), why)
        for k, j in enumerate(joints.tolist()):
            path = braking(
                float(present.positions[k]),
                float(present.velocities[k]),
                board.config.joints[j].limits.acceleration,
            )
            self.take(joints[k : k + 1], path, board.time)

    def end(self, joints: Joints, why: str) -> None:
        """End the paths of joints; ``why`` goes to the log."""
        indices = self.board.selector.select(joints).joints
        for run in list(self._runs):
            self._drop(run, np.isin(run.joints, indices), why)

    def stop(self, group: JointGroup, joints: Joints) -> Reply:
        """Stop joints of a group (P3), and end their paths."""
        reply = group.stop(joints)
        self.check()
        return reply

    def hold(self, joints: Joints, why: str) -> None:
        """End the paths of joints, and hold their present references at rest."""
        board = self.board
        indices = board.selector.select(joints).joints
        followed = {int(j) for run in self._runs if run.spline is not None for j in run.joints}
        moving = [j for j in indices.tolist() if j in followed]
        self.end(joints, why)
        if moving:
            zeros = np.zeros(len(moving))
            send(board, moving, Sample(board.state.position_reference[moving], zeros, zeros))

    def check(self) -> None:
        """End the paths of joints that stopped, changed modes, or received other positions."""
        board = self.board
        if not self._runs:
            self._version = board.state.modes_version
            return
        stopped = board.state.stops != self._stops
        if stopped.any():
            self._stops[:] = board.state.stops
            for run in list(self._runs):
                self._drop(run, stopped[run.joints], "stopped")
        taken = self._last != self._known
        if taken.any():
            for run in list(self._runs):
                self._drop(run, taken[run.joints], "replaced by another direct position")
        if board.state.modes_version != self._version:
            self._version = board.state.modes_version
            for run in list(self._runs):
                self._check_modes(run)

    def step(self, time: float) -> None:
        """Send the references of a cycle.

        Args:
            time: of the reading of the next tick, s; ``board.time`` is that of the last.
        """
        if not self._runs:
            return
        self.check()
        self._begin_due(time)
        for run in list(self._runs):
            if run.spline is not None:
                self._send(run, time)

    def _begin_due(self, time: float) -> None:
        """Begin the paths whose time has come, the earliest first."""
        due = [r for r in self._runs if r.spline is None and time >= r.start - SAME_TIME]
        for run in sorted(due, key=lambda waiting: waiting.start):
            self._begin(run)

    def _check_modes(self, run: Run) -> None:
        board = self.board
        kept = board.state.accepts[CommandKind.POSITION_DIRECT, run.joints]
        if not kept.all():
            j = int(run.joints[~kept][0])
            self._drop(run, ~kept, f"{board.names[j]} is in {board.state.control_modes[j].name}")
        changed = np.array(
            [
                board.state.interaction_modes[j] is not mode
                for j, mode in zip(run.joints, run.interactions, strict=True)
            ],
            dtype=bool,
        )
        self._drop(run, changed, "the interaction mode changed")

    def _begin(self, run: Run) -> None:
        """Join the path at its present point; its joints leave their former paths."""
        board, joints = self.board, run.joints
        present = Sample(
            board.state.position_reference[joints],
            board.state.velocity_reference[joints],
            self._accelerations()[joints],
        )
        self._release(joints, run)
        run.path = run.path.joined(board.time - run.start, present)
        run.spline = Spline(run.path)

    def _accelerations(self) -> Array:
        """Accelerations of the last references, shape (n,), rad/s²; 0 without a path."""
        accelerations = np.zeros(self.board.count)
        for run in self._runs:
            if run.last is not None:
                accelerations[run.joints] = run.last.accelerations
        return accelerations

    def _send(self, run: Run, time: float) -> None:
        assert run.spline is not None
        elapsed = time - run.start
        run.last = run.spline.at(elapsed)
        joints = run.joints.tolist()
        reply = send(self.board, joints, run.last)
        self._known[run.joints] = self._last[run.joints]
        if not reply:
            self._drop(run, np.ones(len(joints), dtype=bool), reply.message)
        elif elapsed >= run.path.duration and not run.held:
            self._runs.remove(run)

    def _supersede(self, joints: NDArray[np.intp], start: float) -> None:
        """Joints leave the paths that would begin no sooner than a newer one, s (T5)."""
        for run in list(self._runs):
            if run.spline is None and run.start >= start - SAME_TIME:
                self._drop(run, np.isin(run.joints, joints), REPLACED_BY_PATH, quiet=True)
        waiting = [run for run in self._runs if run.spline is None]
        if len(waiting) >= MAX_WAITING:
            self.leave(min(waiting, key=lambda run: run.start))

    def _release(self, joints: NDArray[np.intp], newer: Run) -> None:
        """Joints leave the paths that run, for one that begins."""
        for run in list(self._runs):
            if run.spline is not None and run is not newer:
                self._drop(run, np.isin(run.joints, joints), REPLACED_BY_PATH, quiet=True)

    def _drop(self, run: Run, columns: Bools, why: str, *, quiet: bool = False) -> None:
        """Remove joints from a run, with the reason."""
        if not columns.any():
            return
        names = [self.board.names[j] for j in run.joints[columns]]
        run.left = run.left or f"{', '.join(names)}: {why}"
        if not quiet:
            text = f"trajectory of {', '.join(names)} ended: {why}"
            self.board.engine.events.add("info", "trajectory", names[0], text)
        if columns.all():
            self._runs.remove(run)
        else:
            run.keep(~columns)


def incomplete(board: JointGroup, names: Sequence[str]) -> str:
    """Why parts of a board refuse a trajectory for these joints only; empty where they accept."""
    for zone in board.config.zones():
        missing = [name for name in zone.config.names if name not in names]
        some = 0 < len(missing) < len(zone.joints)
        if some and not zone.config.allow_partial_joints_goal:
            text = f"{', '.join(missing)} missing"
            return f"{text}; send all joints, or set allow_partial_joints_goal"
    return ""


def at_nearest_turn(board: JointGroup, selection: Selection, path: Path) -> Path:
    """A path whose first point is at the nearest turn of each continuous joint (T4)."""
    joints = selection.joints
    kinds = [board.config.joints[j].kind for j in selection.numbers]
    endless = np.array([kind is JointKind.CONTINUOUS for kind in kinds])
    if not endless.any():
        return path
    away = board.state.position_reference[joints] - path.positions[0]
    return path.shifted(np.where(endless, TURN * np.round(away / TURN), 0.0))


def overdue(board: JointGroup, path: Path, start: float) -> str:
    """Why a path that begins at a time of the board, s, is past; empty where it is not."""
    late = board.time - (start + path.duration)
    if late <= 0.0:
        return ""
    return f"its last point was due {late:.3g} s ago; send a later stamp, or 0 for now"


def admitted(board: JointGroup, selection: Selection, path: Path) -> tuple[Bools, Reply]:
    """Which joints of a path accept it, shape (k,), and the refusal of the others.

    Those are in POSITION_DIRECT, and all their points within the limits where the board refuses
    others (P9). The others count it as a rejected direct position (M4), and so do those whose
    stream of paths is void (F8, X2).
    """
    kind, commands = CommandKind.POSITION_DIRECT, board.engine.commands
    streams = board.engine.machine.streams
    within = commands.within(kind, selection.joints, path.positions)
    good: Bools = board.state.accepts[kind, selection.joints] & within.all(axis=0)
    stale = streams.void(kind, selection.joints, path.positions[0], good)
    streams.note(selection.joints)
    if stale is not None:
        good &= [reason is Reason.NONE for reason in stale]
    others = [name for name, fine in zip(selection.names, good, strict=True) if not fine]
    if not others:  # none named would mean all
        return good, accepted(())
    worst = path.positions[within.argmin(axis=0), np.arange(len(good))]
    return good, board.set_position(others, worst[~good])


def cuts(board: JointGroup, run: Run) -> dict[str, str]:
    """The effects of limits on a path, by joint."""
    texts = {
        board.names[j]: explain_cut(board.config.joints[j], run.path.positions[:, k].tolist())
        for k, j in enumerate(run.joints)
    }
    return {name: text for name, text in texts.items() if text}


def send(board: JointGroup, joints: list[int], sample: Sample) -> Reply:
    """Command the references of a cycle."""
    kind = CommandKind.POSITION_DIRECT
    return board.command(kind, joints, sample.positions, sample.velocities, sampled=True)


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

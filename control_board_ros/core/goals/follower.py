# SPDX-License-Identifier: Apache-2.0
"""Paths that are followed in POSITION_DIRECT, joint by joint (SPEC T1, T4, T5, M4).

A board has one follower, also for the joints of its parts. Its owner calls, between two cycles,
``follow`` for a new path, ``stop`` to stop joints, ``check`` after every request, and ``step``
before every tick.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..group import JointGroup
from ..machine.explanations import explain_cut
from ..selection import Selection
from ..terms.arguments import Array, Joints
from ..terms.joint_kind import JointKind
from ..terms.reply import JointAnswer, Reason, Reply, accepted, decided
from ..terms.vocabs import CommandKind
from .path import (
    SAME_TIME,
    Bools,
    Path,
    Run,
    Sample,
    Spline,
    braking,
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

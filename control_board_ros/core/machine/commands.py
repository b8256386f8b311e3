# SPDX-License-Identifier: Apache-2.0
"""The references of users: fire and forget, joint by joint (SPEC M3, M4, M11, P).

One row of COMMANDS per kind holds all differences between the kinds. A reference that the mode of
its joint does not accept, or that is not a finite number, is ignored and counted; the other joints
of the same command are served.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..config.config import BoardConfig, BoardLimits
from ..laws.references import Moves, References
from ..selection import RequestError, Selection, spread
from ..state import Indices
from ..terms.arguments import Array, Values
from ..terms.reply import Answer, JointAnswer, Reason, Reply, decided
from ..terms.vocabs import CommandKind
from .decisions import decide_reference
from .explanations import (
    LEAST_RATE,
    all_or_none,
    explain_bound,
    explain_reference,
    explain_refused,
    explain_slower,
    range_text,
)
from .machine import Machine

K = CommandKind
#: References that a limit's decimals cut by less than this are within: rad, m, percent, …
LIMIT_TOLERANCE = 1e-6
#: Targets of a joint without limits are up to this, rad or m: moves end within LONGEST.
FARTHEST = 1e6
#: Effects of limits on references, by joint.
Notes = dict[int, str]
Start = Callable[[References, Indices, Array, Any], Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """One kind of reference.

    Attributes: field (its name in messages), limit (attribute of BoardLimits: it is bounded to
    ± that; None: to lower and upper, a position), start (what it starts), timeout (attribute of
    Timeouts; None: it never expires), along (name of the accompanying value in messages),
    standing (attribute of References: the stored value where none is given; values are then
    LEAST_RATE or more), along_limit (attribute of BoardLimits: the greatest accompanying value).
    """

    field: str
    start: Start
    limit: str | None = None
    timeout: str | None = None
    along: str | None = None
    standing: str | None = None
    along_limit: str | None = None


COMMANDS = {
    K.POSITION: Command(  # P1
        field="positions",
        start=References.move,
        along="speeds",
        standing="speed",
        along_limit="velocity",
    ),
    K.POSITION_DIRECT: Command(  # P4
        field="positions", start=References.step, along="velocities", along_limit="velocity"
    ),
    K.VELOCITY: Command(  # P5
        field="velocities",
        start=References.ramp,
        limit="velocity",
        timeout="velocity",
        along="accelerations",
        standing="acceleration",
        along_limit="acceleration",
    ),
    K.TORQUE: Command(  # P7
        field="torques", start=References.set_torque, limit="torque", timeout="torque"
    ),
    K.OUTPUT: Command(  # P8
        field="outputs", start=References.set_output, limit="output", timeout="output"
    ),
    K.VELOCITY_DIRECT: Command(  # Y1
        field="velocities",
        start=References.set_velocity,
        limit="velocity",
        timeout="velocity",
    ),
    K.CURRENT: Command(  # Y2
        field="currents", start=References.set_current, limit="current", timeout="current"
    ),
}


def timeout_cycles(config: BoardConfig) -> Array:
    """How long references last (P12), cycles, shape (kinds, n); infinite: they never expire."""
    cycles = np.full((len(K), len(config.joints)), np.inf)
    for kind, row in COMMANDS.items():
        if row.timeout is None:
            continue
        lasting = [getattr(joint.timeouts, row.timeout) for joint in config.joints]
        cycles[kind] = [
            in_cycles(seconds, config.period) if seconds > 0.0 else np.inf for seconds in lasting
        ]
    return cycles


def in_cycles(seconds: float, period: float) -> float:
    """A duration in control cycles, rounded up."""
    return float(np.ceil(seconds / period - 1e-9))


class Commands:
    """Checks references joint by joint, starts the valid ones, counts the others."""

    def __init__(self, machine: Machine, limits: BoardLimits) -> None:
        self._machine = machine
        self._state, self._references = machine.state, machine.references
        self.reconfigure(limits)

    def reconfigure(self, limits: BoardLimits) -> None:
        """Apply new limits."""
        self._refused = limits.refused if limits.refused.any() else None
        self._low, self._high, self._along_limits = (
            dict.fromkeys(K, limits.lower) for _ in range(3)
        )
        lower, upper = (
            np.clip(ends, -FARTHEST, FARTHEST) for ends in (limits.lower, limits.upper)
        )
        for kind, row in COMMANDS.items():
            high = upper if row.limit is None else getattr(limits, row.limit)
            self._high[kind] = high
            self._low[kind] = lower if row.limit is None else -high
            if row.along_limit is not None:
                self._along_limits[kind] = getattr(limits, row.along_limit)

    def command(
        self,
        kind: CommandKind,
        selection: Selection,
        values: Values,
        along: Values | None,
        *,
        together: bool,
        time: float | None,
        valid_for: float,
        sampled: bool = False,
    ) -> Reply:
        """Start references of one kind; COMMANDS names their accompanying values.

        Args:
            kind: of the references.
            selection: the joints.
            values: the references, one for all joints or one each.
            along: likewise; None: as set.
            together: whether all joints accept their references or none does.
            time: s after which position moves arrive, all at once (R5), no less than
                ``get_move_time`` returns; None: each at its own.
            valid_for: s until these references expire (P12); 0: the timeouts of the joints.
            sampled: of a path whose points are already checked, no stream of a program: bounded,
                never refused.

        Raises:
            RequestError: lengths that do not fit, or a value that this kind does not have.
        """
        if valid_for:
            check_valid_for(kind, valid_for)
        requested = spread(values, len(selection.names), f"{kind} references")
        along = None if along is None else spread_along(kind, along, len(selection.names))
        extra = self._standing(kind, selection) if along is None else along
        indices = selection.joints
        good = self._state.accepts[kind, indices] & np.isfinite(requested)
        if along is not None:
            good &= self._fits(kind, indices, along)
        stale = None
        if not sampled:
            if self._refused is not None:
                good &= self.within(kind, indices, requested)
            stale = self._machine.streams.void(kind, indices, requested, good)
            self._machine.streams.note(indices)
        if stale is not None:
            good &= np.equal(stale, Reason.NONE)
        answers: list[JointAnswer] = []
        if not good.all():
            answers = self._judged(kind, selection, requested, along, stale)
            if together:
                return decided(selection.names, all_or_none(answers))
            indices, requested = indices[good], requested[good]
            extra = None if extra is None else extra[good]
        bounded, notes = requested, Notes()
        if indices.size:
            bounded, notes = self._start(kind, indices, requested, extra, time, valid_for)
        if not (answers or notes):
            all_accepted = (Answer.ACCEPTED,) * len(selection.names)
            return Reply(selection.names, all_accepted, values=tuple(bounded.tolist()))
        started = dict(zip(indices.tolist(), bounded.tolist(), strict=True))
        answers = answers or [JointAnswer()] * len(selection.names)
        return reply_of(selection, answers, started, notes)

    def get_move_time(self, indices: Indices, positions: Array, speeds: Array) -> Array:
        """The duration of position moves that start now (P1), s, shape (k,)."""
        bounded = self._taken(indices, positions)
        return np.array(self._references.plan_moves(indices, bounded, speeds).times)

    def _taken(self, indices: Indices, positions: Array) -> Array:
        """Targets within the software limits (P9)."""
        return np.clip(positions, self._low[K.POSITION][indices], self._high[K.POSITION][indices])

    def _standing(self, kind: CommandKind, selection: Selection) -> Array | None:
        """The stored accompanying values, one per joint; None: the kind has none."""
        if (name := COMMANDS[kind].standing) is None:
            return None
        standing: Array = getattr(self._references, name)
        return standing[selection.joints]

    def _fits(self, kind: CommandKind, indices: Indices, extra: Array) -> NDArray[np.bool_]:
        """Whether accompanying values are in range: from the least to the most, or finite."""
        if COMMANDS[kind].standing is None:
            return np.isfinite(extra)
        return (extra >= LEAST_RATE) & (extra <= self._along_limits[kind][indices])

    def _start(
        self,
        kind: CommandKind,
        indices: Indices,
        requested: Array,
        extra: Array | None,
        time: float | None,
        valid_for: float,
    ) -> tuple[Array, Notes]:
        """Start references within the limits.

        Returns:
            The references in force, and the effects of limits.
        """
        row, references = COMMANDS[kind], self._references
        bounded = np.minimum(
            np.maximum(requested, self._low[kind][indices]), self._high[kind][indices]
        )
        starts = self._state.position_reference[indices]
        notes: Notes = {}
        if time is not None:
            ways = np.abs(bounded - starts)
            moves = references.move_within(indices, bounded, time)
            notes = self._slower(indices, ways, ways / time if time > 0.0 else ways, moves)
        else:
            moves = row.start(references, indices, bounded, extra)
            if moves is not None and extra is not None:
                notes = self._slower(indices, np.abs(bounded - starts), extra, moves)
        if not same(requested, bounded):
            notes |= self._limit_notes(kind, indices, requested, bounded)
        references.last[kind, indices] = bounded
        if row.timeout is not None:
            period = self._machine.config.period
            timeout = in_cycles(valid_for, period) if valid_for else None
            self._machine.timeouts.renew(kind, indices, self._state.clock + 1.0, timeout)
        return bounded, notes

    def _limit_notes(
        self, kind: CommandKind, indices: Indices, requested: Array, bounded: Array
    ) -> Notes:
        """Effect of limits on references (P1, P9, P14)."""
        joints = self._machine.config.joints
        return {
            j: explain_bound(joints[j], kind, sent, bound)
            for j, sent, bound in zip(
                indices.tolist(), requested.tolist(), bounded.tolist(), strict=True
            )
            if sent != bound
        }

    def _slower(self, indices: Indices, ways: Array, speeds: Array, moves: Moves) -> Notes:
        """Where limits make a move slower than requested (P1)."""
        notes = {}
        joints = self._machine.config.joints
        started = dict(
            zip(moves.joints, zip(moves.times, moves.factors, strict=True), strict=True)
        )
        for j, way, speed in zip(indices.tolist(), ways.tolist(), speeds.tolist(), strict=True):
            if j not in started:  # it was under way
                continue
            time, factor = started[j]
            if text := explain_slower(joints[j], way, speed, time, factor=factor):
                notes[j] = text
        return notes

    def within(self, kind: CommandKind, indices: Indices, requested: Array) -> NDArray[np.bool_]:
        """Whether references lie within the limits, or are bounded where they do not."""
        if self._refused is None:
            return np.ones(requested.shape, dtype=np.bool_)
        low, high = self._low[kind][indices], self._high[kind][indices]
        inside = (low - LIMIT_TOLERANCE <= requested) & (requested <= high + LIMIT_TOLERANCE)
        return inside | ~self._refused[indices]

    def _judged(
        self,
        kind: CommandKind,
        selection: Selection,
        requested: Array,
        along: Array | None,
        stale: Sequence[Reason] | None,
    ) -> list[JointAnswer]:
        """The answer of each joint; ignored references are counted (M4)."""
        answers = []
        fits = (
            np.ones(requested.shape, bool)
            if along is None
            else self._fits(kind, selection.joints, along)
        )
        within = self.within(kind, selection.joints, requested)
        for k, j in enumerate(selection.joints.tolist()):
            facts = self._machine.facts(j)
            values = (
                (float(requested[k]),) if along is None else (float(requested[k]), float(along[k]))
            )
            inside = bool(fits[k] and within[k])
            void = Reason.NONE if stale is None else stale[k]
            verdict = decide_reference(facts, kind, values, fits=inside, void=void)
            self._state.rejected[j] += np.uint64(not verdict.accepts)
            if fits[k]:
                bounds = float(self._low[kind][j]), float(self._high[kind][j])
                allowed = explain_refused(facts.joint, kind, values[0], bounds)
            else:
                what, highest = COMMANDS[kind].along, float(self._along_limits[kind][j])
                unit = f"{facts.joint.kind.unit}/{'s' if kind is K.POSITION else 's²'}"
                allowed = range_text(what, values[-1], highest, unit)
            text = explain_reference(verdict.reason, facts, kind, values, allowed)
            answers.append(JointAnswer(verdict.answer, text, verdict.reason))
        return answers


def reply_of(
    selection: Selection, answers: Sequence[JointAnswer], started: dict[int, float], notes: Notes
) -> Reply:
    """The reply to references: those started, as bounded, and the notes on them."""
    order = selection.numbers
    texts = [
        JointAnswer(text=notes[j]) if j in notes else answer
        for j, answer in zip(order, answers, strict=True)
    ]
    values = tuple(started.get(j, math.nan) for j in order)
    return replace(decided(selection.names, texts), values=values)


def spread_along(kind: CommandKind, along: Values, count: int) -> Array:
    """Values that accompany references of a kind, one per joint.

    Raises:
        RequestError: the length does not fit, or the kind has none.
    """
    what = COMMANDS[kind].along
    if what is None:
        raise RequestError("nothing comes along with it; send the values alone")
    return spread(along, count, what)


def check_valid_for(kind: CommandKind, valid_for: float) -> None:
    """Check a timeout that references bring (P12), s; 0: they bring none.

    Raises:
        RequestError: it is no duration, or references of this kind do not expire.
    """
    if not (math.isfinite(valid_for) and valid_for >= 0.0):
        raise RequestError(
            f"valid_for must be 0 or a time in s, not {valid_for:g}", Reason.OUT_OF_RANGE
        )
    if valid_for and COMMANDS[kind].timeout is None:
        raise RequestError(f"a {kind} reference does not expire; send it with valid_for 0")


def same(a: Array, b: Array) -> bool:
    """Whether two arrays of numbers are equal to the bit; a tenth of the time of numpy's ==."""
    return a.tobytes() == b.tobytes()

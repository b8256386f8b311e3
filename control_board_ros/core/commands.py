# SPDX-License-Identifier: Apache-2.0
"""The references of users: fire and forget, joint by joint (SPEC M3, M4, M11, P).

One row of COMMANDS per kind says all that differs between the kinds. What the mode of a joint
does not take, and what is not a finite number, is ignored and counted; the other joints of the
same command are served.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..protocols import Floats, Joints, Values
from .config import BoardConfig
from .decisions import decide_reference
from .explanations import explain_bound, explain_reference, explain_slower, range_text
from .limits import BoardLimits
from .machine import Machine
from .measurement import Array
from .references import References
from .reply import Answer, Reply, accepted, decided, refused
from .selection import RequestError, Selection, Selector, spread
from .state import Indices
from .vocabs import CommandKind

K = CommandKind
#: What will be done instead of what was asked for, by joint.
Notes = dict[int, str]
Start = Callable[[References, Indices, Floats, Any], Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """One kind of reference.

    Attributes: field (its name in messages), limit (attribute of BoardLimits: it is bounded to
    ± that; None: to lower and upper, a position), start (what it starts), timeout (attribute of
    Timeouts; None: it never expires), along (what may come along, as messages name it), standing
    (attribute of References: what stands where none comes along, which then must be above 0),
    most (attribute of BoardLimits: the greatest that may come along).
    """

    field: str
    start: Start
    limit: str | None = None
    timeout: str | None = None
    along: str | None = None
    standing: str | None = None
    most: str | None = None


COMMANDS = {
    K.POSITION: Command(  # P1
        field="positions",
        start=References.move,
        along="speeds",
        standing="speed",
        most="velocity",
    ),
    K.POSITION_DIRECT: Command(  # P4
        field="positions", start=References.step, along="velocities", most="velocity"
    ),
    K.VELOCITY: Command(  # P5
        field="velocities",
        start=References.ramp,
        limit="velocity",
        timeout="velocity",
        along="accelerations",
        standing="acceleration",
        most="acceleration",
    ),
    K.TORQUE: Command(  # P7
        field="torques", start=References.set_torque, limit="torque", timeout="torque"
    ),
    K.OUTPUT: Command(  # P8
        field="outputs", start=References.set_output, limit="output", timeout="output"
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
            np.ceil(seconds / config.period - 1e-9) if seconds > 0.0 else np.inf
            for seconds in lasting
        ]
    return cycles


class Commands:
    """Checks references joint by joint, starts what is good, counts the rest.

    Args:
        machine: whose joints are commanded.
        selector: of the same joints.
        limits: likewise.
    """

    def __init__(self, machine: Machine, selector: Selector, limits: BoardLimits) -> None:
        self._machine, self._selector = machine, selector
        self._state, self._references = machine.state, machine.references
        self.reconfigure(limits)

    def reconfigure(self, limits: BoardLimits) -> None:
        """Take new limits."""
        self._limits = limits
        self._low, self._high, self._most = (dict.fromkeys(K, limits.lower) for _ in range(3))
        for kind, row in COMMANDS.items():
            high = limits.upper if row.limit is None else getattr(limits, row.limit)
            self._high[kind] = high
            self._low[kind] = limits.lower if row.limit is None else -high
            if row.most is not None:
                self._most[kind] = getattr(limits, row.most)

    def command(
        self, kind: CommandKind, joints: Joints, values: Values, along: Values | None = None
    ) -> Reply:
        """Send references of one kind; see COMMANDS for what comes along."""
        row = COMMANDS[kind]
        try:
            selection = self._selector.select(joints)
            count = len(selection.names)
            asked = spread(values, count, f"{kind} references")
            extra = self._along(row, selection, along)
        except RequestError as error:
            return self.reject(joints, f"{kind} reference ignored: {error}")
        chosen = selection.joints
        good = self._state.accepts[kind, chosen] & np.isfinite(asked)
        if along is not None and extra is not None:
            good &= self._fits(kind, chosen, extra)
        verdicts = []
        if not good.all():
            verdicts = self._ignored_references(
                kind, selection, asked, None if along is None else extra
            )
            chosen, asked = chosen[good], asked[good]
            extra = None if extra is None else extra[good]
        notes = self._start(kind, chosen, asked, extra) if chosen.size else {}
        if not (verdicts or notes):
            return accepted(selection.names)
        verdicts = verdicts or [(Answer.ACCEPTED, "")] * count
        for k, j in enumerate(selection.joints.tolist()):
            if j in notes:
                verdicts[k] = (Answer.ACCEPTED, notes[j])
        return decided(selection.names, verdicts)

    def get_move_time(self, joints: Joints, positions: Floats, speeds: Floats) -> Floats:
        """How long position moves would take from now on (P1), s, shape (k,).

        Args:
            joints: as in every request.
            positions: targets, shape (k,).
            speeds: mean speeds asked for, above 0, shape (k,).
        """
        chosen = self._selector.select(joints).joints
        return self._references.move_times(chosen, self._taken(chosen, positions), speeds)

    def position_move_within(self, joints: Joints, positions: Floats, time: float) -> Reply:
        """Start position moves that all arrive after so many s, or none (R5).

        Args:
            joints: as in every request.
            positions: targets, shape (k,).
            time: s, no less than ``get_move_time`` says.
        """
        selection = self._selector.select(joints)
        chosen = selection.joints
        if not (self._state.accepts[K.POSITION, chosen] & np.isfinite(positions)).all():
            verdicts = self._ignored_references(K.POSITION, selection, positions, None)
            return decided(selection.names, verdicts)
        taken = self._taken(chosen, positions)
        self._references.move_within(chosen, taken, time)
        self._references.last[K.POSITION, chosen] = taken
        notes = self._bounded(K.POSITION, chosen, positions, taken)
        verdicts = [(Answer.ACCEPTED, notes.get(j, "")) for j in chosen.tolist()]
        return decided(selection.names, verdicts)

    def _taken(self, chosen: Indices, positions: Floats) -> Floats:
        """Targets within the software limits (P9)."""
        return np.clip(positions, self._low[K.POSITION][chosen], self._high[K.POSITION][chosen])

    def reject(self, joints: Joints, message: str) -> Reply:
        """Refuse a command that is wrong as a whole; the joints it does name count it (P13)."""
        self._state.rejected[self._selector.known(joints)] += np.uint64(1)
        return refused(message)

    def _along(self, row: Command, selection: Selection, along: Values | None) -> Floats | None:
        """What comes along with references, one per joint; what stands where nothing does."""
        if along is not None:
            assert row.along is not None
            return spread(along, len(selection.names), row.along)
        if row.standing is None:
            return None
        standing: Floats = getattr(self._references, row.standing)
        return standing[selection.joints]

    def _fits(self, kind: CommandKind, chosen: Indices, extra: Floats) -> NDArray[np.bool_]:
        """Whether what comes along may: above 0 up to the most, or any finite number."""
        if COMMANDS[kind].standing is None:
            return np.isfinite(extra)
        return (extra > 0.0) & (extra <= self._most[kind][chosen])

    def _start(
        self, kind: CommandKind, chosen: Indices, asked: Floats, extra: Floats | None
    ) -> Notes:
        """Start references within the limits; what is done instead of what was asked for."""
        row, references = COMMANDS[kind], self._references
        taken = np.minimum(np.maximum(asked, self._low[kind][chosen]), self._high[kind][chosen])
        if row.standing is None and extra is not None:
            most = self._most[kind][chosen]
            extra = np.clip(extra, -most, most)
        times = row.start(references, chosen, taken, extra)
        notes = self._slower(chosen, taken, extra, times) if times and extra is not None else {}
        if not same(asked, taken):
            notes |= self._bounded(kind, chosen, asked, taken)
        references.last[kind, chosen] = taken
        if row.timeout is not None:
            self._machine.timeouts.renew(kind, chosen, self._state.cycle)
        return notes

    def _bounded(self, kind: CommandKind, chosen: Indices, asked: Floats, taken: Floats) -> Notes:
        """What a limit made of references (P1, P9, P14)."""
        joints = self._machine.config.joints
        return {
            j: explain_bound(joints[j], kind, one, other)
            for j, one, other in zip(chosen.tolist(), asked.tolist(), taken.tolist(), strict=True)
            if one != other
        }

    def _slower(
        self, chosen: Indices, targets: Floats, speeds: Floats, times: Sequence[float]
    ) -> Notes:
        """Where speed and acceleration limits make a move slower than asked for (P1)."""
        notes = {}
        ways = np.abs(targets - self._state.position_reference[chosen])
        for j, way, speed, time in zip(
            chosen.tolist(), ways.tolist(), speeds.tolist(), times, strict=True
        ):
            if text := explain_slower(self._machine.config.joints[j], way, speed, time):
                notes[j] = text
        return notes

    def _ignored_references(
        self, kind: CommandKind, selection: Selection, asked: Floats, along: Floats | None
    ) -> list[tuple[Answer, str]]:
        """Count what is ignored (M4); an answer and a reason for each joint."""
        answers = []
        fits = (
            np.ones(asked.shape, bool)
            if along is None
            else self._fits(kind, selection.joints, along)
        )
        for k, j in enumerate(selection.joints.tolist()):
            facts = self._machine.facts(j)
            values = (float(asked[k]),) if along is None else (float(asked[k]), float(along[k]))
            verdict = decide_reference(facts, kind, values, fits=bool(fits[k]))
            if verdict.answer is not Answer.ACCEPTED:
                self._state.rejected[j] += np.uint64(1)
            allowed = range_text(COMMANDS[kind].along, values[-1], float(self._most[kind][j]))
            reason = explain_reference(verdict.reason, facts, kind, values, allowed)
            answers.append((verdict.answer, reason))
        return answers


def same(one: Floats, other: Floats) -> bool:
    """Whether two arrays of numbers are equal to the bit; a tenth of the time of numpy's ==."""
    return one.tobytes() == other.tobytes()

# SPDX-License-Identifier: Apache-2.0
"""Requests for modes and calibrations: decided for every joint, then written (SPEC M7)."""

from __future__ import annotations

from collections.abc import Sequence

from .decisions import Verdict, Wanted, decide
from .explanations import LEFT_AS_IT_IS, explain
from .faults import FaultCode
from .machine import Machine
from .modes import Event, law_of
from .reply import Answer, Reply, accepted, decided
from .selection import Selection
from .vocabs import ControlMode, InteractionMode


class Requests:
    """Decides requests from the facts of each joint, and lets the machine carry them out.

    Args:
        machine: whose joints are asked.
    """

    def __init__(self, machine: Machine) -> None:
        self._machine = machine

    def request(self, selection: Selection, wanted: Sequence[Wanted]) -> Reply:
        """Decide a request joint by joint, then carry it out and answer (M7).

        Args:
            selection: The joints, shape (k,).
            wanted: What is asked of each: a key of REQUESTS, an interaction mode, or
                Event.CALIBRATE.
        """
        joints = selection.joints.tolist()
        facts = [self._machine.facts(j) for j in joints]
        verdicts = [decide(known, what) for known, what in zip(facts, wanted, strict=True)]
        reasons = [
            explain(verdict.reason, known, what)
            for verdict, known, what in zip(verdicts, facts, wanted, strict=True)
        ]
        self._carry_out(joints, verdicts, wanted)
        answers = [verdict.answer for verdict in verdicts]
        return decided(selection.names, list(zip(answers, reasons, strict=True)))

    def request_together(self, selection: Selection, wanted: Sequence[Sequence[Wanted]]) -> Reply:
        """Carry out all that is asked of all joints, or, where one cannot, nothing.

        A joint that does not implement what is asked of it is in HW_FAULT all the same (M5, I7).

        Args:
            selection: The joints, shape (k,).
            wanted: What is asked of each, in order, as of :meth:`request`.
        """
        joints = selection.joints.tolist()
        facts = [self._machine.facts(j) for j in joints]
        verdicts = [
            [decide(known, what) for what in whats]
            for known, whats in zip(facts, wanted, strict=True)
        ]
        refusals = [
            next((pair for pair in zip(found, whats, strict=True) if not pair[0].accepts), None)
            for found, whats in zip(verdicts, wanted, strict=True)
        ]
        if not any(refusals):
            for j, found, whats in zip(joints, verdicts, wanted, strict=True):
                self._carry_out([j] * len(whats), found, whats)
            return accepted(selection.names)
        answers = []
        for j, known, refusal in zip(joints, facts, refusals, strict=True):
            if refusal is None:
                answers.append((Answer.REFUSED, LEFT_AS_IT_IS))
                continue
            verdict, what = refusal
            answers.append((verdict.answer, explain(verdict.reason, known, what)))
            self._carry_out([j], [verdict], [what])
        return decided(selection.names, answers)

    def _carry_out(
        self, joints: list[int], verdicts: list[Verdict], wanted: Sequence[Wanted]
    ) -> None:
        """Write what was decided; plain changes into one mode for all their joints at once."""
        entering: dict[ControlMode, list[int]] = {}
        for j, verdict, what in zip(joints, verdicts, wanted, strict=True):
            effect = verdict.effect
            if isinstance(effect, InteractionMode):
                self._store_interaction(j, effect)
            elif isinstance(effect, ControlMode):
                entering.setdefault(effect, []).append(j)
            elif effect is Event.UNSUPPORTED:
                assert not isinstance(what, Event)
                text = f"{what.code} ({what.name}) was asked for"
                self._machine.raise_fault(j, FaultCode.UNSUPPORTED, text)
            elif effect is Event.CALIBRATE:
                self._machine.calibrations.start(j)
            elif effect is not None:
                self._machine.force_idle(j)
        for mode, chosen in entering.items():
            self._machine.enter(chosen, mode)

    def _store_interaction(self, j: int, wanted: InteractionMode) -> None:
        """Store an interaction mode; where the law changes with it the joint stops (I3, I4)."""
        state = self._machine.state
        mode, before = state.control_modes[j], state.interaction_modes[j]
        state.interaction_modes[j] = wanted
        state.modes_version += 1
        if law_of(mode, before) is not law_of(mode, wanted):
            self._machine.enter([j], mode)

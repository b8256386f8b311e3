# SPDX-License-Identifier: Apache-2.0
"""Stopping joints where they are (SPEC P3, I10)."""

from __future__ import annotations

from collections.abc import Sequence

from ..selection import Selection
from ..terms.modes import DIRECT_GAINS, STOPPABLE, Law, law_of
from ..terms.reply import JointAnswer, Reply, decided
from .decisions import decide_stop
from .explanations import explain_stop
from .machine import Machine


class Stops:
    """Stops joints.

    Args:
        machine: whose joints are stopped.
    """

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._state, self._references = machine.state, machine.references

    def stop(self, selection: Selection) -> Reply:
        """Set the position reference to the measured position; the mode stays (P3)."""
        answers = []
        for j in selection.numbers:
            facts = self._machine.facts(j)
            verdict = decide_stop(facts)
            text = "" if verdict.accepts else explain_stop(facts)
            answers.append(JointAnswer(verdict.answer, text, verdict.reason))
        modes = self._state.control_modes
        chosen = [j for j in selection.numbers if modes[j] in STOPPABLE]
        if chosen:
            self._hold(chosen)
        return decided(selection.names, answers)

    def _hold(self, chosen: Sequence[int]) -> None:
        """Hold joints where they are; where the law is the impedance, keep the load (I10)."""
        machine, state = self._machine, self._state
        laws = [machine.controller.joints[j] for j in chosen]
        places = [float(state.position[j]) for j in chosen]
        inside = [min(max(q, j.lower), j.upper) for q, j in zip(places, laws, strict=True)]
        self._references.hold(chosen, inside)
        machine.timeouts.cancel(chosen)
        for j in chosen:
            mode = state.control_modes[j]
            if (law := law_of(mode, state.interaction_modes[j])) is Law.IMPEDANCE:
                machine.set_law([j], law, direct=mode in DIRECT_GAINS)

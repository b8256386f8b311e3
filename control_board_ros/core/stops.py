# SPDX-License-Identifier: Apache-2.0
"""Stopping joints where they are (SPEC P3, I10)."""

from __future__ import annotations

import numpy as np

from ..protocols import Joints
from .decisions import decide_stop
from .explanations import explain_stop
from .machine import Machine
from .modes import DIRECT_GAINS, STOPPABLE, Law, law_of
from .reply import Answer, Reply, decided
from .selection import RequestError, Selector
from .state import Indices


class Stops:
    """Stops joints.

    Args:
        machine: whose joints are stopped.
        selector: of the same joints.
    """

    def __init__(self, machine: Machine, selector: Selector) -> None:
        self._machine, self._selector = machine, selector
        self._state, self._references = machine.state, machine.references

    def stop(self, joints: Joints = None) -> Reply:
        """Set the position reference to the measured position; the mode stays (P3)."""
        try:
            selection = self._selector.select(joints)
        except RequestError as error:
            return self._selector.refuse(joints, error)
        verdicts = []
        for j in selection.joints.tolist():
            facts = self._machine.facts(j)
            verdict = decide_stop(facts)
            reason = "" if verdict.answer is Answer.ACCEPTED else explain_stop(facts)
            verdicts.append((verdict.answer, reason))
        modes = self._state.control_modes
        chosen = [j for j in selection.joints.tolist() if modes[j] in STOPPABLE]
        if chosen:
            self._hold(np.array(chosen))
        return decided(selection.names, verdicts)

    def _hold(self, chosen: Indices) -> None:
        """Hold joints where they are; where the law is the impedance, take the load over (I10)."""
        machine, state = self._machine, self._state
        bounds = [machine.controller.joints[j] for j in chosen]
        position = state.position[chosen]
        inside = np.clip(position, [b.lower for b in bounds], [b.upper for b in bounds])
        self._references.hold(chosen, inside)
        machine.timeouts.cancel(chosen)
        for j in chosen.tolist():
            mode = state.control_modes[j]
            if (law := law_of(mode, state.interaction_modes[j])) is Law.IMPEDANCE:
                machine.set_law(slice(j, j + 1), law, direct=mode in DIRECT_GAINS)

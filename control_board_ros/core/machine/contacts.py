# SPDX-License-Identifier: Apache-2.0
"""Reactions to torques from outside (SPEC X2).

A contact is found by the laws: |external torque| above the joint's threshold for its time. Here
is what the board does, once for each contact: ``report`` logs it; ``stop`` stops the joints of
the part that the contact is on (P3); ``compliant`` makes those COMPLIANT that implement it;
``fault`` is a fault of the joint. All of them are logged and counted. Joints that calibrate do
not react.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..config.config import Zone
from ..config.parts import Reaction
from ..selection import Selection
from ..terms.faults import FaultCode
from ..terms.vocabs import InteractionMode
from .explanations import explain_contact
from .machine import Machine
from .requests import Requests


class Contacts:
    """Reacts to the contacts of joints.

    Args:
        machine: Of the joints.
        requests: By which joints stop and change their interaction mode.
        zones: The parts of the board.

    Attributes: counts (contacts with a reaction since the start, shape (n,)).
    """

    def __init__(self, machine: Machine, requests: Requests, zones: Sequence[Zone]) -> None:
        self._machine, self._requests = machine, requests
        self._part = {j: zone.joints for zone in zones for j in zone.joints}
        self._in_contact = [False] * machine.state.n
        self.counts: NDArray[np.uint64] = np.zeros(machine.state.n, dtype=np.uint64)

    def react(self) -> None:
        """React to the contacts that have begun in this cycle."""
        machine = self._machine
        before = self._in_contact
        self._in_contact = [joint.contact for joint in machine.controller.joints]
        for j, contact in enumerate(self._in_contact):
            joint = machine.config.joints[j]
            reaction = joint.contact.reaction
            if not contact or before[j] or reaction is Reaction.NONE:
                continue
            if j in machine.calibrations.running or machine.state.faults[j].active:
                continue
            self.counts[j] += np.uint64(1)
            text = explain_contact(joint, float(machine.state.external_torque[j]))
            if reaction is Reaction.FAULT:
                machine.raise_fault(j, FaultCode.CONTACT, text)
                continue
            machine.report("warning", "contact", j, f"contact, {text}; {DONE[reaction]}")
            self._carry_out(reaction, self._part[j])

    def _carry_out(self, reaction: Reaction, part: Sequence[int]) -> None:
        joints = self._machine.config.joints
        if reaction is Reaction.STOP:
            self._requests.stop(Selection.of(part, [joints[j].name for j in part]))
        elif reaction is Reaction.COMPLIANT:
            able = [
                j
                for j in part
                if InteractionMode.COMPLIANT in self._machine.joint(j).interaction_modes
            ]
            selection = Selection.of(able, [joints[j].name for j in able])
            self._requests.request(selection, [InteractionMode.COMPLIANT] * len(able))


#: What each reaction does, for the log.
DONE = {
    Reaction.REPORT: "nothing else is done",
    Reaction.STOP: "the arm stops",
    Reaction.COMPLIANT: "the arm becomes COMPLIANT",
}

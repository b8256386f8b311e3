# SPDX-License-Identifier: Apache-2.0
"""From power-on to power-off: the start-up of joints (SPEC N), requests for modes, calibrations
and brakes, decided for every joint, then written (M7), stops (P3, I10), and reactions to contacts
(X2).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..config.config import Zone
from ..config.parts import Reaction
from ..selection import Selection
from ..terms.faults import FaultCode
from ..terms.modes import (
    ACCEPTS,
    DIRECT_GAINS,
    FAULTED,
    REQUESTS,
    STOPPABLE,
    UNPOWERED,
    Event,
    Law,
    Stage,
    law_of,
)
from ..terms.reply import Answer, JointAnswer, Reason, Reply, accepted, decided
from ..terms.vocabs import BrakeMode, ControlMode, InteractionMode
from .decisions import Requested, Verdict, decide, decide_brake, decide_stop
from .explanations import (
    all_or_none,
    explain,
    explain_brake,
    explain_contact,
    explain_kept,
    explain_stop,
    explain_stuck,
)
from .machine import Machine

#: Answer of a joint that does what was requested.
CARRIED_OUT = JointAnswer()


class Step(NamedTuple):
    """A decided step of a request: joint, verdict, request."""

    joint: int
    verdict: Verdict
    requested: Requested


class Requests:
    """Decides requests from the facts of each joint, and carries them out."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine

    def request(
        self,
        selection: Selection,
        requested: Sequence[Requested | tuple[Requested, ...]],
        *,
        together: bool = False,
    ) -> Reply:
        """Decide a request joint by joint, then carry it out and answer (M7).

        A joint that does not implement its request enters HW_FAULT also where the others remain
        unchanged (M5, I7).

        Args:
            selection: The joints, shape (k,).
            requested: The request of each, one or several in order: a key of REQUESTS, an
                interaction mode, or Event.CALIBRATE.
            together: Whether nothing changes where one joint cannot do all of it.
        """
        outcomes = [
            self._decide(j, request if isinstance(request, tuple) else (request,))
            for j, request in zip(selection.numbers, requested, strict=True)
        ]
        reply = self._answer(selection, outcomes, together=together)
        entered = [
            j
            for j, request, answer in zip(selection.numbers, requested, reply.answers, strict=True)
            if answer is Answer.ACCEPTED and names_a_mode(request)
        ]
        self._machine.streams.forget(entered)
        self._machine.feeds.forget(entered)
        return reply

    def _answer(
        self,
        selection: Selection,
        outcomes: Sequence[tuple[JointAnswer, list[Step]]],
        *,
        together: bool,
    ) -> Reply:
        """Carry out what was decided, and answer."""
        answers = [answer for answer, _ in outcomes]
        held = together and any(answer.code for answer in answers)
        self._carry_out(
            [
                step
                for _, steps in outcomes
                for step in steps
                if not (held and step.verdict.accepts)
            ]
        )
        return decided(selection.names, all_or_none(answers) if together else answers)

    def recover(self, selection: Selection, *, partial: bool) -> Reply:
        """Clear faults and go back to the modes before them, in one cycle (E1).

        An interaction mode that was set amid a fault acts (I2).

        Args:
            selection: The joints, shape (k,); one that is in no fault stays as it is.
            partial: Whether those that can do so where others cannot.
        """
        state = self._machine.state
        requested: list[tuple[Requested, ...]] = []
        waits = []
        for j in selection.numbers:
            mode, facts = state.before[j], self._machine.facts(j)
            waits.append(facts.cause.wait if facts.cause is not None else 0.0)
            if facts.mode not in FAULTED:
                requested.append(())
            elif mode in REQUESTS:
                requested.append((ControlMode.FORCE_IDLE, facts.interaction, mode))
            else:  # its calibration was aborted by the fault
                requested.append((ControlMode.FORCE_IDLE,))
        outcomes = [
            self._decide_recovery(j, request)
            for j, request in zip(selection.numbers, requested, strict=True)
        ]
        reply = self._answer(selection, outcomes, together=not partial)
        return replace(reply, waits=tuple(waits))

    def _decide_recovery(
        self, j: int, whats: Sequence[Requested]
    ) -> tuple[JointAnswer, list[Step]]:
        """As ``_decide``: a joint that cannot do all of it keeps its fault and the mode before."""
        answer, steps = self._decide(j, whats)
        if not answer.code:
            return answer, steps
        if answer.answer is Answer.UNSUPPORTED:
            text = explain_kept(self._machine.facts(j), steps[-1].requested)
            answer = JointAnswer(Answer.REFUSED, text, answer.code)
        return answer, []

    def _decide(self, j: int, whats: Sequence[Requested]) -> tuple[JointAnswer, list[Step]]:
        """The answer of a joint, and its steps up to the first that is not accepted."""
        facts = self._machine.facts(j)
        steps: list[Step] = []
        for what in whats:
            if steps:
                facts = facts.after(steps[-1].verdict)
            verdict = decide(facts, what)
            steps.append(Step(j, verdict, what))
            if not verdict.accepts:
                text = explain(verdict.reason, facts, what)
                return JointAnswer(verdict.answer, text, verdict.reason), steps
        if ControlMode.FORCE_IDLE in whats and self._machine.brakes.is_stuck(j):
            return JointAnswer(text=explain_stuck(facts)), steps
        return CARRIED_OUT, steps

    def _carry_out(self, steps: Sequence[Step]) -> None:
        """Carry out verdicts; changes into one mode together for all of its joints."""
        entering: dict[ControlMode, list[int]] = {}
        for j, verdict, what in steps:
            effect = verdict.effect
            if isinstance(effect, InteractionMode):
                self._store_interaction(j, effect)
            elif isinstance(effect, ControlMode):
                entering.setdefault(effect, []).append(j)
            elif effect is Event.UNSUPPORTED:
                assert not isinstance(what, Event)
                text = f"{what.code} ({what.name}) was requested"
                self._machine.raise_fault(j, FaultCode.UNSUPPORTED, text)
            elif effect is Event.CALIBRATE:
                self._machine.calibrations.start(j)
            elif effect is not None:
                self._machine.force_idle(j)
        for mode, entered in entering.items():
            self._machine.enter(entered, mode)

    def _store_interaction(self, j: int, requested: InteractionMode) -> None:
        """Store an interaction mode; where the law changes with it the joint stops (I3, I4)."""
        state = self._machine.state
        mode, before = state.control_modes[j], state.interaction_modes[j]
        state.interaction_modes[j] = requested
        state.note_modes([j])
        if law_of(mode, before) is not law_of(mode, requested):
            self._machine.enter([j], mode)

    def stop(self, selection: Selection) -> Reply:
        """Brake, and hold where joints come to rest; the mode stays (P3)."""
        answers = []
        for j in selection.numbers:
            facts = self._machine.facts(j)
            verdict = decide_stop(facts)
            text = "" if verdict.accepts else explain_stop(facts)
            answers.append(JointAnswer(verdict.answer, text, verdict.reason))
        modes = self._machine.state.control_modes
        if stopping := [j for j in selection.numbers if modes[j] in STOPPABLE]:
            self._hold(stopping)
        return decided(selection.names, answers)

    def _hold(self, stopping: Sequence[int]) -> None:
        """Stop joints; where the law is the impedance, keep the load (I10)."""
        machine, state = self._machine, self._machine.state
        laws = [machine.controller.joints[j] for j in stopping]
        places = machine.references.places(stopping)
        inside = [
            min(max(q, j.reference.lower), j.reference.upper)
            for q, j in zip(places, laws, strict=True)
        ]
        machine.references.hold(stopping, inside)
        machine.timeouts.cancel(stopping)
        state.stops[stopping] += np.uint64(1)
        for j in stopping:
            mode = state.control_modes[j]
            if (law := law_of(mode, state.interaction_modes[j])) is Law.IMPEDANCE:
                machine.set_law([j], law, direct=mode in DIRECT_GAINS, feeds=True)

    def set_brakes(self, selection: Selection, requested: Sequence[BrakeMode]) -> Reply:
        """Decide the brake mode of each joint, then set it (M7)."""
        brakes = self._machine.brakes
        answers = []
        for j, mode in zip(selection.numbers, requested, strict=True):
            facts = self._machine.facts(j)
            facts = facts._replace(cause=facts.cause or self._machine.monitor.stop(j))
            verdict = decide_brake(facts, mode, present=brakes.has(j))
            text = explain_brake(verdict.reason, facts)
            answers.append(JointAnswer(verdict.answer, text, verdict.reason))
        for j, mode, answer in zip(selection.numbers, requested, answers, strict=True):
            if not answer.code:
                brakes.set_mode(j, mode)
        return decided(selection.names, answers)


def names_a_mode(requested: Requested | tuple[Requested, ...]) -> bool:
    """Whether a request is for a mode that accepts references, and not to leave one only."""
    steps = requested if isinstance(requested, tuple) else (requested,)
    return any(step in ACCEPTS for step in steps)


class StartUp:
    """Start-up: joints leave NOT_CONFIGURED, once per power-on.

    Attributes: due (the joints whose configuration completes with the next reading), held (those
    whose start-up level has not come, R4: only :meth:`begin` configures them).
    """

    def __init__(self, machine: Machine) -> None:
        self._machine, self._state = machine, machine.state
        self._power_on_cycles = [0] * machine.state.n
        self.due: set[int] = set()
        self.held: set[int] = set()

    def power_on(self, joints: Sequence[int], *, autoconfigure: bool) -> None:
        """Restart joints; without ``autoconfigure`` they wait for :meth:`begin`."""
        for j in joints:
            self._power_on_cycles[j] = self._state.cycle
            self.due.discard(j)
            stage = self._state.stages[j]
            waits = stage is Stage.ACTIVE and j in self.held  # one that is inactive has no power
            if autoconfigure and stage is not Stage.UNCONFIGURED and not waits:
                self.due.add(j)

    def begin(self, joints: Iterable[int]) -> None:
        """Configure joints; without a reading since their power-on, at the next one.

        A joint holds where it is, not where it was.
        """
        for j in joints:
            if self._state.cycle == self._power_on_cycles[j] or np.isnan(self._state.position[j]):
                self.due.add(j)
            else:
                self._configure(j)

    def complete(self) -> None:
        """Configure the joints that are due and have a reading (N2, N3, B7).

        One that has none for longer than its encoder may be silent is configured, too: into the
        fault that says so.
        """
        read = ~(np.isnan(self._state.position) & (self._state.age > 0.0))
        for j in sorted(self.due):
            if read[j] or self._waited(j) > self._machine.config.joints[j].timeouts.encoder:
                self.due.discard(j)
                self._configure(j)

    def _waited(self, j: int) -> float:
        """Time since the power-on of a joint, s."""
        cycles = self._state.cycle - self._power_on_cycles[j]
        return cycles * self._machine.config.period

    def _configure(self, j: int) -> None:
        machine = self._machine
        if machine.is_configured(j):
            return
        calibration = machine.config.joints[j].calibration
        if calibration is None or not calibration.required:
            machine.calibrations.set_offset(j, calibration.zero if calibration else 0.0)
            machine.know_angle(j)
        elif self._state.stages[j] is Stage.ACTIVE:
            machine.calibrations.start(j)
            return
        machine.go(j, Event.CONFIGURED)

    def activate(self, joints: Iterable[int]) -> None:
        """Power is allowed: each joint that has none calibrates or starts, as at N3."""
        machine, state = self._machine, self._state
        for j in joints:
            joint = machine.config.joints[j]
            calibration = joint.calibration
            if state.control_modes[j] is not UNPOWERED:
                continue  # in fault (F2), or not configured yet
            if machine.brakes.is_kept_closed(j):
                continue  # by hand (Y4)
            if calibration is None or not calibration.required:
                machine.go(j, joint.startup_mode)
            elif state.calibrated[j]:
                machine.go(j, calibration.control_mode)
            else:
                machine.calibrations.start(j)


#: What each reaction does, for the log.
REACTION_TEXTS = {
    Reaction.REPORT: "nothing else is done",
    Reaction.STOP: "the arm stops",
    Reaction.COMPLIANT: "the arm becomes COMPLIANT",
}


class Contacts:
    """Reacts to torques from outside (X2).

    A contact is found by the laws: |external torque| above the joint's threshold for its time.
    Here is what the board does, once for each: ``report`` logs it; ``stop`` stops the joints of
    the part that the contact is on (P3); ``compliant`` makes those COMPLIANT that implement it;
    ``fault`` is a fault of the joint. All of them are logged and counted. Joints that calibrate
    do not react.

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
        self._in_contact = [joint.external.contact for joint in machine.controller.joints]
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
            done = self._carry_out(reaction, self._part[j])
            machine.report("warning", "contact", j, f"contact, {text}; {done}")

    def _carry_out(self, reaction: Reaction, part: Sequence[int]) -> str:
        """React; returns what is done, or why it is not of all joints."""
        joints, reply = self._machine.config.joints, accepted(())
        if reaction is Reaction.STOP:
            reply = self._requests.stop(Selection.of(part, [joints[j].name for j in part]))
            for j, answer in zip(part, reply.answers, strict=True):
                if answer is Answer.ACCEPTED:
                    self._machine.streams.cut(j, Reason.CONTACT)
        elif reaction is Reaction.COMPLIANT:
            able = [
                j
                for j in part
                if InteractionMode.COMPLIANT in self._machine.joint(j).interaction_modes
            ]
            selection = Selection.of(able, [joints[j].name for j in able])
            reply = self._requests.request(selection, [InteractionMode.COMPLIANT] * len(able))
        done = REACTION_TEXTS[reaction]
        if reply:
            return done
        return f"{done.replace('the arm', 'not the whole arm')}: {reply.message}"

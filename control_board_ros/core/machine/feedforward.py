# SPDX-License-Identifier: Apache-2.0
"""Feed-forward terms: u_ff on the output, τ_ff on the impedance torque (SPEC P11)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..laws.laws import Joint
from ..selection import RequestError, Selection, spread
from ..terms.arguments import Floats, Values
from ..terms.reply import JointAnswer, Reply, decided
from .decisions import decide_feedforward
from .explanations import explain_feedforward
from .machine import Machine
from .requests import LEFT


class Feedforward:
    """Checks feed-forward terms joint by joint, sets what is good, counts the rest.

    Args:
        machine: whose laws receive them.
    """

    def __init__(self, machine: Machine) -> None:
        self._machine = machine

    def set_feedforward(
        self, selection: Selection, terms: Sequence[Floats | None], *, together: bool
    ) -> Reply:
        """Set u_ff (percent) and τ_ff (N·m), either or both; they act as P11.

        Args:
            selection: the joints.
            terms: of :func:`terms_of`.
            together: whether all joints accept them or none does.
        """
        machine = self._machine
        parts = [
            (j, [None if term is None else float(term[k]) for term in terms])
            for k, j in enumerate(selection.numbers)
        ]
        answers = [self._judge(j, given) for j, given in parts]
        held = together and any(answer.code for answer in answers)
        taken = []
        for (j, given), answer in zip(parts, answers, strict=True):
            machine.state.rejected[j] += np.uint64(bool(answer.code))
            fine = not (held or answer.code)
            taken.append(feed(machine.controller.joints[j], *given) if fine else math.nan)
        if held:
            answers = [answer if answer.code else LEFT for answer in answers]
        return replace(decided(selection.names, answers), values=tuple(taken))

    def _judge(self, j: int, given: Sequence[float | None]) -> JointAnswer:
        """What becomes of the terms of a joint."""
        facts = self._machine.facts(j)
        values = tuple(value for value in given if value is not None)
        verdict = decide_feedforward(facts, values)
        text = explain_feedforward(verdict.reason, facts, values)
        return JointAnswer(verdict.answer, text, verdict.reason)


def terms_of(
    count: int, outputs: Values | None, torques: Values | None
) -> tuple[Floats | None, Floats | None]:
    """u_ff and τ_ff, shape (count,) each; None where not given.

    Raises:
        RequestError: neither is given, or the length of one does not fit.
    """
    if outputs is None and torques is None:
        raise RequestError("neither outputs nor torques given")
    return (
        None if outputs is None else spread(outputs, count, "outputs"),
        None if torques is None else spread(torques, count, "torques"),
    )


def feed(joint: Joint, output: float | None, torque: float | None) -> float:
    """Set u_ff (percent) and τ_ff (N·m), either or both; the first given, as bounded."""
    taken = [] if output is None else [feed_output(joint, output)]
    if torque is not None:
        taken.append(feed_torque(joint, torque))
    return taken[0]


def feed_output(joint: Joint, output: float) -> float:
    """Set u_ff within the limit of the output, percent (P11); as bounded."""
    joint.output_offset = taken = float(min(max(output, -joint.max_output), joint.max_output))
    return taken


def feed_torque(joint: Joint, torque: float) -> float:
    """Set τ_ff within the limit of the torque, N·m (P11); as bounded."""
    taken = float(min(max(torque, -joint.max_torque), joint.max_torque))
    joint.offer_torque(taken)
    return taken

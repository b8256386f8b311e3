# SPDX-License-Identifier: Apache-2.0
"""Feed-forward terms: u_ff on the output, τ_ff on the impedance torque (SPEC P11)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..protocols import Floats, Joints, Values
from .decisions import decide_feedforward
from .explanations import explain_feedforward
from .laws import Joint
from .machine import Machine
from .reply import Answer, Reply, decided
from .selection import RequestError, Selector, spread


class Feedforward:
    """Checks feed-forward terms joint by joint, sets what is good, counts the rest.

    Args:
        machine: whose laws take them.
        selector: of the same joints.
        reject: refuses and counts what is wrong as a whole.
    """

    def __init__(
        self, machine: Machine, selector: Selector, reject: Callable[[Joints, str], Reply]
    ) -> None:
        self._machine, self._selector, self._reject = machine, selector, reject

    def set_feedforward(
        self, joints: Joints, outputs: Values | None = None, torques: Values | None = None
    ) -> Reply:
        """Set u_ff (percent) and τ_ff (N·m), either or both; they act as P11."""
        machine = self._machine
        try:
            selection = self._selector.select(joints)
            terms = terms_of(len(selection.names), outputs, torques)
        except RequestError as error:
            return self._reject(joints, f"feedforward ignored: {error}")
        verdicts = []
        for k, j in enumerate(selection.joints.tolist()):
            output, torque = (None if term is None else float(term[k]) for term in terms)
            values = tuple(value for value in (output, torque) if value is not None)
            facts = machine.facts(j)
            verdict = decide_feedforward(facts, values)
            verdicts.append((verdict.answer, explain_feedforward(verdict.reason, facts, values)))
            if verdict.answer is not Answer.ACCEPTED:
                machine.state.rejected[j] += np.uint64(1)
                continue
            law = machine.controller.joints[j]
            if output is not None:
                feed_output(law, output)
            if torque is not None:
                feed_torque(law, torque)
        return decided(selection.names, verdicts)


def terms_of(
    count: int, outputs: Values | None, torques: Values | None
) -> tuple[Floats | None, Floats | None]:
    """u_ff and τ_ff of so many joints, shape (count,) each; None where not given.

    Raises:
        RequestError: neither is given, or the length of one does not fit.
    """
    if outputs is None and torques is None:
        raise RequestError("neither outputs nor torques given")
    return (
        None if outputs is None else spread(outputs, count, "outputs"),
        None if torques is None else spread(torques, count, "torques"),
    )


def feed_output(joint: Joint, output: float) -> None:
    """Set u_ff within the limit of the output, percent (P11)."""
    joint.output_offset = min(max(output, -joint.max_output), joint.max_output)


def feed_torque(joint: Joint, torque: float) -> None:
    """Set τ_ff within the limit of the torque, N·m (P11)."""
    joint.offer_torque(min(max(torque, -joint.max_torque), joint.max_torque))

# SPDX-License-Identifier: Apache-2.0
"""What becomes of a command, as far as the client knows: a topic has no answer.

The client asks core's own decision, with the facts that it has: the mode and the limits last
heard, and, before a joint is said to ignore something, what the board says of it now. What
became of a command for certain, only the board's counter of rejected commands tells.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from control_board_ros.core.decisions import Facts, decide_feedforward, decide_reference
from control_board_ros.core.explanations import (
    explain_feedforward,
    explain_reference,
    range_text,
)
from control_board_ros.core.faults import FaultRecord
from control_board_ros.core.reply import Answer, Reply, accepted, decided
from control_board_ros.core.selection import RequestError, Selection
from control_board_ros.core.vocabs import CommandKind, ControlMode, InteractionMode
from control_board_ros.protocols import Floats

from .errors import BoardError, BoardNotFound, BoardTimeout
from .modes import ModeRequests
from .modes_view import ModesView
from .parameters import ParameterRequests
from .waiting import Steps
from .whole_board import WholeBoard

#: The parameter that bounds what goes along with references (P2, P5).
LIMITS = {"speeds": "limits.velocity", "accelerations": "limits.acceleration"}


@dataclass(frozen=True, slots=True)
class KnownJoint:
    """What a client knows of a joint's configuration, named as in core's JointConfig.

    Attributes:
        name: of the joint.
        control_modes: that it implements.
        interaction_modes: unknown.
        calibration: unknown.
    """

    name: str
    control_modes: tuple[ControlMode, ...] = ()
    interaction_modes: tuple[InteractionMode, ...] = ()
    calibration: None = None


Known = dict[str, tuple[KnownJoint, FaultRecord]]


class Predictor:
    """Predicts the board's answers to commands.

    Args:
        view: the modes last heard.
        modes: to ask the board for modes.
        board: to ask it for faults.
        parameters: to ask it for limits.
    """

    def __init__(
        self,
        view: ModesView,
        modes: ModeRequests,
        board: WholeBoard,
        parameters: ParameterRequests,
    ) -> None:
        self._view, self._modes = view, modes
        self._board, self._parameters = board, parameters
        self._limits: dict[tuple[str, str], float] = {}  # by name of joint, and field

    def reply(
        self, kind: CommandKind | None, selection: Selection, values: dict[str, Floats]
    ) -> Steps[Reply]:
        """The answer and the reason for each joint of a command.

        Args:
            kind: of the references; None: feed-forward.
            selection: the joints.
            values: the fields of the message, each of shape (k,); references come first, then
                what goes along with them.
        """
        names = selection.names
        rows = list(zip(*(array.tolist() for array in values.values()), strict=True))
        along = "" if kind is None or len(values) == 1 else list(values)[-1]

        def verdicts(known: Known) -> list[tuple[Answer, str]]:
            return [
                predict(
                    kind, self._facts(name, known), row, along, self._limits.get((name, along))
                )
                for name, row in zip(names, rows, strict=True)
            ]

        if along and not all((name, along) in self._limits for name in names):
            yield from self._ask_limits(along, names)
        first = verdicts({})
        if self._view.certain(names) and all(answer is Answer.ACCEPTED for answer, _ in first):
            return accepted(names)
        yield from self._modes.ask(selection)
        if along:
            yield from self._ask_limits(along, names)
        known = yield from self._ask_about([n for n in names if not self._takes(kind, n)])
        return decided(names, verdicts(known))

    def _takes(self, kind: CommandKind | None, name: str) -> bool:
        """Whether the mode of a joint takes such a command, whatever its numbers are."""
        answer, _ = predict(kind, self._facts(name, {}), ())
        return answer is Answer.ACCEPTED

    def _ask_about(self, names: Sequence[str]) -> Steps[Known]:
        """What the board says of joints whose mode is the wrong one."""
        if not names:
            return {}
        available = yield from self._modes.get_available_modes(names)
        faults = yield from self._board.get_faults(names)
        return {
            name: (KnownJoint(name, modes), fault)
            for name, (modes, _), fault in zip(names, available, faults, strict=True)
        }

    def _ask_limits(self, along: str, names: Sequence[str]) -> Steps[None]:
        """Ask for the limits of what goes along; infinite where the board does not tell."""
        try:
            (limits,) = yield from self._parameters.of_joints((LIMITS[along],), names)
        except (BoardNotFound, BoardTimeout):
            raise
        except (RequestError, BoardError):  # a board without these parameters, or without any
            limits = np.full(len(names), math.inf)
        for name, limit in zip(names, limits.tolist(), strict=True):
            self._limits[name, along] = limit

    def _facts(self, name: str, known: Known) -> Facts:
        joint, fault = known.get(name) or (KnownJoint(name), FaultRecord(name))
        return Facts(
            joint=joint,
            mode=self._view.control_mode(name),
            interaction=self._view.interaction_mode(name),
            calibrated=True,
            fault=fault,
            cause=None,
            time=fault.stamp,
        )


def predict(
    kind: CommandKind | None,
    facts: Facts,
    values: tuple[float, ...],
    along: str = "",
    most: float | None = None,
) -> tuple[Answer, str]:
    """The answer and the reason for one joint.

    Args:
        kind: of the reference; None: feed-forward.
        facts: of the joint.
        values: the reference, and what goes along with it.
        along: what the last one is, for people.
        most: the greatest that it may be.
    """
    if kind is None:
        verdict = decide_feedforward(facts, values)
        return verdict.answer, explain_feedforward(verdict.reason, facts, values)
    fits = most is None or 0.0 < values[-1] <= most
    verdict = decide_reference(facts, kind, values, fits)
    allowed = "" if most is None else range_text(along, values[-1], most)
    return verdict.answer, explain_reference(verdict.reason, facts, kind, values, allowed)

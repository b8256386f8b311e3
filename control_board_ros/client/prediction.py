# SPDX-License-Identifier: Apache-2.0
"""What becomes of a command, as far as the client knows: a topic has no answer.

The client asks core's own decision, with the facts that it has: the mode last heard, and, before
a joint is said to be in a wrong one, what the board says of it. What it does not know, such as
the limit of a speed, only the board's log and its counter of rejected commands tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from control_board_ros.core.config import JointConfig
from control_board_ros.core.decisions import Facts, decide_feedforward, decide_reference
from control_board_ros.core.explanations import explain_feedforward, explain_reference
from control_board_ros.core.faults import FaultRecord
from control_board_ros.core.reply import Answer, Reply, accepted, decided
from control_board_ros.core.selection import Selection
from control_board_ros.core.vocabs import CommandKind, ControlMode
from control_board_ros.protocols import Floats

from .modes import ModeRequests
from .modes_view import ModesView
from .waiting import Steps
from .whole_board import WholeBoard


@dataclass(frozen=True, slots=True)
class KnownJoint:
    """What a client knows of a joint's configuration, named as in core's JointConfig.

    Attributes:
        name: of the joint.
        control_modes: that it implements.
        calibration: unknown.
    """

    name: str
    control_modes: tuple[ControlMode, ...] = ()
    calibration: None = None


Known = dict[str, tuple[KnownJoint, FaultRecord]]


class Predictor:
    """Predicts the board's answers to commands.

    Args:
        view: the modes last heard.
        modes: to ask the board for modes.
        board: to ask it for faults.
    """

    def __init__(self, view: ModesView, modes: ModeRequests, board: WholeBoard) -> None:
        self._view, self._modes, self._board = view, modes, board

    def reply(
        self, kind: CommandKind | None, selection: Selection, values: dict[str, Floats]
    ) -> Steps[Reply]:
        """The answer and the reason for each joint of a command.

        Args:
            kind: of the references; None: feed-forward.
            selection: the joints.
            values: the fields of the message, each of shape (k,); references come first, then
                what goes along with them, which must be above 0.
        """
        names = selection.names
        rows = list(zip(*(array.tolist() for array in values.values()), strict=True))
        along = list(values)[-1]

        def verdicts(known: Known) -> list[tuple[Answer, str]]:
            return [
                predict(kind, self._facts(name, known), row, along)
                for name, row in zip(names, rows, strict=True)
            ]

        first = verdicts({})
        if self._view.certain and all(answer is Answer.ACCEPTED for answer, _ in first):
            return accepted(names)
        yield from self._modes.ask(selection)
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

    def _facts(self, name: str, known: Known) -> Facts:
        joint, fault = known.get(name) or (KnownJoint(name), FaultRecord(name))
        return Facts(
            joint=cast(JointConfig, joint),
            mode=self._view.control_mode(name),
            interaction=self._view.interaction_mode(name),
            calibrated=True,
            fault=fault,
            cause=None,
            time=fault.stamp,
        )


def predict(
    kind: CommandKind | None, facts: Facts, values: tuple[float, ...], along: str = ""
) -> tuple[Answer, str]:
    """The answer and the reason for one joint.

    Args:
        kind: of the reference; None: feed-forward.
        facts: of the joint.
        values: the reference, and what goes along with it.
        along: what the last one is, for people.
    """
    if kind is None:
        verdict = decide_feedforward(facts, values)
        return verdict.answer, explain_feedforward(verdict.reason, facts, values)
    verdict = decide_reference(facts, kind, values, fits=all(v > 0.0 for v in values[1:]))
    allowed = f"{along} must be above 0, not {values[-1]:.6g}" if values else ""
    return verdict.answer, explain_reference(verdict.reason, facts, kind, values, allowed)

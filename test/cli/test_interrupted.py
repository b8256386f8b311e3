# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C between what a board does and its reply: joints and settings are as before in the end."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from types import SimpleNamespace
from typing import Any

import pytest

from control_board_ros.cli.board.experiments import (
    Experiment,
    faster_states,
    in_position_direct,
)
from control_board_ros.cli.line.words import Refused
from control_board_ros.cli.verbs.identifying import stiff
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.core.terms.reply import Answer, Reply
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode, parse_control_mode
from control_board_ros.joint_limits import JointLimits

OK = Reply(("j",), (Answer.ACCEPTED,))


class Client:
    """A board of one joint that accepts each setting, and whose first reply Ctrl-C precedes."""

    def __init__(self, *, refuses: bool = False) -> None:
        self.mode: Any = ControlMode.POSITION
        self.interaction: Any = InteractionMode.COMPLIANT
        self.parameters = {"state_rate": 100.0, "control_rate": 1000.0}
        self.interrupts, self.refuses, self.stopped = not refuses, refuses, 0

    def _answer(self) -> Reply:
        if self.interrupts:
            self.interrupts = False
            raise KeyboardInterrupt
        return OK

    def get_parameters(self, names: list[str]) -> dict[str, float]:
        return {name: self.parameters[name] for name in names}

    def set_parameters(self, values: dict[str, float]) -> Reply:
        self.parameters |= values
        return self._answer()

    def get_control_mode(self, names: list[str]) -> list[Any]:
        return [self.mode]

    def set_control_mode(self, joint: str, mode: Any) -> Reply:
        if self.refuses:
            return Reply(("j",), (Answer.REFUSED,), "busy")
        self.mode = parse_control_mode(mode) if isinstance(mode, str) else mode
        return self._answer()

    def get_interaction_mode(self, names: list[str]) -> list[Any]:
        return [self.interaction]

    def set_interaction_mode(self, names: list[str], modes: Any) -> Reply:
        (self.interaction,) = modes if isinstance(modes, list) else [modes]
        return self._answer()

    def stop(self, joint: str) -> Reply:
        self.stopped += 1
        return OK


EXPERIMENT = Experiment("j", 0.0, JointLimits(-1.0, 1.0), JointKind.REVOLUTE, "pos")
CONTEXTS: list[Callable[[Any], AbstractContextManager[None]]] = [
    faster_states,
    lambda session: in_position_direct(session, EXPERIMENT),
    lambda session: stiff(session, ["j"]),
]


@pytest.mark.parametrize("context", CONTEXTS, ids=["states", "mode", "interaction"])
def test_all_is_as_before(context: Callable[[Any], AbstractContextManager[None]]) -> None:
    client = Client()
    session = SimpleNamespace(client=client)
    with pytest.raises(KeyboardInterrupt), context(session):
        raise AssertionError("it went on")
    assert not client.interrupts
    assert client.mode is ControlMode.POSITION
    assert client.interaction is InteractionMode.COMPLIANT
    assert client.parameters["state_rate"] == 100.0


def test_a_refused_mode_stops_nothing() -> None:
    """What the joint does for others goes on."""
    client = Client(refuses=True)
    with (
        pytest.raises(Refused, match="busy"),
        in_position_direct(
            SimpleNamespace(client=client),  # type: ignore[arg-type]
            EXPERIMENT,
        ),
    ):
        raise AssertionError("it went on")
    assert client.stopped == 0

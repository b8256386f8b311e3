# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C between what a board does and its reply: joints and settings are as before in the end."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from contextlib import AbstractContextManager
from types import SimpleNamespace
from typing import Any

import pytest
from processes import python
from rich.console import Console

from control_board_ros.cli.board import streaming
from control_board_ros.cli.board.experiments import (
    Experiment,
    faster_states,
    in_position_direct,
)
from control_board_ros.cli.board.recordings import uninterrupted
from control_board_ros.cli.line.words import Refused
from control_board_ros.cli.text.output import REFUSED
from control_board_ros.cli.verbs.identifying import stiff
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.core.terms.reply import Answer, Reply
from control_board_ros.core.terms.vocabs import (
    HAND_TIMEOUT,
    ControlMode,
    InteractionMode,
    parse_control_mode,
)
from control_board_ros.joint_limits import JointLimits

#: Runs a line while Ctrl-C arrives in the import of a module, the first word.
INTERRUPTED = """
import os, signal, sys

class Interrupt:
    def find_spec(self, name, *rest):
        if name == sys.argv[1]:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
"""

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


# --- streams -------------------------------------------------------------------------------------


class Streamed:
    """A session with a board of one joint; ``torques`` are what it was sent."""

    def __init__(self) -> None:
        self.torques: list[float] = []
        self.names = ("j",)
        self.options = SimpleNamespace(json=False)
        state = SimpleNamespace(names=("j",), position=[0.0], stamp=1.0)
        self.client = SimpleNamespace(get_state=lambda **_: state, wait_for_state=lambda *_: state)

    def position(self, name: str, value: float) -> str:
        return f"{value:g} rad"

    def send(self, names: list[str], values: list[float], valid_for: float = 0.0) -> Reply:
        assert not any(values) or valid_for == HAND_TIMEOUT  # P12: also if nothing ends it
        self.torques += values
        return OK


def test_ctrl_c_while_its_bar_appears_ends_a_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    """At any of the steps by which rich begins to draw: the joint is given zero."""
    monkeypatch.setattr(streaming, "conclude", lambda *_, **__: 0)
    monkeypatch.setattr(streaming, "what_they_do", lambda *_: "")
    monkeypatch.setattr(streaming, "warn_not_holding", lambda *_: None)

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    for step in ("set_live", "push_render_hook"):
        session: Any = Streamed()
        with monkeypatch.context() as patched:
            patched.setattr(Console, step, interrupted)
            assert streaming.stream(session, session.send, {"j": 0.2}, 60.0, "torq") == REFUSED
        assert session.torques == [0.2, 0.0], step


def test_whatever_ends_a_stream_the_joint_is_given_zero() -> None:
    session: Any = Streamed()

    def send(names: list[str], values: list[float], valid_for: float = 0.0) -> Reply:
        session.send(names, values, valid_for)
        if values == [0.2] and session.torques.count(0.2) > 1:
            raise RuntimeError("in the midst of it")
        return OK

    with pytest.raises(RuntimeError, match="in the midst of it"):
        streaming.stream(session, send, {"j": 0.2}, 60.0, "torq")
    assert session.torques == [0.2, 0.2, 0.0]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_recording_is_completed_first(number: signal.Signals) -> None:
    """Signals amid its end do nothing; after it they act as before."""
    before = signal.getsignal(number)
    with uninterrupted():
        os.kill(os.getpid(), number)
    assert signal.getsignal(number) is before


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("control_board_ros.cli.app", "from control_board_ros.cli import main; main(['modes'])"),
        ("rclpy.context", "from control_board_ros.cli import main; main(['modes'])"),
        ("control_board_ros.node.main", "from control_board_ros.node import start; start()"),
    ],
)
def test_ctrl_c_while_modules_load_ends_the_process_without_a_traceback(
    module: str, line: str
) -> None:
    done = python(INTERRUPTED + line, module, code=-signal.SIGINT)
    assert done.stdout + done.stderr == ""

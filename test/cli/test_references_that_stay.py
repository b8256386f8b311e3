# SPDX-License-Identifier: Apache-2.0
"""cbctl torque and output tell what the board has in force, not what they were given."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from control_board_ros.cli.line.options import Options
from control_board_ros.cli.verbs.streams import set_once
from control_board_ros.core.terms.reply import accepted, refused

ASKED = {"elbow": 500.0, "wrist": 2.0}
SESSION: Any = SimpleNamespace(options=Options(), shared=False, names=list(ASKED), line=str)


def test_a_reference_that_was_bounded_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    sent: list[Any] = []

    def send(names: list[str], values: list[float]) -> Any:
        sent.append((names, values))
        return replace(accepted(tuple(names)), values=(176.0, 2.0))

    assert set_once(SESSION, send, ASKED, "torque references", "{:g}", "torq") == 0
    assert sent == [(["elbow", "wrist"], [500.0, 2.0])]
    assert capsys.readouterr().out == (
        "torque references: elbow 176, wrist 2; they stay until changed\n"
    )


def test_what_was_not_taken_is_not_told(capsys: pytest.CaptureFixture[str]) -> None:
    reply = refused("elbow is in POSITION", ("elbow",))
    assert set_once(SESSION, lambda *_: reply, ASKED, "torque references", "{:g}", "torq") == 1
    assert capsys.readouterr().out == ""

# SPDX-License-Identifier: Apache-2.0
"""cbctl torque and output report the values in force on the board, not the requested ones."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from control_board_ros.cli.line.options import Options
from control_board_ros.cli.verbs.streams import lasting
from control_board_ros.core.terms.reply import accepted

ASKED = {"elbow": 500.0, "wrist": 2.0}
SESSION: Any = SimpleNamespace(options=Options(), shared=False, names=list(ASKED), line=str)


def test_a_bounded_reference_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    sent: list[Any] = []

    def send(names: list[str], values: list[float]) -> Any:
        sent.append((names, values))
        return replace(accepted(tuple(names)), values=(176.0, 2.0))

    assert lasting(SESSION, send, ASKED, None, "torque references", "{:g}", "torq") == 0
    assert sent == [(["elbow", "wrist"], [500.0, 2.0])]
    assert capsys.readouterr().out == (
        "torque references: elbow 176, wrist 2; they stay until changed\n"
    )

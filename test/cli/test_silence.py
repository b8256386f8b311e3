# SPDX-License-Identifier: Apache-2.0
"""A recorder without messages of a board reports it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from control_board_ros.cli.verbs import recording


class Recorder:
    """Boards are silent as in a script, one entry per look; it ends with the script."""

    def __init__(self, *script: list[str]) -> None:
        self._script = list(script)
        self.silent: list[str] = []
        self.counts: dict[str, int] = {}
        self.dropped = 0

    @property
    def ended(self) -> str:
        return "" if self._script else "the script"

    def board_is_gone(self) -> bool:
        return False

    def look(self) -> None:
        self.silent = self._script.pop(0)


def test_a_silent_board_is_reported_once(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each by its name; and again when it comes back later."""
    monkeypatch.setattr(recording, "LOOK", 0.0)
    monkeypatch.setattr(recording, "LOOK_AT_BOARDS", 0.0)
    session: Any = SimpleNamespace(options=SimpleNamespace(json=False))
    recorder = Recorder([], ["/a"], ["/a"], ["/a", "/b"], ["/b"], ["/a", "/b"])
    assert recording.watch(session, recorder, SimpleNamespace(size=0), 60.0) == "the script"
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("no mess")]
    assert [line.split(":")[0] for line in lines] == [
        f"no messages from {board}" for board in ("/a", "/b", "/a")
    ]

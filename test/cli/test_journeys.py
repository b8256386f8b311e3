# SPDX-License-Identifier: Apache-2.0
"""What a verb asks the board: no more than it needs."""

from __future__ import annotations

from typing import Any

import pytest
from cbctl_process import Asker

from control_board_ros.cli.app import invoke
from control_board_ros.cli.board.session import Session
from control_board_ros.cli.line.options import Options
from control_board_ros.client.link import Link
from control_board_ros.testing import BoardProcess

pytestmark = [pytest.mark.ros, pytest.mark.physics]
GUARD = 60.0


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The services that are called from now on."""
    called: list[str] = []
    call = Link.call

    async def note_down(self: Link, service: Any, **fields: Any) -> Any:
        called.append(service.short)
        return await call(self, service, **fields)

    monkeypatch.setattr(Link, "call", note_down)
    return called


def test_a_mode_is_one_round_trip(process: BoardProcess, ask: Asker, asked: list[str]) -> None:
    """The response has the modes; only joints that lost their power are looked at."""
    asked.clear()
    domain = str(process.domain)
    with Session(Options()) as session:
        assert (
            invoke(session, ["mode", "0", "vel", "--timeout", str(GUARD), "--domain", domain]) == 0
        )
        assert asked == ["set_control_mode"]
        session.shared = True
        assert invoke(session, ["mode", "0", "pos"]) == 0
        assert invoke(session, ["mode", "0", "nonsense"]) == 1
        assert asked == ["set_control_mode"] * 2
        assert invoke(session, ["mode", "1", "idl"]) == 0
        # Its position comes by topic; whether it falls, its brake tells.
        assert asked == [*["set_control_mode"] * 3, "get_brake"]

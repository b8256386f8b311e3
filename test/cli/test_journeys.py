# SPDX-License-Identifier: Apache-2.0
"""The requests of a verb: no more than necessary."""

from __future__ import annotations

from typing import Any

import pytest
from cbctl_process import Asker
from rclpy.client import Client
from waiting import GUARD

from control_board_ros.cli.app import invoke
from control_board_ros.cli.board.session import Session
from control_board_ros.cli.line.options import Options
from control_board_ros.testing import BoardProcess

pytestmark = pytest.mark.ros


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The services that are called from now on."""
    called: list[str] = []
    call: Any = Client.call_async

    def note_down(self: Any, request: Any) -> Any:
        called.append(self.srv_name.rpartition("/")[2])
        return call(self, request)

    monkeypatch.setattr(Client, "call_async", note_down)
    return called


def test_a_mode_is_one_round_trip(board: BoardProcess, ask: Asker, asked: list[str]) -> None:
    """The response has the modes; only joints that lost their power are looked at.

    The first request is preceded by a query, which confirms that the board knows the client.
    """
    asked.clear()
    domain = str(board.domain)
    with Session(Options()) as session:
        assert (
            invoke(session, ["mode", "0", "vel", "--timeout", str(GUARD), "--domain", domain]) == 0
        )
        *first, mode = asked
        assert mode == "set_control_mode"
        assert set(first) == {"get_control_mode"}  # confirms the client; may be repeated
        session.shared = True
        asked.clear()
        assert invoke(session, ["mode", "0", "pos"]) == 0
        assert invoke(session, ["mode", "0", "nonsense"]) == 1
        assert asked == ["set_control_mode"]
        asked.clear()
        assert invoke(session, ["mode", "1", "idl"]) == 0
        # Its position comes by topic; whether it falls depends on its brake.
        assert [service for service in asked if service != "get_control_mode"] == [
            "set_control_mode",
            "get_brake",
        ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "requests"),
    [
        (["references"], ["get_references"]),
        (["impedance"], ["get_impedance"]),
        (["brake"], ["get_brake"]),
    ],
)
def test_one_request_reads_all_of_a_response(
    board: BoardProcess, ask: Asker, asked: list[str], line: list[str], requests: list[str]
) -> None:
    """Fields of one response are not asked for one by one."""
    with Session(Options()) as session:
        assert (
            invoke(session, ["modes", "--timeout", str(GUARD), "--domain", str(board.domain)]) == 0
        )
        session.shared = True
        assert invoke(session, line) == 0
        asked.clear()
        assert invoke(session, line) == 0
        assert asked == requests

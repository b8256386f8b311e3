# SPDX-License-Identifier: Apache-2.0
"""cbctl estop says what it has seen: the modes, and the power that drives report."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from control_board_ros.cli.board.session import Session
from control_board_ros.cli.line.words import Refused
from control_board_ros.cli.text.advice import advice
from control_board_ros.cli.verbs import recovery
from control_board_ros.cli.verbs.recovery import wait_for_power_off
from control_board_ros.client import BoardTimeout
from control_board_ros.core.terms.drives import DriveReport
from control_board_ros.core.terms.reply import Reason, refused
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.core.watch.fault_monitor import HEARTBEAT_SILENCE, REQUESTED_STOP

FAULT, POSITION = ControlMode.HW_FAULT, ControlMode.POSITION
OFF, ON, SILENT = (DriveReport(power=power) for power in (False, True, None))


class Board:
    """A client of two joints that see one after the other of these; the last one stays."""

    def __init__(self, *seen: tuple[ControlMode, DriveReport]) -> None:
        self.seen = list(seen)

    def get_control_mode(self, names: list[str]) -> list[ControlMode]:
        return [FAULT, self.seen[0][0]]

    def get_drives(self, names: list[str]) -> list[Any]:
        (_, report), *rest = self.seen
        self.seen = rest or self.seen
        return [SimpleNamespace(reported=OFF), SimpleNamespace(reported=report)]


def session(board: Any) -> Session:
    return cast(Session, SimpleNamespace(names=("a", "b"), client=board))


@pytest.mark.parametrize("last", [OFF, SILENT])
def test_power_that_goes_is_waited_for(last: DriveReport) -> None:
    """S8: the mode first, then a brake that closes before power goes."""
    board = Board((POSITION, ON), (FAULT, ON), (FAULT, last))
    wait_for_power_off(session(board))
    assert board.seen == [(FAULT, last)]


@pytest.mark.parametrize(
    ("mode", "report", "text"),
    [
        (FAULT, ON, "the drive of b reports power"),
        (POSITION, OFF, "b is in POSITION"),
    ],
)
def test_power_that_stays_is_said(
    mode: ControlMode, report: DriveReport, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recovery, "POWER_OFF_TIME", 0.1)
    words = f"the stop is in force, but 0.1 s later {text}; cut the power of the robot"
    with pytest.raises(Refused, match=f"^{words}$"):
        wait_for_power_off(session(Board((mode, report))))


def test_what_cannot_be_read_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(self: Board, names: list[str]) -> Any:
        raise BoardTimeout("no answer")

    monkeypatch.setattr(Board, "get_drives", silent)
    with pytest.raises(Refused, match="confirmed the stop; whether the power is off was not seen"):
        wait_for_power_off(session(Board((FAULT, OFF))))


@pytest.mark.parametrize(
    ("cause", "step"),
    [(REQUESTED_STOP, "release with: cbctl estop release"), (HEARTBEAT_SILENCE, "")],
)
def test_the_release_is_advised_where_it_helps(cause: tuple[str, str], step: str) -> None:
    """E2: a heartbeat that is silent has to come again; no release ends that stop."""
    why, remedy = cause
    reply = refused(f"emergency stop, {why}; {remedy} first", ("a",), Reason.EMERGENCY_STOP)
    assert advice(reply, ["a", "b"], lambda words: f"cbctl {words}", lambda: "") == step

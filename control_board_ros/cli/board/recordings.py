# SPDX-License-Identifier: Apache-2.0
"""Recording boards from a verb."""

from __future__ import annotations

from typing import Any

from ..text.output import note
from .boards import boards_meant
from .session import Session


def read_boards(session: Session) -> list[Any]:
    """The parameters of the boards that are meant."""
    from control_board_ros.client import ControlBoardClient
    from control_board_ros.recording.parameters import Parameters

    parameters = []
    for board in boards_meant(session):
        with ControlBoardClient(
            session.node,
            board,
            find_timeout=session.options.timeout,
            answer_timeout=max(session.options.timeout, 1.0),
        ) as client:
            parameters.append(Parameters.read(client))
    return parameters


def start(session: Session, boards: list[Any], sink: Any) -> Any:
    """Begin to record boards."""
    from control_board_ros.recording.recorder import Recorder

    recorder = Recorder(session.node.context, boards, sink)
    if recorder.skipped:
        note(session, f"not recorded, types are not installed: {', '.join(recorder.skipped)}")
    return recorder


class Silence:
    """Notices that nothing is heard any more, though the boards are there."""

    #: s without a message: diagnostics alone come once per second.
    PATIENCE = 5.0

    def __init__(self, now: float) -> None:
        self._count, self._since, self._told = 0, now, False

    def update(self, count: int, now: float) -> str:
        """What to say, once for each silence; empty while messages come.

        Args:
            count: Messages heard so far.
            now: Time, s.
        """
        if count != self._count:
            self._count, self._since, self._told = count, now, False
        if self._told or now - self._since < self.PATIENCE:
            return ""
        self._told = True
        return (
            f"nothing heard for {now - self._since:.0f} s, though the board is there: is its "
            "process stopped, or the machine or the network overloaded? It is looked for anew, "
            "and the gap is noted in the recording"
        )

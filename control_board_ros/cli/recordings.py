# SPDX-License-Identifier: Apache-2.0
"""Recording boards from a verb."""

from __future__ import annotations

from typing import Any

from .boards import boards_meant
from .output import note
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

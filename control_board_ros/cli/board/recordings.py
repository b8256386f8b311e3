# SPDX-License-Identifier: Apache-2.0
"""Recording boards from a verb."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from control_board_ros.text import file_name

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


def keep_frames(session: Session, folders: Sequence[Path]) -> None:
    """Put the freeze frames of the faults in recordings beside them: every control cycle (E3).

    A table ``freeze_frame_JOINT.csv`` each; recordings that have one are left alone. A board that
    does not answer any more has none to give.
    """
    from control_board_ros.client import BoardError, ControlBoardClient
    from control_board_ros.core.selection import RequestError
    from control_board_ros.recording.reading import read

    patience = {"find_timeout": 1.0, "answer_timeout": 2.0}
    for folder in folders:
        if list(folder.glob("freeze_frame_*.csv")):
            continue
        for recording in read(folder):
            client = ControlBoardClient(session.node, recording.board, **patience)
            with contextlib.suppress(BoardError, RequestError), client:
                for joint in dict.fromkeys(fault.joint for fault in recording.faults):
                    if (frame := client.get_freeze_frame(joint)) is not None:
                        path = folder / f"freeze_frame_{file_name(joint)}.csv"
                        path.write_text(frame.csv(), encoding="utf-8")


class Silence:
    """Detects a loss of messages of present boards."""

    #: s without a message: diagnostics alone come once per second.
    PATIENCE = 5.0

    def __init__(self, now: float) -> None:
        self._count, self._since, self._told = 0, now, False

    def update(self, count: int, now: float) -> str:
        """Text of a loss, once each; empty while messages arrive.

        Args:
            count: Messages received so far.
            now: Time, s.
        """
        if count != self._count:
            self._count, self._since, self._told = count, now, False
        if self._told or now - self._since < self.PATIENCE:
            return ""
        self._told = True
        return (
            f"nothing received for {now - self._since:.0f} s, although the board is there: is its "
            "process stopped, or the machine or the network overloaded? It is looked for again, "
            "and the gap is noted in the recording"
        )

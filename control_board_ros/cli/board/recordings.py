# SPDX-License-Identifier: Apache-2.0
"""Recording boards from a verb."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from control_board_ros.text import file_name

from ..line.words import Refused
from ..text.output import note
from .boards import boards_meant
from .session import Session


def read_boards(session: Session) -> list[Any]:
    """The parameters of the selected boards."""
    from control_board_ros.recording.parameters import Parameters

    parameters = []
    for board in boards_meant(session):
        with session.beside(board) as each:
            parameters.append(Parameters.read(each.client))
    return parameters


def start(session: Session, boards: list[Any], sink: Any) -> Any:
    """Start a recorder of boards, given by their parameters."""
    from control_board_ros.recording.recorder import Recorder

    recorder = Recorder(session.node.context, boards, sink)
    if recorder.skipped:
        note(session, f"not recorded, types are not installed: {', '.join(recorder.skipped)}")
    return recorder


@contextlib.contextmanager
def recorded(session: Session, folder: Path) -> Iterator[Any]:
    """Record into a folder; yields the recorder.

    Raises:
        RecordingError: the recording fails.
        Refused: it ends early.
    """
    from control_board_ros.recording.bag import Bag

    recorder = start(session, read_boards(session), Bag(folder))
    try:
        yield recorder
    finally:
        with uninterrupted():
            recorder.close()
    if recorder.ended:
        raise Refused(recorder.ended)


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Complete a file first: a Ctrl-C meanwhile, which would leave it in pieces, does nothing."""
    if threading.current_thread() is not threading.main_thread():  # signals are not its own
        yield
        return
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    before = {number: signal.signal(number, signal.SIG_IGN) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def note_missing(session: Session, recordings: Sequence[Any]) -> list[str]:
    """Say what an unfinished or damaged recording lacks; returns the lines."""
    missing = list(dict.fromkeys(line for recording in recordings for line in recording.missing))
    for line in missing:
        note(session, line)
    return missing


def keep_frames(session: Session, folders: Sequence[Path]) -> None:
    """Write the freeze frames of recorded faults as ``freeze_frame_JOINT.csv`` beside them (E3).

    Recordings that have one, and boards that do not answer, are skipped.
    """
    from control_board_ros.client import BoardError, ControlBoardClient
    from control_board_ros.core.selection import RequestError
    from control_board_ros.recording import RecordingError
    from control_board_ros.recording.reading import read

    patience = {"find_timeout": 1.0, "answer_timeout": 2.0}
    for folder in folders:
        if not folder.is_dir() or list(folder.glob("freeze_frame_*.csv")):
            continue
        try:
            for recording in read(folder):
                client = ControlBoardClient(session.node, recording.board, **patience)
                with contextlib.suppress(BoardError, RequestError), client:
                    for joint in dict.fromkeys(fault.joint for fault in recording.faults):
                        if (frame := client.get_freeze_frame(joint)) is not None:
                            path = folder / f"freeze_frame_{file_name(joint)}.csv"
                            path.write_text(frame.csv(), encoding="utf-8")
        except (OSError, RecordingError) as error:  # the next fault is recorded all the same
            note(session, f"{folder}: no freeze frames are kept: {error}")

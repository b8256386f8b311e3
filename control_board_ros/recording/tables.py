# SPDX-License-Identifier: Apache-2.0
"""Recordings as CSV: for spreadsheets and programs without ROS."""

from __future__ import annotations

import csv
from pathlib import Path

from control_board_ros.text import file_name

from .errors import RecordingError
from .reading import SIGNALS, BoardRecording, read


def write_csv(folder: Path) -> list[Path]:
    """Write ``state.csv`` and ``events.csv`` into a recording's folder, per board.

    Raises:
        RecordingError: the recording is unreadable, or the tables cannot be written.
    """
    recordings = read(folder)
    files = []
    for recording in recordings:
        prefix = "" if len(recordings) == 1 else file_name(recording.board.strip("/")) + "_"
        states, events = folder / f"{prefix}state.csv", folder / f"{prefix}events.csv"
        try:
            write_states(recording, states)
            write_events(recording, events)
        except OSError as error:
            raise RecordingError(f"cannot write tables to {folder}: {error.strerror}") from error
        files += [states, events]
    return files


def write_states(recording: BoardRecording, path: Path) -> None:
    """A row per state: time (s since the epoch of the board's stamps), then joint by joint."""
    columns = [(joint, signal) for joint in recording.names for signal in SIGNALS]
    values = [recording.signal(signal, joint) for joint, signal in columns]
    with path.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time", *(f"{joint}.{signal}" for joint, signal in columns)])
        for k, time in enumerate(recording.time):
            rows.writerow(
                [f"{recording.start + time:.6f}", *(f"{column[k]:.9g}" for column in values)]
            )


def write_events(recording: BoardRecording, path: Path) -> None:
    """A row per change of a joint's modes, fault, request, note and warning of the log."""
    rows: list[tuple[float, str, str, str]] = []
    for joint in recording.names:
        rows += [(begin, joint, "mode", code) for begin, _, code in recording.control_modes(joint)]
        spans = recording.interaction_modes(joint)
        rows += [(begin, joint, "interaction", code) for begin, _, code in spans]
    rows += [(note.time, "", "note", note.text) for note in recording.notes]
    rows += [(f.time, f.joint, "fault", f"{f.code}: {f.text}") for f in recording.faults]
    rows += [(gap.time, "", "gap", gap.text) for gap in recording.gaps]
    rows += [(r.time, "", "request", r.text) for r in recording.requests]
    rows += [(line.time, "", "log", line.text) for line in recording.log]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "joint", "event", "text"])
        for time, joint, event, text in sorted(rows):
            writer.writerow([f"{recording.start + time:.6f}", joint, event, text])

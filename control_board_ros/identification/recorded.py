# SPDX-License-Identifier: Apache-2.0
"""Recordings of a board: with the plan of ``cbctl identify``, or of any motion.

The plan has of each motion its kind, joints with their speeds, begin and end (s, board's time),
and the reason of an early end.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..description.urdf import UrdfError, parse
from ..recording.errors import RecordingError
from ..recording.reading import BoardRecording, read
from ..settings.couplings import COUPLINGS, coupled, take_couplings
from ..settings.params_file import Entry, SettingsError
from . import IdentificationError
from .robot import Robot
from .samples import SIGNALS, Record
from .shares import MOTIONS
from .tables import moved, stretches

Recorded = tuple[Robot, list[Record], list[str], list[str]]


def recorded(path: Path) -> Recorded:
    """The robot, the records of its motions, the joints that moved, and what is missing.

    Raises:
        IdentificationError: it is no recording of one board, or nothing moved.
        RecordingError: it cannot be read.
    """
    return planned(path) if (path / MOTIONS).is_file() else of_any_motion(path)


def of_any_motion(path: Path) -> Recorded:
    """A recording without plan: all stretches without gaps."""
    (recording, *others) = read(path)
    if others:
        boards = ", ".join(extra.board for extra in (recording, *others))
        raise IdentificationError(f"{path} has several boards: {boards}; record one alone")
    robot = robot_of(recording)
    signals = {name: recording.signals[name] for name in SIGNALS}
    records = stretches(recording.time, signals, recording.names)
    return robot, records, moved(robot, records, str(path)), recording.missing


def planned(folder: Path) -> Recorded:
    """The motions of cbctl identify.

    Raises:
        IdentificationError: the folder has none.
    """
    try:
        plan = json.loads((folder / MOTIONS).read_text("utf-8"))
        board: str = plan["board"]
        recording = next(candidate for candidate in read(folder) if candidate.board == board)
        rows: Sequence[dict[str, Any]] = plan["motions"]
        records = [record_of(recording, row) for row in rows]
    except (OSError, ValueError, KeyError, StopIteration, RecordingError) as error:
        raise IdentificationError(
            f"{folder} has no motions of cbctl identify ({error}); give the folder of --keep"
        ) from error
    joints = list(dict.fromkeys(joint for record in records for joint in record.speeds))
    return robot_of(recording), records, joints, recording.missing


def record_of(recording: BoardRecording, row: dict[str, Any]) -> Record:
    time = recording.time + recording.start
    inside = (time >= row["begin"]) & (time <= row["end"])
    signals = {name: recording.signals[name][inside] for name in SIGNALS}
    return Record(row["what"], row["speeds"], time[inside], signals, row["ended"])


def robot_of(recording: BoardRecording) -> Robot:
    if not recording.urdf or not recording.parameters:
        raise IdentificationError("the recording has no robot description, or no parameters")
    values, where = recording.parameters, recording.board
    entries = {n: Entry(v, where) for n, v in values.items() if n.startswith(f"{COUPLINGS}.")}
    try:
        urdf = parse(recording.urdf.encode(), where, Path())
        urdf, _ = coupled(urdf, take_couplings([entries])[1])
    except (UrdfError, SettingsError) as error:
        raise IdentificationError(str(error)) from error
    return Robot(recording.names, values, urdf, str(values.get("robot", "")))

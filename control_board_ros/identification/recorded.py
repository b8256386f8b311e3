# SPDX-License-Identifier: Apache-2.0
"""Motions of a board recorded by ``cbctl identify``: a recording with its plan.

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
from . import IdentificationError
from .robot import Robot
from .samples import SIGNALS, Record
from .shares import MOTIONS


def recorded(folder: Path) -> tuple[Robot, list[Record], list[str], list[str]]:
    """The robot, the records of its motions, the joints that moved, and what is missing.

    Raises:
        IdentificationError: the folder has no motions of cbctl identify.
    """
    try:
        plan = json.loads((folder / MOTIONS).read_text("utf-8"))
        board: str = plan["board"]
        recording = next(one for one in read(folder) if one.board == board)
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
    try:
        urdf = parse(recording.urdf.encode(), recording.board, Path())
    except UrdfError as error:
        raise IdentificationError(str(error)) from error
    values = recording.parameters
    return Robot(recording.names, values, urdf, str(values.get("robot", "")))

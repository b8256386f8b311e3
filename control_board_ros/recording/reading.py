# SPDX-License-Identifier: Apache-2.0
"""Loading a recording as arrays; requires the library rosbags, not ROS."""

from __future__ import annotations

import itertools
import json
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.interface import (
    FAULTS,
    MODES,
    MOST_JOINTS,
    NOTES,
    REQUEST_LOG,
    ROBOT_DESCRIPTION,
    STATE,
)
from control_board_ros.protocols import Floats
from control_board_ros.text import clean, clean_name, clean_names
from control_board_ros.urdf_xml import published_joints

from .errors import RecordingError, library
from .figures import gaps_in, newer
from .salvage import open_parts, parts_of, salvage
from .topics import GAPS, PARAMETERS, ROSOUT

#: Numeric fields of a state per joint: rad, N·m, s (m, N of sliding joints), %, A, °C.
SIGNALS = (
    "position",
    "velocity",
    "torque",
    "position_reference",
    "velocity_reference",
    "torque_reference",
    "output",
    "current",
    "temperature",
)
#: Likewise; NaN where a board does not report them.
OPTIONAL = ("motor_position", "applied", "age", "external_torque")
#: Field of a parameter's value, by rcl_interfaces/msg/ParameterType.
VALUE_FIELDS = {
    1: "bool_value",
    2: "integer_value",
    3: "double_value",
    4: "string_value",
    6: "bool_array_value",
    7: "integer_array_value",
    8: "double_array_value",
    9: "string_array_value",
}
#: rcl_interfaces/msg/Log: warnings and above.
WARNING = 30

#: s without states that count as a gap; s within which two are the same.
LEAST_GAP, NEAR = 5.0, 2.0

Bools = NDArray[np.bool_]
#: An interval with one mode: from, until (s), code.
Span = tuple[float, float, str]


@dataclass(frozen=True, slots=True)
class Modes:
    """Modes since a time: time (s), control and interaction (codes by joint)."""

    time: float
    control: dict[str, str]
    interaction: dict[str, str]


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a joint: time (s), joint, code, text, until (s; None: to the end)."""

    time: float
    joint: str
    code: int
    text: str
    until: float | None = None


@dataclass(frozen=True, slots=True)
class Note:
    """A note of the operator, a warning of the log, or an answered request: time (s), text."""

    time: float
    text: str


@dataclass(frozen=True, slots=True)
class Gap:
    """A gap without messages of the board: from, until (s)."""

    time: float
    until: float

    @property
    def text(self) -> str:
        return f"no messages for {self.until - self.time:.1f} s"

    def is_near(self, other: Gap) -> bool:
        """Whether both are the same, by different clocks."""
        return abs(self.time - other.time) < NEAR and abs(self.until - other.until) < NEAR


@dataclass(slots=True)
class BoardRecording:
    """The recording of one board. Times are s from its first state.

    Attributes:
        board: Absolute name of its node.
        start: Stamp of the first state, s.
        names: Of the joints.
        time: Of each state, shape (n,).
        signals: By the names of SIGNALS and OPTIONAL, shape (n, joints).
        rejected: Commands ignored, shape (n, joints).
        modes: In order; the first precedes the first state.
        faults: In order.
        gaps: Without messages of the board.
        requests: Services called and goals, in the order of their answers.
        log: Warnings and errors.
        notes: Of the operator.
        parameters: Last values.
        urdf: The robot description; empty if missing.
        missing: What an unfinished or damaged recording lacks, one line each.
    """

    board: str
    start: float
    names: tuple[str, ...]
    time: Floats
    signals: dict[str, Floats]
    rejected: Any
    modes: list[Modes] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    requests: list[Note] = field(default_factory=list)
    log: list[Note] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    urdf: str = ""
    missing: list[str] = field(default_factory=list)

    def signal(self, name: str, joint: str) -> Floats:
        return self.signals[name][:, self.names.index(joint)]

    def parameter(self, joint: str, name: str, default: float = np.nan) -> float:
        """A numeric parameter of a joint."""
        value = self.parameters.get(f"{joint}.{name}", default)
        return float(value) if isinstance(value, int | float) else default

    def control_modes(self, joint: str) -> list[Span]:
        """The control modes of a joint; empty without modes."""
        return self._spans([m.control.get(joint, "") for m in self.modes])

    def interaction_modes(self, joint: str) -> list[Span]:
        """The interaction modes of a joint, likewise."""
        return self._spans([m.interaction.get(joint, "") for m in self.modes])

    def _spans(self, codes: list[str]) -> list[Span]:
        """The intervals of a code per element of ``modes``; each change once."""
        changes = [k for k, code in enumerate(codes) if k == 0 or code != codes[k - 1]]
        times = [max(self.modes[k].time, 0.0) for k in changes]
        times.append(float(self.time[-1]) if self.time.size else 0.0)
        return [(times[n], times[n + 1], codes[k]) for n, k in enumerate(changes)]

    def during(self, spans: Sequence[Span], codes: Container[str]) -> Bools:
        """Whether each state is in a span of one of the codes, shape (n,)."""
        inside = np.zeros(self.time.shape, dtype=bool)
        for begin, end, code in spans:
            if code in codes:
                inside |= (self.time >= begin) & (self.time <= end)
        return inside


def read(path: Path) -> list[BoardRecording]:
    """Load the boards of a recording: a folder, or one MCAP file.

    Of one that was not finished, all whole chunks are read; ``missing`` says what is not.

    Raises:
        RecordingError: no recording, unreadable, or without a board.
    """
    if not path.exists():
        raise RecordingError(f"{path} does not exist; give the folder of a recording")
    if path.is_dir() and not (path / "metadata.yaml").is_file() and not parts_of(path):
        inside = sorted(
            p.name
            for p in path.iterdir()
            if p.is_dir() and ((p / "metadata.yaml").is_file() or parts_of(p))
        )
        hint = f"; recordings in it are: {', '.join(inside[:5])}" if inside else ""
        raise RecordingError(f"{path} has no metadata.yaml: it is no finished recording{hint}")
    recordings, why = read_whole(path)
    if why:
        recordings = read_salvaged(path, why)
    if not recordings:
        raise RecordingError(f"{path} has no states of a control board")
    return recordings


def read_whole(path: Path) -> tuple[list[BoardRecording], str]:
    """The boards of a finished recording; or none, and why it is not finished."""
    highlevel = library("rosbags.highlevel")
    if path.is_dir() and (left := open_parts(path)):
        return [], f"{left[0].name}: was not finished"
    try:
        if path.is_dir() and (left := unlisted(path)):
            return [], f"{left[0].name}: metadata.yaml does not have it; the writer was ended"
        with highlevel.AnyReader([path]) as reader:
            return list(read_boards(reader)), ""
    except Exception as error:  # noqa: BLE001  (damaged files fail anywhere in the library)
        return [], clean(f"{error}" or type(error).__name__)


def unlisted(folder: Path) -> list[Path]:
    """The files beside a metadata.yaml that are not in it."""
    whole = yaml.safe_load((folder / "metadata.yaml").read_text("utf-8"))
    listed = whole["rosbag2_bagfile_information"]["relative_file_paths"]
    return [path for path in sorted(folder.glob("*.mcap")) if path.name not in listed]


def read_salvaged(path: Path, why: str) -> list[BoardRecording]:
    """The boards of what is whole in a recording.

    Raises:
        RecordingError: nothing is, or it cannot be read.
    """
    try:
        salvaged = salvage(path, why)
        recordings = list(read_boards(salvaged))
    except RecordingError:
        raise
    except Exception as error:
        raise RecordingError(f"{path} cannot be read: {why}; {clean(error)}") from error
    for recording in recordings:
        recording.missing = list(map(clean, salvaged.missing))
    return recordings


def read_boards(reader: Any) -> Iterator[BoardRecording]:
    """Each board with at least one state."""
    below = STATE.of("")
    for connection in reader.connections:
        if connection.msgtype == STATE.type and connection.topic.endswith(below):
            recording = read_board(reader, connection.topic.removesuffix(below))
            if recording is not None:
                yield recording


def messages(reader: Any, topic: str) -> Iterator[tuple[float, Any]]:
    """The messages of a topic, with their time of reception, s."""
    connections = [c for c in reader.connections if c.topic == topic]
    if connections:
        for connection, stamp, raw in reader.messages(connections=connections):
            yield 1e-9 * stamp, reader.deserialize(raw, connection.msgtype)


def stamp_of(stamp: Any) -> float:
    """A time stamp, s."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def read_board(reader: Any, board: str) -> BoardRecording | None:
    """Load the recording of a board; None without states."""
    received = list(messages(reader, STATE.of(board)))
    if not received:
        return None
    origin, states = received[0][0], [message for _, message in received]
    stamps = np.array([stamp_of(message.header.stamp) for message in states])
    fresh = newer(stamps)
    kept = list(itertools.compress(states, fresh))
    if len(kept[0].names) > MOST_JOINTS:
        raise ValueError(f"{clean(board)} has {len(kept[0].names)} joints, {MOST_JOINTS} at most")
    recording = BoardRecording(
        board=clean(board),
        start=float(stamps[0]),
        names=clean_names(kept[0].names),
        time=stamps[fresh] - stamps[0],
        signals={
            name: np.array([getattr(message, name) for message in kept], dtype=np.float64)
            for name in SIGNALS
        }
        | {name: optional(kept, name) for name in OPTIONAL},
        rejected=np.array([message.rejected_commands for message in kept], dtype=np.int64),
    )
    for _, message in messages(reader, PARAMETERS.of(board)):
        recording.parameters = parameters_in(message)
    for _, message in messages(reader, ROBOT_DESCRIPTION.of(board)):
        recording.urdf = str(message.data)
    recording.modes = read_modes(reader, recording)
    recording.faults = read_faults(reader, recording)
    recording.requests = read_requests(reader, recording)
    recording.log = read_log(reader, recording)
    # without stamps of the board: in its time by the reception of the first state
    recording.notes = [
        Note(time - origin, clean(message.data))
        for time, message in messages(reader, NOTES.of(board))
    ]
    gaps = [json.loads(message.data) for _, message in messages(reader, GAPS.of(board))]
    recorded = [Gap(float(gap["begin"]) - origin, float(gap["end"]) - origin) for gap in gaps]
    recording.gaps = sorted(
        [*recorded, *steps_of_time(recording.time, recorded)], key=lambda gap: gap.time
    )
    return recording


def steps_of_time(time: Floats, known: Sequence[Gap]) -> list[Gap]:
    """Gaps between the stamps of states: of a silent board, or a step of its clock.

    Those that a recorder noted itself, by its own clock, are not repeated.
    """
    gaps = [Gap(float(time[k]), float(time[k + 1])) for k in gaps_in(time)]
    return [
        gap
        for gap in gaps
        if gap.until - gap.time > LEAST_GAP and not any(gap.is_near(other) for other in known)
    ]


def optional(states: list[Any], name: str) -> Floats:
    """A field, shape (n, joints); NaN where a state lacks it."""
    missing = np.full(len(states[0].names), np.nan)
    rows = [getattr(state, name, missing) for state in states]
    values: Floats = np.array([row if len(row) == missing.size else missing for row in rows])
    return values


def parameters_in(message: Any) -> dict[str, Any]:
    return {
        p.name: getattr(p.value, VALUE_FIELDS[p.value.type])
        for p in message.new_parameters
        if p.value.type in VALUE_FIELDS
    }


def read_modes(reader: Any, recording: BoardRecording) -> list[Modes]:
    """The changes of modes, each once: later files repeat the last one."""
    modes: list[Modes] = []
    for _, message in messages(reader, MODES.of(recording.board)):
        names = clean_names(message.names)
        control = dict(zip(names, clean_names(message.control_modes), strict=True))
        interaction = dict(zip(names, clean_names(message.interaction_modes), strict=True))
        time = stamp_of(message.header.stamp) - recording.start
        if not modes or (modes[-1].control, modes[-1].interaction) != (control, interaction):
            modes.append(Modes(time, control, interaction))
    return modes


def read_faults(reader: Any, recording: BoardRecording) -> list[Fault]:
    running: dict[tuple[Any, ...], Fault] = {}
    over: list[Fault] = []
    for _, message in messages(reader, FAULTS.of(recording.board)):
        now = stamp_of(message.header.stamp) - recording.start
        active = {(f.name, f.code, f.stamp.sec, f.stamp.nanosec): f for f in message.faults}
        for key in [key for key in running if key not in active]:
            gone = running.pop(key)
            over.append(Fault(gone.time, gone.joint, gone.code, gone.text, now))
        for key, f in active.items():
            begun = stamp_of(f.stamp) - recording.start
            running.setdefault(key, Fault(begun, clean_name(f.name), int(f.code), clean(f.text)))
    return sorted([*over, *running.values()], key=lambda fault: fault.time)


def read_requests(reader: Any, recording: BoardRecording) -> list[Note]:
    return [
        Note(stamp_of(message.header.stamp) - recording.start, text_of(message))
        for _, message in messages(reader, REQUEST_LOG.of(recording.board))
    ]


def text_of(message: Any) -> str:
    """One line: request, joints, outcome."""
    fields = message.request if message.request != "{}" else ""
    asked = " ".join(filter(None, [message.name, ", ".join(message.names), fields]))
    end = message.event if message.success or message.event != "answered" else "failed"
    return f"{asked}: {end}" + (f", {message.message}" if message.message else "")


def read_log(reader: Any, recording: BoardRecording) -> list[Note]:
    """Warnings and errors of the board's log during the recording."""
    node = recording.board.strip("/").replace("/", ".")
    return [
        Note(stamp_of(message.stamp) - recording.start, clean(message.msg))
        for _, message in messages(reader, ROSOUT.name)
        if message.level >= WARNING and message.name == node
    ]


def kinds_of(urdf: str, names: tuple[str, ...]) -> Mapping[str, JointKind]:
    """The kinds of joints; REVOLUTE if not in the URDF."""
    joints = published_joints(urdf)
    return {name: JointKind.of(joints[name].kind if name in joints else None) for name in names}

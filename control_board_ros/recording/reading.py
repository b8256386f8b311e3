# SPDX-License-Identifier: Apache-2.0
"""A recording read back as arrays; needs the library rosbags, and no ROS."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from control_board_ros.interface import FAULTS, MODES, ROBOT_DESCRIPTION, STATE
from control_board_ros.protocols import Floats

from .errors import RecordingError, library
from .topics import PARAMETERS, ROSOUT

#: The fields of a state that are numbers per joint, with their unit for rotating joints.
SIGNALS = {
    "position": "rad",
    "velocity": "rad/s",
    "torque": "N·m",
    "position_reference": "rad",
    "velocity_reference": "rad/s",
    "torque_reference": "N·m",
    "output": "%",
    "current": "A",
    "temperature": "°C",
}
#: The value of a parameter, by its type in rcl_interfaces/msg/ParameterType.
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
#: rcl_interfaces/msg/Log: a warning, and worse.
WARNING = 30


@dataclass(frozen=True, slots=True)
class Modes:
    """The modes from a time on: time (s), control and interaction (codes by joint)."""

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
class LogLine:
    """A warning or error of a node: time (s), level, node, text."""

    time: float
    level: int
    node: str
    text: str


@dataclass(slots=True)
class BoardRecording:
    """What a recording holds of one board. Times are s from its first state.

    Attributes:
        board: Absolute name of its node.
        start: Stamp of the first state, s.
        names: Of the joints.
        time: Of each state, shape (n,).
        signals: By the names of SIGNALS, shape (n, joints).
        motion_done: Shape (n, joints).
        rejected: Commands ignored, shape (n, joints).
        modes: In order; the first from before the first state on.
        faults: In order.
        log: Warnings and errors.
        parameters: As they were last.
        urdf: The robot description; empty where there is none.
    """

    board: str
    start: float
    names: tuple[str, ...]
    time: Floats
    signals: dict[str, Floats]
    motion_done: Any
    rejected: Any
    modes: list[Modes] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    log: list[LogLine] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    urdf: str = ""

    def signal(self, name: str, joint: str) -> Floats:
        """A signal of a joint, shape (n,)."""
        return self.signals[name][:, self.names.index(joint)]

    def parameter(self, joint: str, name: str, default: float = np.nan) -> float:
        """A number among the parameters of a joint."""
        value = self.parameters.get(f"{joint}.{name}", default)
        return float(value) if isinstance(value, int | float) else default

    def control_modes(self, joint: str) -> list[tuple[float, float, str]]:
        """The control modes of a joint: from, until (s), code."""
        marks = [(max(m.time, 0.0), m.control.get(joint, "")) for m in self.modes]
        merged = [m for k, m in enumerate(marks) if k == 0 or m[1] != marks[k - 1][1]]
        end = float(self.time[-1]) if self.time.size else 0.0
        ends = [mark[0] for mark in merged[1:]] + [end]
        return [(begin, stop, code) for (begin, code), stop in zip(merged, ends, strict=True)]


def read(path: Path) -> list[BoardRecording]:
    """The boards of a recording: a folder with metadata.yaml, or one MCAP file.

    Raises:
        RecordingError: there is no recording, it cannot be read, or no board is in it.
    """
    highlevel = library("rosbags.highlevel")
    if not path.exists():
        raise RecordingError(f"{path} does not exist; give the folder of a recording")
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        inside = sorted(p.parent.name for p in path.glob("*/metadata.yaml"))
        hint = f"; recordings in it are: {', '.join(inside[:5])}" if inside else ""
        raise RecordingError(f"{path} has no metadata.yaml: it is no finished recording{hint}")
    try:
        with highlevel.AnyReader([path]) as reader:
            recordings = list(read_boards(reader))
    except (highlevel.AnyReaderError, OSError, ValueError) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error
    if not recordings:
        raise RecordingError(f"{path} has no states of a control board")
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
    """The messages of a topic, with the time at which they were heard, s."""
    wanted = [c for c in reader.connections if c.topic == topic]
    if wanted:
        for connection, stamp, raw in reader.messages(connections=wanted):
            yield 1e-9 * stamp, reader.deserialize(raw, connection.msgtype)


def stamp_of(stamp: Any) -> float:
    """A time stamp, s."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def read_board(reader: Any, board: str) -> BoardRecording | None:
    """What a recording holds of a board; None where it has no state of it."""
    states = [message for _, message in messages(reader, STATE.of(board))]
    if not states:
        return None
    stamps = np.array([stamp_of(message.header.stamp) for message in states])
    newer = np.concatenate(([True], stamps[1:] > np.maximum.accumulate(stamps)[:-1]))
    kept = [message for message, is_newer in zip(states, newer, strict=True) if is_newer]
    recording = BoardRecording(
        board=board,
        start=float(stamps[0]),
        names=tuple(kept[0].names),
        time=stamps[newer] - stamps[0],
        signals={
            name: np.array([getattr(message, name) for message in kept], dtype=np.float64)
            for name in SIGNALS
        },
        motion_done=np.array([message.motion_done for message in kept], dtype=bool),
        rejected=np.array([message.rejected_commands for message in kept], dtype=np.int64),
    )
    for _, message in messages(reader, PARAMETERS.of(board)):
        recording.parameters = parameters_in(message)
    for _, message in messages(reader, ROBOT_DESCRIPTION.of(board)):
        recording.urdf = str(message.data)
    recording.modes = read_modes(reader, recording)
    recording.faults = read_faults(reader, recording)
    recording.log = read_log(reader, recording)
    return recording


def parameters_in(message: Any) -> dict[str, Any]:
    """Values by name."""
    return {
        p.name: getattr(p.value, VALUE_FIELDS[p.value.type])
        for p in message.new_parameters
        if p.value.type in VALUE_FIELDS
    }


def read_modes(reader: Any, recording: BoardRecording) -> list[Modes]:
    """The changes of modes, each once: files that follow repeat the last one."""
    found: list[Modes] = []
    for _, message in messages(reader, MODES.of(recording.board)):
        control = dict(zip(message.names, message.control_modes, strict=True))
        interaction = dict(zip(message.names, message.interaction_modes, strict=True))
        time = stamp_of(message.header.stamp) - recording.start
        if not found or (found[-1].control, found[-1].interaction) != (control, interaction):
            found.append(Modes(time, control, interaction))
    return found


def read_faults(reader: Any, recording: BoardRecording) -> list[Fault]:
    """The faults, each with its end."""
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
            running.setdefault(key, Fault(begun, str(f.name), int(f.code), str(f.text)))
    return sorted([*over, *running.values()], key=lambda fault: fault.time)


def read_log(reader: Any, recording: BoardRecording) -> list[LogLine]:
    """Warnings and errors of the log while the recording ran."""
    node = recording.board.strip("/").replace("/", ".")
    return [
        LogLine(
            stamp_of(message.stamp) - recording.start,
            int(message.level),
            str(message.name),
            str(message.msg),
        )
        for _, message in messages(reader, ROSOUT.name)
        if message.level >= WARNING and message.name == node
    ]


def sliding(urdf: str, names: tuple[str, ...]) -> Mapping[str, bool]:
    """Which joints are prismatic; false for those that the URDF does not tell."""
    from xml.etree import ElementTree

    try:
        robot = ElementTree.fromstring(urdf)
    except ElementTree.ParseError:
        return dict.fromkeys(names, False)
    kinds = {joint.get("name", ""): joint.get("type", "") for joint in robot.findall("joint")}
    return {name: kinds.get(name) == "prismatic" for name in names}

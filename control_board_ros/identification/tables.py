# SPDX-License-Identifier: Apache-2.0
"""Anybody's log of an arm as records: a table (CSV), or a ROS bag (MCAP, db3).

Each signal is described by ``COLUMNS:UNIT``. Columns are names with ``{0}`` or ``{1}`` in place of
the joint's number, from 0 or 1, or ``{name}`` in place of its name; ``q1,q2,q3``; or, by numbers
from 1, ``2-7``. A column of a bag is ``/topic/field/…``, with the name of a joint or a number from
0 below a field of several. A unit with a minus has the other direction: ``-A``.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import yaml

from ..core.terms.joint_kind import JointKind
from ..protocols import Floats
from ..recording.errors import RecordingError, library
from ..recording.figures import gaps_in, newer
from ..recording.reading import stamp_of
from . import IdentificationError
from .robot import Robot
from .samples import MIN_RECORD_S, SIGNALS, Record

TIME, POSITION, VELOCITY, REFERENCE = "time", "position", "velocity", "position_reference"
#: Units, in SI, of turning and sliding joints; of the first one where none is given.
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
DEGREE, TURN = math.pi / 180.0, 2.0 * math.pi
ANGLES = {"rad": 1.0, "deg": DEGREE, "rev": TURN, "m": 1.0, "mm": 1e-3}
#: Units of turning joints alone, and of sliding ones; both take the SI unit of either.
TURNING, SLIDING = ("deg", "rev", "rpm", "mNm", "kNm"), ("mm",)
SPEEDS = {f"{unit}/s": factor for unit, factor in ANGLES.items()} | {"rpm": TURN / 60.0}
TORQUES = {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3, "N": 1.0}
UNITS: dict[str, dict[str, float]] = {
    TIME: SECONDS,
    POSITION: ANGLES,
    VELOCITY: SPEEDS,
    "torque": TORQUES,
    "current": {"A": 1.0, "mA": 1e-3},
    "output": {"%": 1.0, "share": 100.0},
    REFERENCE: ANGLES,
    "motor_position": ANGLES,
}
#: Lowest rate of readings, Hz; a gap, s: no value is made up within.
MIN_RATE_HZ, MAX_GAP_S = 50.0, 0.1
#: Period beyond which a log is taken to have another unit of time, s.
MAX_PERIOD = 1.0
#: Numbers that nothing measures: what a torn cell reads as. Times are below, in ns, too.
MAX_READING = 1e20
#: A multiple of the limits of speed, torque and position that nothing is at: a torn row.
MAX_LIMIT_RATIO = 5.0
#: Travel below which a joint did not move, rad and m.
MIN_TRAVEL_RAD, MIN_TRAVEL_M = 0.05, 5e-3
#: Fields of messages with the names of joints.
NAME_FIELDS = ("name", "names", "joint_names")
#: Files of bags.
BAGS = (".mcap", ".db3")
#: Kind of motion of a log.
LOG = "log"
RANGE = re.compile(r"(\d+)-(\d+)")


@dataclass(frozen=True, slots=True)
class Source:
    """Where a signal is: its columns, one per joint, and the factor of their unit."""

    columns: tuple[str, ...]
    factor: float


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A column: time (s, shape (m,)), values (shape (m,))."""

    time: Floats
    values: Floats


def sources_of(
    words: Mapping[str, str], names: Sequence[str], kinds: Sequence[JointKind]
) -> dict[str, Source]:
    """The signals by name, of joints in the board's order.

    Raises:
        IdentificationError: a signal or unit is unknown or not one of a joint's kind, or the
            number of columns is wrong.
    """
    sources = {}
    for signal, word in words.items():
        if signal not in UNITS:
            raise IdentificationError(f"{signal}: no signal; there are {', '.join(UNITS)}")
        columns, _, unit = word.rpartition(":")
        if not columns:
            columns, unit = word, next(iter(UNITS[signal]))
        sign = -1.0 if unit.startswith("-") else 1.0
        plain = unit.removeprefix("-").replace("·", "").replace("°", "deg")
        if plain not in UNITS[signal]:
            raise IdentificationError(
                f"{signal}: {unit!r} is no unit of it; there are {', '.join(UNITS[signal])}"
            )
        foreign = [n for n, kind in zip(names, kinds, strict=True) if is_foreign(plain, kind)]
        if foreign:
            raise IdentificationError(
                f"{signal}: {unit!r} is no unit of {foreign[0]}; robots with joints of both kinds "
                "take SI units: rad and m, N·m and N"
            )
        parts = columns_of(columns, [TIME] if signal == TIME else names)
        count = 1 if signal == TIME else len(names)
        if len(parts) != count:
            raise IdentificationError(
                f"{signal}: {columns!r} names {len(parts)} columns, and {count} are needed"
                + ("" if signal == TIME else f": {', '.join(names)}")
            )
        sources[signal] = Source(tuple(parts), sign * UNITS[signal][plain])
    if POSITION not in sources:
        raise IdentificationError("no position: give --column position=COLUMNS:UNIT")
    if not {"torque", "current"} & set(sources):
        raise IdentificationError("no torque and no current: nothing shows what the joints give")
    return sources


def is_foreign(unit: str, kind: JointKind) -> bool:
    """Whether a unit is one of the other kind of joint."""
    return unit.partition("/")[0] in (TURNING if kind.slides else SLIDING)


def columns_of(pattern: str, names: Sequence[str]) -> list[str]:
    """The columns that a pattern names."""
    if "{" in pattern:
        try:
            return [pattern.format(k, k + 1, name=name) for k, name in enumerate(names)]
        except (IndexError, KeyError, ValueError):
            raise IdentificationError(
                f"{pattern!r}: write {{0}}, {{1}} or {{name}} in place of the joint"
            ) from None
    columns = []
    for part in pattern.split(","):
        numbers = RANGE.fullmatch(part.strip())
        if numbers is None:
            columns.append(part.strip())
        else:
            columns += map(str, range(int(numbers[1]), int(numbers[2]) + 1))
    return columns


def words_of(columns: Path | None, options: Sequence[str]) -> dict[str, str]:
    """The descriptions of signals, of a file and, above them, of words ``SIGNAL=COLUMNS:UNIT``.

    Raises:
        IdentificationError: the file, or a word, is not readable.
    """
    words: dict[str, str] = {}
    if columns is not None:
        try:
            read = yaml.safe_load(columns.read_text("utf-8"))
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
            raise IdentificationError(f"{columns} cannot be read: {error}") from error
        if not isinstance(read, dict):
            raise IdentificationError(f"{columns}: write lines such as 'position: q{{0}}:rad'")
        words |= {str(signal): str(word) for signal, word in read.items()}
    for word in options:
        signal, mark, rest = word.partition("=")
        if not mark:
            raise IdentificationError(f"{word!r}: write SIGNAL=COLUMNS:UNIT")
        words[signal] = rest
    return words


def table_of(path: Path) -> dict[str, Floats]:
    """The columns of a text table, by their names if it has a head, and by numbers from 1.

    Raises:
        IdentificationError: it is no table of numbers.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            lines = [line for line in file if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise IdentificationError(f"{path} cannot be read: {error}") from error
    if len(lines) < 2:
        raise IdentificationError(f"{path} is empty")
    mark = next((separator for separator in ";\t," if separator in lines[0]), " ")
    rows = csv.reader(lines, delimiter=mark, skipinitialspace=mark == " ")
    head = [cell.strip() for cell in next(rows)]
    titled = not all(is_number(cell) for cell in head if cell)
    if not lines[-1].endswith("\n"):
        lines.pop()  # cut off amid a row
    try:
        values = np.loadtxt(
            lines[1:] if titled else lines,
            delimiter=None if mark == " " else mark,
            converters=cell_value,
            ndmin=2,
        )
    except ValueError as error:
        why = str(error).partition("; use ")[0]
        raise IdentificationError(f"{path} is no table of numbers: {why}") from error
    values[np.abs(values) > MAX_READING] = np.nan
    table: dict[str, Floats] = {str(k + 1): row for k, row in enumerate(values.T)}
    return table | dict(zip(head, values.T, strict=False)) if titled else table


def is_number(text: str) -> bool:
    try:
        cell_value(text)
    except ValueError:
        return False
    return True


def cell_value(text: str) -> float:
    """The number of a cell, maybe with a decimal comma; NaN where it is empty."""
    return float(text.replace(",", ".")) if text.strip() else math.nan


def series_of_table(path: Path, sources: Mapping[str, Source]) -> dict[str, list[Series]]:
    """The signals of a text table.

    Raises:
        IdentificationError: a column is missing.
    """
    table = table_of(path)
    if TIME not in sources:
        raise IdentificationError("no time: give --column time=COLUMN:UNIT")
    missing = [c for source in sources.values() for c in source.columns if c not in table]
    if missing:
        heads = [name for name in table if not name.isdigit()] or list(table)
        raise IdentificationError(
            f"{path} has no column {missing[0]}; there are {', '.join(heads[:40])}"
        )
    time = sources[TIME].factor * table[sources[TIME].columns[0]]
    return {
        signal: [Series(time, source.factor * table[column]) for column in source.columns]
        for signal, source in sources.items()
    }


def series_of_bag(path: Path, sources: Mapping[str, Source]) -> dict[str, list[Series]]:
    """The signals of a ROS bag; times are those of headers, or of reception.

    Raises:
        IdentificationError: a topic or field is missing.
        RecordingError: the library is.
    """
    highlevel = library("rosbags.highlevel")
    typesys = library("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    columns = {c for signal, source in sources.items() if signal != TIME for c in source.columns}
    rows: dict[str, list[tuple[float, float]]] = {column: [] for column in columns}
    try:
        with highlevel.AnyReader([path], default_typestore=store) as reader:
            of_topic: dict[str, list[tuple[str, list[str]]]] = {}
            topics = sorted({c.topic for c in reader.connections}, key=len, reverse=True)
            for column in columns:
                topic = next((t for t in topics if column.startswith(f"{t}/")), None)
                if topic is None:
                    raise IdentificationError(
                        f"{path} has no topic of {column}; there are {', '.join(sorted(topics))}"
                    )
                of_topic.setdefault(topic, []).append(
                    (column, column[len(topic) + 1 :].split("/"))
                )
            connections = [c for c in reader.connections if c.topic in of_topic]
            for connection, stamp, raw in reader.messages(connections=connections):
                message = reader.deserialize(raw, connection.msgtype)
                header = getattr(message, "header", None)
                time = stamp_of(header.stamp) if header is not None else 0.0
                for column, field in of_topic[connection.topic]:
                    rows[column].append((time or 1e-9 * stamp, field_of(message, field, column)))
    except (IdentificationError, RecordingError):
        raise
    except Exception as error:  # damaged files fail anywhere in the library
        raise IdentificationError(f"{path} cannot be read: {error}") from error

    def series(column: str, factor: float) -> Series:
        time, values = np.array(rows[column], dtype=np.float64).reshape(-1, 2).T
        return Series(time, factor * values)

    return {
        signal: [series(column, source.factor) for column in source.columns]
        for signal, source in sources.items()
        if signal != TIME
    }


def field_of(message: Any, field: Sequence[str], column: str) -> float:
    """A number of a message; NaN where a joint is not in it."""
    value: Any = message
    names: list[str] = []
    for part in field:
        if isinstance(value, np.ndarray | list | tuple):
            place = names.index(part) if part in names else int(part) if part.isdigit() else -1
            if not 0 <= place < len(value):
                return math.nan
            value = value[place]
        elif hasattr(value, part):
            names = next((list(getattr(value, n)) for n in NAME_FIELDS if hasattr(value, n)), [])
            value = getattr(value, part)
        else:
            raise IdentificationError(f"{column}: the messages have no {part}")
    return float(value)


def records_of(
    series: Mapping[str, Sequence[Series]],
    names: Sequence[str],
    bounds: Mapping[str, Floats] = MappingProxyType({}),
) -> list[Record]:
    """The stretches of a log without gaps, at the times of its positions.

    Args:
        series: By signal, one per joint.
        names: Of the joints.
        bounds: Of signals, shape (n,): rows with more, of either sign, are torn.

    Raises:
        IdentificationError: it is too slow, has nothing but gaps, or is torn for the most part.
    """
    time = series[POSITION][0].time
    signals = {
        name: on_times(series[name], time)
        if name in series
        else np.full((time.size, len(names)), np.nan)
        for name in SIGNALS
    }
    known = np.isfinite(time)
    for signal, bound in bounds.items():
        torn = (np.abs(signals[signal]) > bound).any(axis=1)
        if 2 * torn.sum() > torn.size:
            raise IdentificationError(
                f"{signal}: {torn.sum()} of {torn.size} rows are far beyond the limits of the "
                "robot; is the unit right?"
            )
        known &= ~torn
    for name in series.keys() & set(SIGNALS):
        known &= np.isfinite(signals[name]).all(axis=1)
    return stretches(time[known], {name: row[known] for name, row in signals.items()}, names)


def stretches(time: Floats, signals: dict[str, Floats], names: Sequence[str]) -> list[Record]:
    """The records of signals, cut at gaps; readings that are not newer are left out.

    Raises:
        IdentificationError: as ``records_of``.
    """
    fresh = newer(time)
    time = time[fresh]
    signals = {name: values[fresh] for name, values in signals.items()}
    if time.size < 8:
        raise IdentificationError(f"the log has {time.size} whole rows; is a column empty?")
    period = float(np.median(np.diff(time)))
    if period > 1.05 / MIN_RATE_HZ:
        raise IdentificationError(
            f"the log has {1.0 / period:.3g} readings a second, and {MIN_RATE_HZ:.0f} are needed"
            + ("; is the unit of time right?" if period > MAX_PERIOD else "")
        )
    records = []
    for rows in np.split(np.arange(time.size), gaps_in(time, MAX_GAP_S) + 1):
        if time[rows[-1]] - time[rows[0]] >= MIN_RECORD_S and rows.size >= 8:
            piece = {name: values[rows] for name, values in signals.items()}
            records.append(record_of(time[rows], piece, names))
    if not records:
        raise IdentificationError(f"no part of the log is {MIN_RECORD_S:g} s long without a gap")
    return records


def on_times(columns: Sequence[Series], time: Floats) -> Floats:
    """Columns at other times, linearly between theirs; shape (m, n)."""
    rows = [
        column.values
        if column.time is time or np.array_equal(column.time, time)
        else np.interp(time, column.time, column.values, left=np.nan, right=np.nan)
        for column in columns
    ]
    return np.column_stack(rows)


def record_of(time: Floats, signals: dict[str, Floats], names: Sequence[str]) -> Record:
    """A stretch; velocities and references that are missing are those of the positions."""
    if not np.isfinite(signals[VELOCITY]).all():
        signals[VELOCITY] = np.gradient(signals[POSITION], time, axis=0)
    if not np.isfinite(signals[REFERENCE]).all():
        signals[REFERENCE] = signals[POSITION]
    fastest = np.abs(signals[VELOCITY]).max(axis=0).tolist()
    return Record(LOG, dict(zip(names, fastest, strict=True)), time, signals)


def read_log(path: Path, words: Mapping[str, str], robot: Robot) -> list[Record]:
    """The records of a robot's log.

    Raises:
        IdentificationError, RecordingError: it cannot be read, or shows nothing.
    """
    sources = sources_of(words, robot.names, [robot.kind(name) for name in robot.names])
    bag = path.is_dir() or path.suffix in BAGS
    whole = series_of_bag(path, sources) if bag else series_of_table(path, sources)
    ends = [np.abs(robot.numbers(f"limits.hard_{side}")) for side in ("lower", "upper")]
    bounds = {
        POSITION: MAX_LIMIT_RATIO * np.maximum(*ends),
        VELOCITY: MAX_LIMIT_RATIO * robot.numbers("limits.velocity"),
        "torque": MAX_LIMIT_RATIO * robot.numbers("limits.torque"),
    }
    return records_of(whole, robot.names, bounds)


def read_robot(
    paths: Sequence[Path], robot: str, words: Mapping[str, str]
) -> tuple[Robot, list[Record], list[str]]:
    """The robot of logs, their records, and the joints that moved.

    Raises:
        IdentificationError, RecordingError: it cannot be read, or shows nothing.
    """
    made = Robot.of_metal(robot)
    records = [record for path in paths for record in read_log(path, words, made)]
    return made, records, moved(made, records, ", ".join(map(str, paths)))


def moved(robot: Robot, records: Sequence[Record], source: str) -> list[str]:
    """The joints that moved; raises IdentificationError where none did."""
    joints = [
        name
        for k, name in enumerate(robot.names)
        if max(np.ptp(record.signals[POSITION][:, k]) for record in records)
        > robot.kind(name).choose(MIN_TRAVEL_RAD, MIN_TRAVEL_M)
    ]
    if not joints:
        raise IdentificationError(f"{source}: no joint moved")
    return joints

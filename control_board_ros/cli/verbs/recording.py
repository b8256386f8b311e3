# SPDX-License-Identifier: Apache-2.0
"""cbctl record and report."""

from __future__ import annotations

import shlex
import time as clock
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from control_board_ros.text import file_name

from ..board.progress import Bar
from ..board.recordings import keep_frames, note_missing, read_boards, start, uninterrupted
from ..board.session import Session
from ..line.arguments import FOR, amount, argument, patterns, with_arguments
from ..line.words import Refused, UsageError
from ..text.output import DONE, REFUSED, complain, note, show

#: s between updates of the progress, and between checks of the boards.
LOOK, LOOK_AT_BOARDS = 0.25, 2.0
SILENT = (
    "no messages from {board}: was its process killed or stopped, or is the machine or the "
    "network overloaded? It is looked for again, and the gap is noted in the recording"
)


def at_least_one(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text[:9]) > 0):
        raise UsageError(f"--keep {text} is not valid; give a number of recordings, 1 or more")
    return int(text[:9])


@patterns
@with_arguments(
    argument(
        "-o", "--output", required=True, metavar="FOLDER", help="The folder of the recording."
    ),
    FOR,
    amount(
        "--split-size", "size", metavar="SIZE", help="Begin a new file at this size, e.g. 500MB."
    ),
    amount(
        "--split-time",
        "time",
        metavar="TIME",
        help="Begin a new file after this time, e.g. 10min.",
    ),
    amount(
        "--last",
        "time",
        metavar="TIME",
        help="Black box: keep the last seconds in memory, e.g. 60s, and write them into a new "
        "folder below FOLDER when a fault happens.",
    ),
    amount(
        "--after",
        "time",
        default="2s",
        metavar="TIME",
        help="Time recorded after a fault, with --last.",
    ),
    argument(
        "--keep",
        type=at_least_one,
        default=50,
        metavar="NUMBER",
        help="Recordings of faults to keep, with --last; the oldest are removed.",
    ),
    amount(
        "--keep-size",
        "size",
        default="2GB",
        metavar="SIZE",
        help="Their size, with --last; the oldest are removed.",
    ),
    argument("--csv", action="store_true", help="Also write CSV tables."),
)
def record(
    session: Session,
    output: str,
    time: float | None,
    split_size: float | None,
    split_time: float | None,
    last: float | None,
    after: float,
    keep: int,
    keep_size: float,
    csv: bool,
) -> int:
    """Record everything of a board into MCAP files, as rosbag2 does, until Ctrl-C.

    Topics, parameters, robot description, modes, faults and the log go into one folder, which ros2
    bag, Foxglove, PlotJuggler and cbctl report read.
    """
    from control_board_ros.recording import RecordingError

    limits = {"split_size": split_size, "split_time": split_time}
    if last is not None and any(limits.values()):
        raise UsageError("--last writes short recordings, which --split-… does not apply to")
    boards = read_boards(session)
    if last:
        sink = black_box(Path(output), last, after, keep, keep_size)
    else:
        sink = bag(Path(output), limits)
    recorder = start(session, boards, sink)
    try:
        why = watch(session, recorder, sink, time)
    finally:
        with uninterrupted():
            recorder.close()
    if last:
        keep_frames(session, written(sink))
    tables: list[Path] = []
    if csv:
        try:
            tables = write_tables(written(sink))
        except RecordingError as error:
            why = recorder.ended or why or str(error)
    return report_end(session, recorder, sink, why, tables)


def bag(folder: Path, limits: dict[str, Any]) -> Any:
    """A bag, written while recording."""
    from control_board_ros.recording.bag import Bag

    return Bag(folder, **limits, custom={"recorder": "cbctl record"})


def black_box(folder: Path, back: float, after: float, keep: int, keep_size: float) -> Any:
    """The last seconds in memory, written as a bag at each fault.

    Raises:
        Refused: the folder cannot be made.
    """
    from control_board_ros.recording.bag import Bag
    from control_board_ros.recording.black_box import BlackBox
    from control_board_ros.recording.errors import library

    library("rosbags.rosbag2")  # what is missing is reported now, not at the first fault
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Refused(f"cannot make {folder}: {error.strerror}") from None

    def make(path: Path, why: str) -> Bag:
        return Bag(path, custom={"recorder": "cbctl record --last", "fault": why})

    return BlackBox(folder, back, after, make, keep=keep, keep_size=keep_size)


def watch(session: Session, recorder: Any, sink: Any, seconds: float | None) -> str:
    """Show a recording until its end; returns the reason of an early end."""
    begun = clock.monotonic()
    asked = begun
    reported = 0
    silent: list[str] = []
    try:
        with Bar(session, "recording", endless=seconds is None) as bar:
            while not recorder.ended:
                now = clock.monotonic()
                if seconds is not None and now - begun >= seconds:
                    bar.update(1.0, "done")
                    return ""
                share = 0.0 if seconds is None else (now - begun) / seconds
                bar.update(share, progress(recorder, sink, now - begun))
                for path, fault in getattr(sink, "saved", [])[reported:]:
                    note(session, f"{path}: {fault}")
                    keep_frames(session, [path])
                    reported += 1
                if now - asked >= LOOK_AT_BOARDS:
                    asked = now
                    if recorder.board_is_gone():
                        return "the board is gone"
                    recorder.look()
                    before, silent = silent, recorder.silent
                    for board in silent:
                        if board not in before:
                            note(session, SILENT.format(board=board))
                clock.sleep(LOOK)
    except KeyboardInterrupt:
        return ""
    return str(recorder.ended)


def progress(recorder: Any, sink: Any, elapsed: float) -> str:
    """Time, messages, rate, size, and number of dropped messages."""
    count = sum(recorder.counts.values())
    held = f"{sink.size / 1e6:.1f} MB"
    if hasattr(sink, "saved"):
        held += f" held, {len(sink.saved)} written"
    rate = count / elapsed if elapsed > 0.0 else 0.0
    return f"{elapsed:.0f} s, {count} messages ({rate:.0f}/s), {held}, {recorder.dropped} dropped"


def written(sink: Any) -> list[Path]:
    """The folders written, without those removed since."""
    paths = [path for path, _ in sink.saved] if hasattr(sink, "saved") else [sink.folder]
    return [path for path in paths if path.is_dir()]


def write_tables(folders: list[Path]) -> list[Path]:
    from control_board_ros.recording.tables import write_csv

    return [path for folder in folders for path in write_csv(folder)]


def report_end(session: Session, recorder: Any, sink: Any, why: str, tables: list[Path]) -> int:
    """Print a summary; the exit code is 1 for an early end."""
    why = recorder.ended or why
    folders = written(sink)
    size = sum(file.stat().st_size for folder in folders for file in folder.glob("*.mcap"))
    count = sum(recorder.counts.values())
    result = {
        "success": not why,
        "message": why,
        "folders": [str(folder) for folder in folders],
        "tables": [str(table) for table in tables],
        "messages": count,
        "bytes": size,
        "dropped": recorder.dropped,
    }
    lines = []
    for folder in folders:
        files = len(list(folder.glob("*.mcap")))
        lines.append(f"{folder}: {files} {'file' if files == 1 else 'files'}")
    if not folders:
        lines.append("no fault, nothing written")
    lines += [
        f"{count} messages received, {size / 1e6:.1f} MB written, {recorder.dropped} dropped",
        *(f"table: {table}" for table in tables),
    ]
    if folders:
        lines.append(f"see it with: cbctl report {shlex.quote(str(folders[-1]))} -o report.html")
    show(session, result, lambda: "\n".join(lines))
    if why and not session.options.json:
        complain(f"the recording ended early: {why}")
    return REFUSED if why else DONE


@with_arguments(
    argument("recording", metavar="FOLDER", help="The folder of a recording, or one MCAP file."),
    argument(
        "-o", "--output", metavar="FILE.html", help="The report; default: FOLDER/report.html."
    ),
    argument("--png", metavar="FOLDER", help="Also draw pictures of the joints that moved."),
)
def report(session: Session, recording: str, output: str | None, png: str | None) -> int:
    """Make a report of a recording: one HTML file with modes, faults, tracking and figures.

    Works without a board and without ROS.
    """
    from control_board_ros.recording.page import page, write_page
    from control_board_ros.recording.reading import read

    source = Path(recording)
    inside = source if source.is_dir() else source.parent
    path = Path(output) if output else inside / "report.html"
    boards = read(source)
    missing = note_missing(session, boards)
    write_page(path, page(recording, boards))
    pictures = write_pictures(Path(png), boards) if png else []
    result = {"success": True, "report": str(path), "pictures": list(map(str, pictures))}
    result |= {"missing": missing}
    lines = [f"report: {path}", *(f"picture: {picture}" for picture in pictures)]
    show(session, result, lambda: "\n".join(lines))
    return DONE


def unused(folder: Path, name: str, paths: Sequence[Path]) -> Path:
    """A path for a picture that is not in use: names may differ and their files not."""
    path, number = folder / f"{name}.png", 2
    while path in paths:
        path, number = folder / f"{name}_{number}.png", number + 1
    return path


def write_pictures(folder: Path, boards: list[Any]) -> list[Path]:
    """A picture of each joint that moved; the folder is made with the first."""
    from control_board_ros.recording.page import joint_charts
    from control_board_ros.recording.png import write_png

    paths: list[Path] = []
    for board in boards:
        for joint in joint_charts(board):
            if joint.moves:
                paths.append(unused(folder, file_name(joint.joint), paths))
                write_png(paths[-1], joint.joint, joint.charts)
    return paths

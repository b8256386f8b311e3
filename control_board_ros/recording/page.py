# SPDX-License-Identifier: Apache-2.0
"""A report as one self-contained HTML file."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Sequence
from html import escape
from pathlib import Path

from .. import __version__
from ..core.terms.joint_kind import JointKind
from ..text import count_of
from ..whole_file import write_whole
from .charts import (
    MODE_COLOURS,
    MODE_NAMES,
    Chart,
    JointCharts,
    step_chart,
    tracking_charts,
)
from .drawing import draw, foot, head, timeline
from .errors import RecordingError
from .moves import Move, moves_of
from .reading import BoardRecording, Note, kinds_of

#: Maximum number of steps drawn individually per joint.
STEPS_SHOWN = 4
#: Maximum number of moves listed per board.
MOVES_SHOWN = 200
#: Maximum number of log lines.
LINES_SHOWN = 100


def joint_charts(recording: BoardRecording) -> list[JointCharts]:
    kinds = kinds_of(recording.urdf, recording.names)
    made = []
    for joint in recording.names:
        kind = kinds[joint]
        moves = moves_of(recording, joint, kind)
        charts = tracking_charts(recording, joint, moves, kind)
        made.append(JointCharts(joint, charts, moves, kind))
    return made


def short_names(names: Sequence[str]) -> list[str]:
    """The names without their common leading words; at least two words remain."""
    words = [name.split("_") for name in names]
    same = 0
    while all(len(w) > same + 2 and w[same] == words[0][same] for w in words):
        same += 1
    return ["_".join(w[same:]) for w in words]


def page(source: str, recordings: Sequence[BoardRecording], extra: str = "") -> str:
    """The whole report.

    Args:
        source: Where the recording is.
        recordings: Its boards.
        extra: An additional section before the others.
    """
    boards = "".join(board_section(recording) for recording in recordings)
    note = (
        f"Made from {source} by cbctl report. Rise: 10 to 90 %. Settling: until within 2 % of the "
        "step. Lag: the delay of the reference that explains the position best. "
        "Steady: mean error over the last quarter of the time after the reference has come to "
        "rest. Saturated: time at the limit of output or torque."
    )
    return document(f"{Path(source).name}: report", f"{extra}{boards}", note)


def document(title: str, body: str, note: str) -> str:
    """An HTML file of sections with a note below."""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title>{head()}</head><body><main>"
        f"<h1>{escape(title)}</h1>{body}<footer>{escape(note)} "
        f"control_board_ros {__version__}.</footer></main>{foot()}</body></html>"
    )


def board_section(recording: BoardRecording) -> str:
    joints = joint_charts(recording)
    moves = sorted((m for j in joints for m in j.moves), key=lambda m: (m.begin, m.joint))
    kinds = {j.joint: j.kind for j in joints}
    shorts = dict(zip(recording.names, short_names(recording.names), strict=True))
    parts = [
        f"<h2>{escape(recording.board)}</h2>",
        *(f'<p class="bad">Incomplete: {escape(line)}</p>' for line in recording.missing),
        tiles(recording, moves),
        "<h3>Modes and faults</h3>",
        timeline(recording, list(shorts.values())),
        mode_legend(recording),
        fault_table(recording),
        section("Notes", ["at, s", "note"], [line_row(note) for note in recording.notes]),
        section(
            "Gaps: no messages from the board",
            ["at, s", "for, s"],
            [[f"{gap.time:.3f}", f"{gap.until - gap.time:.2f}"] for gap in recording.gaps],
            text=False,
        ),
        folded("answers to requests", "request and answer", recording.requests),
        folded("warnings of the board", "warning", recording.log, opened=" open"),
    ]
    parts.append(move_table(moves, kinds, shorts))
    for joint in joints:
        steps = [m for m in joint.moves if m.mode == "posd" and m.step is not None]
        charts = [
            *joint.charts,
            *(step_chart(recording, m, joint.kind) for m in steps[:STEPS_SHOWN]),
        ]
        faulted = any(fault.joint == joint.joint for fault in recording.faults)
        opened = " open" if joint.moves or faulted or len(joints) <= 2 else ""
        drawn = "".join(draw(chart) for chart in charts)
        parts.append(
            f'<details class="joint"{opened}><summary><b>{escape(joint.joint)}</b> '
            f"{summary(joint)}</summary>{drawn}</details>"
        )
    return "".join(parts)


def tiles(recording: BoardRecording, moves: Sequence[Move]) -> str:
    count, span = len(recording.time), float(recording.time[-1])
    rate = (count - 1) / span if span > 0.0 else 0.0
    ignored = int((recording.rejected[-1] - recording.rejected[0]).sum())
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(recording.start))
    facts = [
        ("Began", began if recording.start > 1e9 else f"{recording.start:.2f} s"),
        ("Duration", f"{span:.1f} s"),
        ("Joints", str(len(recording.names))),
        ("States", f"{count} ({rate:.0f} Hz)"),
        ("Moves", str(len(moves))),
        ("Faults", str(len(recording.faults))),
        ("Ignored commands", str(ignored)),
    ]
    bad = {"Faults": len(recording.faults), "Ignored commands": ignored}
    return (
        '<div class="tiles">'
        + "".join(tile(name, value, "bad" if bad.get(name) else "") for name, value in facts)
        + "</div>"
    )


def tile(name: str, value: str, kind: str = "") -> str:
    return f'<div class="tile {kind}"><span>{escape(name)}</span>{escape(value)}</div>'


def mode_legend(recording: BoardRecording) -> str:
    used = {code for joint in recording.names for _, _, code in recording.control_modes(joint)}
    keys = [
        f'<span class="key"><i style="background:{colour}"></i>{MODE_NAMES[code]}</span>'
        for code, colour in MODE_COLOURS.items()
        if code in used
    ]
    return f'<p class="legend">{"".join(keys)}<span class="key">hatched: COMPLIANT</span></p>'


def fault_table(recording: BoardRecording) -> str:
    rows = [
        [
            f"{fault.time:.3f}",
            "to the end" if fault.until is None else f"{fault.until - fault.time:.2f}",
            fault.joint,
            str(fault.code),
            fault.text,
        ]
        for fault in recording.faults
    ]
    return section("Faults", ["at, s", "for, s", "joint", "code", "cause"], rows)


def line_row(line: Note) -> list[str]:
    return [f"{line.time:.3f}", line.text]


def folded(what: str, head: str, lines: Sequence[Note], opened: str = "") -> str:
    """The first lines below a summary, as a table; empty without lines."""
    if not lines:
        return ""
    rows = [line_row(line) for line in lines[:LINES_SHOWN]]
    if (more := len(lines) - len(rows)) > 0:
        rows.append(["", f"and {more} more"])
    shown = table(["at, s", head], rows, text=True)
    return f"<details{opened}><summary>{len(lines)} {what}</summary>{shown}</details>"


def number(value: float, digits: int = 3) -> str:
    """A figure with at most ``digits`` decimals; a dash for NaN."""
    if not math.isfinite(value):
        return "–"
    size = math.floor(math.log10(abs(value))) if value else 0
    text = f"{value:z.{max(min(digits, digits - 1 - size), 0)}f}"
    return text.replace("-", "−")


def move_table(moves: Sequence[Move], kinds: dict[str, JointKind], shorts: dict[str, str]) -> str:
    heads = [
        "at, s", "joint", "mode", "from", "to", "duration, s", "rise, s", "settling, s",
        "overshoot, %", "steady error", "RMS error", "peak error", "lag, ms", "saturated, s",
    ]  # fmt: skip
    rows = [move_row(move, kinds[move.joint], shorts[move.joint]) for move in moves[:MOVES_SHOWN]]
    if len(moves) > MOVES_SHOWN:
        rows.append(["", f"and {len(moves) - MOVES_SHOWN} more", *[""] * (len(heads) - 2)])
    return section("Moves", heads, rows, text=False)


def move_row(move: Move, kind: JointKind, short: str) -> list[str]:
    """A row of the table; positions in degrees or mm."""
    step = move.step

    return [
        f"{move.begin:.2f}",
        short,
        move.mode,
        kind.position(move.start),
        kind.position(move.target),
        number(move.end - move.begin),
        number(step.rise) if step else "–",
        number(step.settling) if step else "–",
        number(step.overshoot, 2) if step else "–",
        difference(move.steady_error, kind),
        difference(move.tracking.rms, kind),
        difference(move.tracking.peak, kind),
        number(1e3 * move.tracking.lag, 1),
        number(move.saturated),
    ]


def difference(value: float, kind: JointKind) -> str:
    """A difference of positions, with more digits than a position: 0.0004°; 0.012 mm."""
    if not math.isfinite(value):
        return "–"
    return number(kind.shown_factor * value, 4) + kind.choose("°", " mm")


def section(
    title: str, heads: Sequence[str], rows: Sequence[Sequence[str]], *, text: bool = True
) -> str:
    """A table below its title; empty without rows."""
    return f"<h3>{escape(title)}</h3>{table(heads, rows, text=text)}" if rows else ""


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], *, text: bool = False) -> str:
    """A table; ``text``: its last column is left-aligned text."""
    head = "".join(f"<th>{escape(name)}</th>" for name in heads)
    kind = ' class="text"' if text else ""
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f'<div class="scroll"><table{kind}><tr>{head}</tr>{body}</table></div>'


def summary(joint: JointCharts) -> str:
    """Summary of a joint, half a line."""
    if not joint.moves:
        return '<span class="quiet">no moves</span>'
    worst = max(joint.moves, key=lambda m: m.tracking.rms)
    count = count_of(len(joint.moves), "moves")
    rms, peak = (difference(e, joint.kind) for e in (worst.tracking.rms, worst.tracking.peak))
    return f'<span class="quiet">{count}, worst RMS error {rms}, peak {peak}</span>'


def check_output(path: Path, *sources: str | Path | None) -> None:
    """Refuse a parameter file before the work for it, a report beside it included.

    Args:
        path: To write.
        sources: That are read; it must not replace one, nor lie in one that is a folder.

    Raises:
        RecordingError: it cannot be written, or would replace what is read.
    """
    folder = path.absolute().parent
    if not folder.is_dir():
        raise RecordingError(f"{path.parent} is no folder; make it first")
    if path.is_dir() or path.suffix in (".html", ".journal"):
        raise RecordingError(f"{path} is no name of a parameter file; give one as FILE.yaml")
    if not os.access(folder, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise RecordingError(f"cannot write {path}: no permission; give another file")
    for source in sources:
        if source is None or not os.path.exists(source):
            continue
        linked = path.exists() and path.samefile(source)
        if linked or path.resolve().is_relative_to(Path(source).resolve()):
            raise RecordingError(f"{path} is read here, and would be lost; give another file")


def write_page(path: Path, text: str) -> None:
    """Write a report; raises RecordingError where it cannot be written."""
    try:
        write_whole(path, text)
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror}") from error


def chart_section(title: str, facts: Sequence[tuple[str, str]], charts: Sequence[Chart]) -> str:
    """A separate section: figures and charts."""
    shown = "".join(tile(name, value) for name, value in facts)
    drawn = "".join(draw(chart, 240) for chart in charts)
    return f'<h2>{escape(title)}</h2><div class="tiles">{shown}</div>{drawn}'

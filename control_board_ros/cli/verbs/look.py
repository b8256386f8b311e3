# SPDX-License-Identifier: Apache-2.0
"""cbctl modes, info, references and faults, with the freeze frame of a fault drawn (SPEC E3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any

from control_board_ros.text import count_of

from ...core.terms.drives import DriveReport
from ...core.terms.joint_kind import JointKind
from ..board.reading import (
    UNCALIBRATED,
    Rows,
    lacks_calibration,
    read_faults,
    read_joints,
    read_modes,
    read_references,
)
from ..board.session import Session
from ..line.arguments import JOINTS, argument, several, with_arguments
from ..line.words import Refused
from ..text.output import console, mode_text, note, show
from ..text.plotting import Trace, chart, signal_of
from ..text.tables import grid

if TYPE_CHECKING:
    from control_board_ros.client.freeze_frame import FreezeFrame

#: Charts of a freeze frame.
FRAME_CHARTS = (
    ("position", "reference"),
    ("velocity", "velocity_reference"),
    ("torque",),
    ("current",),
)
#: Lines of each chart.
HEIGHT = 6


def frame_rows(frame: FreezeFrame) -> dict[str, Any]:
    from control_board_ros.client.freeze_frame import NUMBERS

    columns = {name: getattr(frame, name).tolist() for name in (*NUMBERS, "motion_done")}
    fault = {"joint": frame.fault.name, "text": frame.fault.text, "stamp": frame.fault.stamp}
    return {"fault": fault, "stamps": frame.stamps.tolist()} | columns


def frame_charts(session: Session, frame: FreezeFrame) -> Any:
    """A freeze frame as charts over the time from the fault."""
    from rich.console import Group

    name, width = frame.fault.name, console().width
    times = (frame.stamps - frame.fault.stamp).tolist()
    span = times[-1] - times[0] if times else 0.0
    drawn: list[Any] = [
        f"{name}: {frame.fault.text}; from {times[0]:.3g} s to {times[-1]:.3g} s around it"
    ]
    for kinds in FRAME_CHARTS:
        traces = []
        for kind in kinds:
            trace = Trace(signal_of(session.kind(name), name, kind, kind), span + 1.0)
            for time, value in zip(times, getattr(frame, trace.signal.field), strict=True):
                trace.add(time, float(value))
            traces.append(trace)
        drawn.append(chart(traces, width, HEIGHT))
    return Group(*drawn)


def show_frame(session: Session, name: str) -> None:
    """Show the freeze frame of a joint's last fault.

    Raises:
        Refused: no fault yet.
    """
    frame = session.client.get_freeze_frame(name)
    if frame is None:
        raise Refused(f"{name} has had no fault since the board was started")
    show(session, frame_rows(frame), lambda: frame_charts(session, frame))


#: Smaller stamps are simulated time, not dates, s.
DATES_FROM = 1e9

#: Columns of references: their cells, of a joint's kind and row.
REFERENCES: dict[str, Callable[[JointKind, dict[str, Any]], str]] = {
    "position": lambda kind, row: kind.position(row["position"]),
    "direct": lambda kind, row: kind.position(row["direct_position"]),
    "velocity": lambda kind, row: kind.velocity(row["velocity"]),
    "vel. dir.": lambda kind, row: kind.velocity(row["direct_velocity"]),
    "torque": lambda kind, row: kind.force(row["torque"]),
    "current": lambda _, row: f"{row['current']:.2f} A",
    "output": lambda _, row: f"{row['output']:.1f} %",
    "speed": lambda kind, row: kind.velocity(row["speed"]),
    "accel.": lambda kind, row: kind.acceleration(row["acceleration"]),
}
#: References of rare modes, by title: left out where all are zero.
RARE = {"vel. dir.": "direct_velocity", "current": "current"}


@several
@with_arguments(JOINTS)
def modes(session: Session, joints: list[str]) -> None:
    """Show the control and interaction mode of joints, and which are not calibrated."""
    rows = read_modes(session, session.joints(joints))

    show(session, rows, lambda: modes_table(session, rows))


def modes_table(session: Session, rows: Rows) -> Any:
    def cell(row: dict[str, Any], kind: str) -> Any:
        uncalibrated = kind == "control_mode" and lacks_calibration(row)
        note = f" ({UNCALIBRATED})" if uncalibrated else ""
        return mode_text(row[kind], f"{row[kind]:5}{row[f'{kind}_name']}{note}")

    columns: dict[str, list[Any]] = {"joint": list(rows)} | {
        kind.replace("_", " "): [cell(row, kind) for row in rows.values()]
        for kind in ("control_mode", "interaction_mode")
    }
    return grid(columns, names=session.names)


@several
def info(session: Session) -> None:
    """Show the joints: index, kind, limits, stops, modes, loops, and the joints that axes move."""
    board, rows = session.client.board_name, read_joints(session)
    show(session, {"board": board, "joints": rows}, lambda: joints_table(board, rows))


def joints_table(board: str, rows: Rows) -> Any:
    columns = {
        "": [str(row["index"]) for row in rows.values()],
        "joint": list(rows),
        "kind": [row["kind"] or "-" for row in rows.values()],
        "limits": ranges(rows, "lower", "upper"),
        "stops": ranges(rows, "hard_lower", "hard_upper"),
        "modes": [" ".join(row["control_modes"]) for row in rows.values()],
        "int.": [" ".join(row["interaction_modes"]) for row in rows.values()],
    }
    if any(row["drive"]["set_points"] != ("pwm",) for row in rows.values()):
        columns["drive: laws"] = [row["drive"]["loops"] for row in rows.values()]
    if any(said := [str(DriveReport(**row["drive"]["reported"])) for row in rows.values()]):
        columns["drive reports"] = said
    if any(row["moves"] and name not in row["moves"] for name, row in rows.items()):
        columns["moves"] = [" ".join(row["moves"]) for row in rows.values()]
    return grid(
        columns,
        names=list(rows),
        keys=2,
        right=("", "limits", "stops"),
        fold=("modes", "drive: laws", "drive reports", "moves"),
        title=board,
    )


def ranges(rows: Rows, low: str, high: str) -> list[str]:
    """The cells of a column of ranges; a dash where one is unknown."""
    return [
        "-"
        if row[low] is None or row[high] is None
        else JointKind.of(row["kind"]).travel(row[low], row[high])
        for row in rows.values()
    ]


@several
@with_arguments(JOINTS)
def references(session: Session, joints: list[str]) -> None:
    """Show the last accepted reference of every kind."""
    rows = read_references(session, session.joints(joints))
    show(session, rows, lambda: references_table(session, rows))


def references_table(session: Session, rows: Rows) -> Any:
    columns = {"joint": list(rows)} | {
        title: [cell(session.kind(name), row) for name, row in rows.items()]
        for title, cell in REFERENCES.items()
        if title not in RARE or any(row[RARE[title]] for row in rows.values())
    }
    return grid(columns, names=session.names, right=list(REFERENCES))


@several
@with_arguments(
    JOINTS,
    argument(
        "--all", dest="every", action="store_true", help="Also the last faults that are cleared."
    ),
    argument("--frame", metavar="JOINT", help="Draw the freeze frame of its last fault."),
)
def faults(session: Session, joints: list[str], every: bool, frame: str | None) -> None:
    """Show the joints in fault, with the reasons."""
    if frame is not None:
        show_frame(session, session.joints([frame])[0])
        return
    records = read_faults(session, session.joints(joints))
    rows = {n: r for n, r in records.items() if r["active"] or (every and r["code"] >= 0)}
    cleared = sum(1 for r in records.values() if r["code"] >= 0 and not r["active"])
    show(session, rows, lambda: faults_table(rows, list(records), cleared))
    if any(row["active"] for row in rows.values()):
        note(session, f"next: {session.line('recover')}")


def faults_table(rows: Rows, names: Sequence[str], cleared: int) -> Any:
    if not rows:
        count = len(names)
        past = f"; {cleared} had one that is cleared: cbctl faults --all" if cleared else ""
        return f"no fault on {count_of(count, 'joints')}{past}"
    from rich.text import Text

    states = {True: Text("in fault", "bold red"), False: Text("cleared", "bright_black")}
    columns: dict[str, list[Any]] = {
        "joint": list(rows),
        "": [states[row["active"]] for row in rows.values()],
        "code": [str(row["code"]) for row in rows.values()],
        "fault": [row["text"] for row in rows.values()],
        "since": [when(row["stamp"]) for row in rows.values()],
    }
    return grid(columns, names=names, right=("code",), fold=("fault",))


def when(stamp: float) -> str:
    if stamp < DATES_FROM:
        return f"{stamp:.3f} s"
    return f"{datetime.fromtimestamp(stamp):%H:%M:%S}"

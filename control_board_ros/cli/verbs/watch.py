# SPDX-License-Identifier: Apache-2.0
"""cbctl watch: many rows on one screen, in blocks side by side."""

from __future__ import annotations

import contextlib
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

from ...joint_limits import JointLimits
from ..board.boards import sessions_meant
from ..board.reading import UNCALIBRATED, Rows, lacks_calibration, read_state
from ..board.session import Session
from ..board.timing import FIGURES, Phases, timed_cycles
from ..line.arguments import JOINTS, argument, number, patterns, with_arguments
from ..line.words import UsageError, short_names
from ..text.output import bar, console, mode_text, put, show
from ..text.tables import drawn, grid, needed, text_of

if TYPE_CHECKING:
    from rich.text import Text

#: Characters between two blocks, and lines of each block's head.
BESIDE, HEAD = 3, 2

#: The limits in force of each joint, where known.
Limits = dict[str, JointLimits | None]

RIGHT = ("position", "reference", "torque", "external", "output")
#: Columns dropped on a narrow terminal, in this order.
DISPENSABLE = ("external", "output", "reference", "its limits", "torque", "int.")
#: Maximum number of lines of faults below joints in blocks.
MOST_FAULTS = 3
#: Minimum width of a longer fault, characters.
FAULT_WIDTH = 20


def fitting(
    columns: Mapping[str, list[Text]], dispensable: Sequence[str], width: int, height: int
) -> tuple[dict[str, list[Text]], int]:
    """The columns to show, and how many blocks of them fit side by side.

    Dispensable columns are dropped in their order until all rows fit.
    """
    kept = dict(columns)
    count = max(map(len, kept.values()))
    left = list(dispensable)
    while True:
        blocks = max((width + BESIDE) // (needed(kept, ()) + BESIDE), 1)
        if blocks * max(height - HEAD, 1) >= count or not left:
            return kept, blocks
        kept.pop(left.pop(0), None)


def dense(
    columns: Mapping[str, list[Text]],
    right: Sequence[str],
    dispensable: Sequence[str],
    width: int,
    height: int,
) -> tuple[Any, int]:
    """A table of many rows within a width and a height, characters.

    Args:
        columns: cells by title.
        right: titles of columns that are aligned to the right.
        dispensable: titles of columns, in the order in which they are dropped.
        width: of the screen.
        height: likewise.

    Returns:
        The table, and how many rows fit.
    """
    from rich.table import Table

    kept, fit = fitting(columns, dispensable, width, height)
    count, room = max(map(len, kept.values())), max(height - HEAD, 1)
    blocks = min(fit, -(-count // room))
    rows = min(room, -(-count // blocks))
    beside = Table.grid(padding=(0, BESIDE, 0, 0))
    beside.add_row(
        *(
            drawn(
                {title: cells[k * rows : (k + 1) * rows] for title, cells in kept.items()}, right
            )
            for k in range(blocks)
        )
    )
    return beside, min(blocks * rows, count)


@patterns
@with_arguments(
    JOINTS,
    argument("--once", action="store_true", help="Show it once and end."),
    argument("--rate", type=number, default=10.0, metavar="RATE", help="Frames per second."),
    argument(
        "--timing",
        action="store_true",
        help="Show where the time of the board's control cycles goes instead, each second.",
    ),
)
def watch(session: Session, joints: list[str], once: bool, rate: float, timing: bool) -> None:
    """Show joints live; Ctrl-C ends it. In a pipe or file: one frame after another.

    Joints beyond the lines of the terminal are shown in blocks side by side. With --json: a line
    per frame.
    """
    if timing:
        if joints:
            raise UsageError("--timing shows the cycles of the whole board; leave out the joints")
        watch_timing(session, once)
        return
    if not 0.0 < rate <= 100.0:
        raise UsageError(f"--rate {rate:g} is not valid; give a rate above 0, up to 100 Hz")
    with sessions_meant(session, joints) as sessions:
        views = [View(board, s, s.joints(joints)) for board, s in sessions.items()]
        if once:
            frame(session, views)
            return
        try:
            follow(session, views, 1.0 / rate)
        except KeyboardInterrupt:
            return


def watch_timing(session: Session, once: bool) -> None:
    """Show where the time of control cycles goes, once or each second."""
    with timed_cycles(session) as seconds, contextlib.suppress(KeyboardInterrupt):
        for phases in seconds:
            show(session, phases, partial(timing_table, phases))
            if once:
                return
            if not session.options.json:
                put("")


def timing_table(phases: Phases) -> Any:
    """A line for each phase of a cycle, and for the whole."""
    columns = {"phase": list(phases)} | {
        f"{figure}, µs": [f"{row[figure]:.1f}" for row in phases.values()] for figure in FIGURES
    }
    return grid(columns, right=[*columns][1:])


class View:
    """The joints of one board on screen, with their limits.

    Attributes: board (its name), session, rows (as last read).
    """

    def __init__(self, board: str, session: Session, names: list[str]) -> None:
        self.board, self.session, self._names = board, session, names
        self._limits: Limits = {} if session.options.json else session.limits(names)
        self.rows: Rows = {}

    def read(self) -> None:
        self.rows = read_state(self.session, self._names)

    def table(self, width: int) -> Any:
        columns = columns_of(self.session, self.rows, self._limits)
        return drawn(fitted(columns, self.session.names, width), RIGHT)

    def columns(self) -> dict[str, list[Text]]:
        """All columns of the rows, with short names."""
        columns = columns_of(self.session, self.rows, self._limits)
        shorts = short_names(list(self.rows), self.session.names)
        return columns | {"joint": [text_of(shorts[name]) for name in self.rows]}

    def faults(self) -> list[tuple[str, str]]:
        """Joints in fault, and the texts of their faults."""
        return [(name, row["fault"]) for name, row in self.rows.items() if row["fault"]]


def frame(session: Session, views: Sequence[View]) -> None:
    """Read and print all boards once."""
    for view in views:
        view.read()
    show(session, values_of(views), partial(stacked, views, console().width))


def values_of(views: Sequence[View]) -> dict[str, Any]:
    return views[0].rows if len(views) == 1 else {view.board: view.rows for view in views}


def stacked(views: Sequence[View], width: int) -> Any:
    """The tables of all boards, one below the other."""
    if len(views) == 1:
        return views[0].table(width)
    from rich.console import Group

    return Group(*(part for view in views for part in (view.board, view.table(width), "")))


def follow(session: Session, views: Sequence[View], period: float) -> NoReturn:
    """Show the rows repeatedly: in place on a terminal, else frame by frame."""
    screen = console()
    if session.options.json or not screen.is_terminal:
        while True:
            frame(session, views)
            if not session.options.json:
                put("")
            time.sleep(period)
    from rich.live import Live

    with Live(console=screen, auto_refresh=False) as live:
        while True:
            for view in views:
                view.read()
            live.update(on_screen(views, screen.width, screen.height), refresh=True)
            time.sleep(period)


def on_screen(views: Sequence[View], width: int, height: int) -> Any:
    """All boards within a terminal: tables where they fit, else joints in blocks."""
    heads = HEAD if len(views) == 1 else HEAD + 2
    if sum(len(view.rows) + heads for view in views) < height:
        return stacked(views, width)
    from rich.console import Group
    from rich.text import Text

    columns = defaultdict[str, list[Text]](list)
    for view in views:
        for title, cells in view.columns().items():
            if len(views) > 1:
                columns[title].append(Text(view.board if title == "joint" else "", style="bold"))
            columns[title] += cells
    del columns["fault"]
    troubles = [trouble for view in views for trouble in view.faults()]
    notes = [
        Text(f"{name}: {fault}", style="red", no_wrap=True, overflow="ellipsis")
        for name, fault in troubles[:MOST_FAULTS]
    ]
    if len(troubles) > MOST_FAULTS:
        notes[-1] = Text(f"… {len(troubles) - MOST_FAULTS + 1} more in fault: cbctl faults", "red")
    room = height - len(notes) - 2  # lines for the number of hidden rows and for the cursor
    table, shown = dense(columns, RIGHT, DISPENSABLE, width, room)
    rest = len(columns["joint"]) - shown
    if rest:
        text = f"… {rest} lines more: a larger terminal, or cbctl watch JOINT…"
        notes.append(Text(text, no_wrap=True, overflow="ellipsis"))
    return Group(table, *notes)


def columns_of(session: Session, rows: Rows, limits: Limits) -> dict[str, list[Text]]:
    """All columns by title, in their order."""
    from rich.text import Text

    def cells(name: str, row: dict[str, Any]) -> dict[str, Text]:
        kind, known = session.kind(name), limits[name]
        scale = "" if known is None else bar(row["position"], known.lower, known.upper)
        trouble = row["fault"] or (UNCALIBRATED if lacks_calibration(row) else "")
        return {
            "joint": Text(name),
            "mode": mode_text(row["control_mode"]),
            "int.": mode_text(row["interaction_mode"]),
            "position": Text(kind.position(row["position"])),
            "its limits": Text(scale),
            "reference": Text(kind.position(row["position_reference"])),
            "torque": Text(kind.force(row["torque"])),
            "external": Text(kind.force(row["external_torque"])),
            "output": Text(f"{row['output']:z.0f} %"),
            "fault": Text(trouble, style="red"),
        }

    joints = [cells(name, row) for name, row in rows.items()]
    return {title: [joint[title] for joint in joints] for title in joints[0]}


def fitted(
    columns: dict[str, list[Text]], names: Sequence[str], width: int
) -> dict[str, list[Text]]:
    """Columns that fit: with short names first, then without the dispensable columns."""
    columns = dict(columns)
    if least(columns) > width:
        shorts = short_names([cell.plain for cell in columns["joint"]], names)
        columns["joint"] = [text_of(shorts[cell.plain]) for cell in columns["joint"]]
    for title in DISPENSABLE:
        if least(columns) <= width:
            break
        del columns[title]
    room = FAULT_WIDTH + max(width - least(columns), 0)
    for cell in columns["fault"]:
        cell.truncate(room, overflow="ellipsis")
    return columns


def least(columns: dict[str, list[Text]]) -> int:
    """Minimum width of columns, characters; a long fault is cut before other columns."""
    fault = max(cell.cell_len for cell in columns["fault"])
    return needed(columns, ()) - max(fault - FAULT_WIDTH, 0)

# SPDX-License-Identifier: Apache-2.0
"""cbctl watch."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

from ..arguments import JOINTS, argument, number, takes
from ..output import bar, console, force_text, mode_text, position_text, put, show
from ..reading import UNCALIBRATED, Rows, lacks_calibration, read_state
from ..session import Session
from ..tables import drawn, needed, short_names, text_of
from ..words import UsageError

if TYPE_CHECKING:
    from rich.text import Text

    from ..limits import JointLimits


#: The limits in force of each joint, where the board tells them.
Limits = dict[str, "JointLimits | None"]

TITLES = (
    "joint",
    "mode",
    "int.",
    "position",
    "its limits",
    "reference",
    "torque",
    "output",
    "fault",
)
RIGHT = ("position", "reference", "torque", "output")
#: What goes first where the terminal is narrow.
DISPENSABLE = ("output", "reference", "its limits", "torque", "int.")
#: Characters that a fault has at least, where it has as many.
FAULT_WIDTH = 20


@takes(
    JOINTS,
    argument("--once", action="store_true", help="Show it once and end."),
    argument("--rate", type=number, default=10.0, metavar="RATE", help="Times a second."),
)
def watch(session: Session, joints: list[str], once: bool, rate: float) -> None:
    """Watch joints live; Ctrl-C ends it. Into a pipe or file: frame after frame, as they come.

    With --json a line per time.
    """
    if not 0.0 < rate <= 100.0:
        raise UsageError(f"--rate {rate:g} is not valid; give times a second, above 0 up to 100")
    names = session.joints(joints)
    if once:
        rows = read_state(session, names)
        show(
            session,
            rows,
            lambda: watch_table(session, rows, session.limits(names), console().width),
        )
        return
    try:
        follow(session, names, 1.0 / rate)
    except KeyboardInterrupt:
        return


def follow(session: Session, names: list[str], period: float) -> None:
    """Show the rows again and again: in place where somebody looks, else frame after frame."""
    screen = console()
    limits: Limits = {} if session.options.json else session.limits(names)
    if session.options.json or not screen.is_terminal:
        follow_in_lines(session, names, limits, period)
    from rich.live import Live

    first = watch_table(session, read_state(session, names), limits, screen.width)
    with Live(first, console=screen, auto_refresh=False) as live:
        while True:
            rows = read_state(session, names)
            live.update(watch_table(session, rows, limits, screen.width), refresh=True)
            time.sleep(period)


def follow_in_lines(session: Session, names: list[str], limits: Limits, period: float) -> NoReturn:
    """Print frames, each flushed at once and followed by an empty line; JSON: a line each."""
    while True:
        rows = read_state(session, names)
        show(session, rows, partial(watch_table, session, rows, limits, console().width))
        if not session.options.json:
            put("")
        time.sleep(period)


def watch_table(session: Session, rows: Rows, limits: Limits, width: int) -> Any:
    """The table, with what a terminal of this width has room for."""
    columns = fitted(columns_of(session, rows, limits), session.names, width)
    return drawn(columns, RIGHT)


def columns_of(session: Session, rows: Rows, limits: Limits) -> dict[str, list[Text]]:
    """All columns by title, in their order."""
    from rich.text import Text

    columns: dict[str, list[Text]] = {title: [] for title in TITLES}
    for name, row in rows.items():
        prismatic, known = session.slides(name), limits[name]
        scale = "" if known is None else bar(row["position"], known.lower, known.upper)
        trouble = row["fault"] or (UNCALIBRATED if lacks_calibration(row) else "")
        cells = (
            Text(name),
            mode_text(row["control_mode"]),
            mode_text(row["interaction_mode"]),
            Text(position_text(row["position"], prismatic)),
            Text(scale),
            Text(position_text(row["position_reference"], prismatic)),
            Text(force_text(row["torque"], prismatic)),
            Text(f"{row['output']:z.0f} %"),
            Text(trouble, style="red"),
        )
        for title, cell in zip(TITLES, cells, strict=True):
            columns[title].append(cell)
    return columns


def fitted(
    columns: dict[str, list[Text]], names: Sequence[str], width: int
) -> dict[str, list[Text]]:
    """Columns that fit: names without what all begin with, then without the least important."""
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
    """The characters that columns take; a long fault is cut rather than other columns."""
    fault = max(cell.cell_len for cell in columns["fault"])
    return needed(columns, ()) - max(fault - FAULT_WIDTH, 0)

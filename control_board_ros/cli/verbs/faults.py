# SPDX-License-Identifier: Apache-2.0
"""cbctl faults."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any

import typer

from ..output import show
from ..session import Session
from ..tables import grid
from .arguments import Joints

#: Before this a stamp is simulated time, not a date, s.
DATES_FROM = 1e9


def faults(
    context: typer.Context,
    joints: Joints = None,
    every: Annotated[
        bool, typer.Option("--all", help="Also the last faults, that are cleared.")
    ] = False,
) -> None:
    """Show the joints in fault, and why."""
    session: Session = context.obj
    records = read_faults(session, session.joints(joints))
    rows = {n: r for n, r in records.items() if r["active"] or (every and r["code"] >= 0)}
    cleared = sum(1 for r in records.values() if r["code"] >= 0 and not r["active"])
    show(session, rows, lambda: render(rows, list(records), cleared))


def read_faults(session: Session, names: list[str]) -> dict[str, dict[str, Any]]:
    """The last fault of each joint."""
    return {
        record.name: {
            "active": record.active,
            "code": record.code,
            "text": record.text,
            "stamp": record.stamp,
        }
        for record in session.client.get_faults(names)
    }


def render(rows: dict[str, dict[str, Any]], names: Sequence[str], cleared: int) -> Any:
    if not rows:
        count = len(names)
        past = f"; {cleared} had one that is cleared: cbctl faults --all" if cleared else ""
        return f"no fault on {count} joint{'s' if count != 1 else ''}{past}"
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
    """A time stamp for people."""
    if stamp < DATES_FROM:
        return f"{stamp:.3f} s"
    return f"{datetime.fromtimestamp(stamp):%H:%M:%S}"

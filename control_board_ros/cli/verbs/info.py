# SPDX-License-Identifier: Apache-2.0
"""cbctl info."""

from __future__ import annotations

from typing import Any

import typer

from ..limits import FIELDS
from ..output import position_text, short_names, show, table
from ..session import Session

#: A range that no joint has, rad or m: the stops of one without stops.
ENDLESS = 1e5


def info(context: typer.Context) -> None:
    """Show the board: joints with index, kind, limits, stops and the modes they have."""
    session: Session = context.obj
    value = read_info(session)
    show(session, value, lambda: render(value))


def read_info(session: Session) -> dict[str, Any]:
    """Name and joints of the board; limits are those in force, from its parameters."""
    client = session.client
    names = session.names
    limits = session.limits(names)
    rows = {}
    for k, (name, (control, interaction)) in enumerate(
        zip(names, client.get_available_modes(), strict=True)
    ):
        joint, known = session.robot.get(name), limits[name]
        row: dict[str, Any] = {"index": k, "kind": joint.kind if joint else None}
        row |= {field: None if known is None else getattr(known, field) for field in FIELDS}
        if known is None and joint is not None:  # the URDF knows the stops only
            row |= {"hard_lower": joint.lower, "hard_upper": joint.upper}
        rows[name] = row | {
            "control_modes": [mode.code for mode in control],
            "interaction_modes": [mode.code for mode in interaction],
        }
    return {"board": client.board_name, "joints": rows}


def render(value: dict[str, Any]) -> Any:
    columns = ("", "joint", "kind", "limits", "stops", "modes", "int.")
    shown = table(*columns, right=("", "limits", "stops"), fold=("modes",))
    shorts = short_names(list(value["joints"]))
    shown.title = value["board"]
    for name, row in value["joints"].items():
        prismatic = row["kind"] == "prismatic"
        shown.add_row(
            str(row["index"]),
            shorts[name],
            row["kind"] or "-",
            range_text(row["lower"], row["upper"], prismatic),
            range_text(row["hard_lower"], row["hard_upper"], prismatic),
            " ".join(row["control_modes"]),
            " ".join(row["interaction_modes"]),
        )
    return shown


def range_text(low: float | None, high: float | None, prismatic: bool) -> str:
    """``-168.0…168.0°``; a dash where it is not known, or endless."""
    if low is None or high is None or not high - low < ENDLESS:
        return "-"
    start = position_text(low, prismatic).rstrip("° m")
    return f"{start}…{position_text(high, prismatic)}"

# SPDX-License-Identifier: Apache-2.0
"""cbctl info."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import typer

from ..limits import FIELDS
from ..output import ENDLESS, position_text, show
from ..session import Session
from ..tables import grid


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


def render(value: dict[str, Any], width: int | None = None) -> Any:
    rows = value["joints"]
    slides = [row["kind"] == "prismatic" for row in rows.values()]
    columns = {
        "": [str(row["index"]) for row in rows.values()],
        "joint": list(rows),
        "kind": [row["kind"] or "-" for row in rows.values()],
        "limits": ranges(rows, "lower", "upper", slides),
        "stops": ranges(rows, "hard_lower", "hard_upper", slides),
        "modes": [" ".join(row["control_modes"]) for row in rows.values()],
        "int.": [" ".join(row["interaction_modes"]) for row in rows.values()],
    }
    return grid(
        columns,
        names=list(rows),
        keys=2,
        right=("", "limits", "stops"),
        fold=("modes",),
        title=value["board"],
        width=width,
    )


def ranges(
    rows: dict[str, dict[str, Any]], low: str, high: str, slides: Sequence[bool]
) -> list[str]:
    """The cells of a column of ranges."""
    return [
        range_text(row[low], row[high], prismatic)
        for row, prismatic in zip(rows.values(), slides, strict=True)
    ]


def range_text(low: float | None, high: float | None, prismatic: bool) -> str:
    """``-168.0…168.0°``; a dash where it is not known."""
    if low is None or high is None:
        return "-"
    if not high - low < ENDLESS:
        return "endless"
    start = position_text(low, prismatic).rstrip("° m")
    return f"{start}…{position_text(high, prismatic)}"

# SPDX-License-Identifier: Apache-2.0
"""cbctl info."""

from __future__ import annotations

from typing import Any

import typer

from ..output import position_text, short_names, show, table
from ..session import Session


def info(context: typer.Context) -> None:
    """Show the board: joints with index, kind, limits and the modes they have."""
    session: Session = context.obj
    value = read_info(session)
    show(session, value, lambda: render(value))


def read_info(session: Session) -> dict[str, Any]:
    """Name and joints of the board."""
    client = session.client
    names = session.names
    rows = {}
    for k, (name, (control, interaction)) in enumerate(
        zip(names, client.get_available_modes(), strict=True)
    ):
        joint = session.robot.get(name)
        rows[name] = {
            "index": k,
            "kind": joint.kind if joint else None,
            "lower": joint.lower if joint else None,
            "upper": joint.upper if joint else None,
            "control_modes": [mode.code for mode in control],
            "interaction_modes": [mode.code for mode in interaction],
        }
    return {"board": client.board_name, "joints": rows}


def render(value: dict[str, Any]) -> Any:
    right = ("", "from", "to")
    columns = ("", "joint", "kind", "from", "to", "modes", "int.")
    shown = table(*columns, right=right, fold=("modes",))
    shorts = short_names(list(value["joints"]))
    shown.title = value["board"]
    for name, row in value["joints"].items():
        prismatic = row["kind"] == "prismatic"
        limits = [
            "-" if row[end] is None else position_text(row[end], prismatic)
            for end in ("lower", "upper")
        ]
        shown.add_row(
            str(row["index"]),
            shorts[name],
            row["kind"] or "-",
            *limits,
            " ".join(row["control_modes"]),
            " ".join(row["interaction_modes"]),
        )
    return shown

# SPDX-License-Identifier: Apache-2.0
"""cbctl references."""

from __future__ import annotations

from typing import Any

import typer

from ..output import force_text, position_text, show
from ..session import Session, by_joint
from ..tables import grid
from .arguments import Joints

TITLES = ("position", "direct", "velocity", "torque", "output", "speed", "accel.")


def references(context: typer.Context, joints: Joints = None) -> None:
    """Show the last accepted reference of every kind."""
    session: Session = context.obj
    rows = read_references(session, session.joints(joints))
    show(session, rows, lambda: render(session, rows))


def read_references(session: Session, names: list[str]) -> dict[str, dict[str, float]]:
    """The references of each joint, in the board's units."""
    client = session.client
    read = {
        "position": client.get_target_position,
        "direct_position": client.get_ref_position,
        "velocity": client.get_ref_velocity,
        "torque": client.get_ref_torque,
        "output": client.get_output,
        "speed": client.get_ref_speed,
        "acceleration": client.get_ref_acceleration,
    }
    columns = {kind: by_joint(names, get(names)) for kind, get in read.items()}
    return {name: {kind: column[name] for kind, column in columns.items()} for name in names}


def render(session: Session, rows: dict[str, dict[str, float]]) -> Any:
    columns: dict[str, list[str]] = {"joint": list(rows)} | {title: [] for title in TITLES}
    for name, row in rows.items():
        prismatic = session.slides(name)
        cells = (
            position_text(row["position"], prismatic),
            position_text(row["direct_position"], prismatic),
            position_text(row["velocity"], prismatic) + "/s",
            force_text(row["torque"], prismatic, 2),
            f"{row['output']:.1f} %",
            position_text(row["speed"], prismatic) + "/s",
            position_text(row["acceleration"], prismatic) + "/s²",
        )
        for title, cell in zip(TITLES, cells, strict=True):
            columns[title].append(cell)
    return grid(columns, names=session.names, right=TITLES)

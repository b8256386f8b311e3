# SPDX-License-Identifier: Apache-2.0
"""cbctl modes."""

from __future__ import annotations

from typing import Any

import typer

from ..output import mode_text, show, table
from ..session import Session
from .arguments import Joints


def modes(context: typer.Context, joints: Joints = None) -> None:
    """Show the control and interaction mode of joints."""
    session: Session = context.obj
    rows = read_modes(session, session.joints(joints))

    def render() -> Any:
        shown = table("joint", "control mode", "interaction mode")
        for name, row in rows.items():
            control, interaction = row["control_mode"], row["interaction_mode"]
            shown.add_row(
                name,
                mode_text(control, f"{control:5}{row['control_mode_name']}"),
                mode_text(interaction, f"{interaction:5}{row['interaction_mode_name']}"),
            )
        return shown

    show(session, rows, render)


def read_modes(session: Session, names: list[str]) -> dict[str, dict[str, str]]:
    """Both modes of each joint, as codes and names."""
    client = session.client
    return {
        name: {
            "control_mode": control.code,
            "control_mode_name": control.name,
            "interaction_mode": interaction.code,
            "interaction_mode_name": interaction.name,
        }
        for name, control, interaction in zip(
            names,
            client.get_control_mode(names),
            client.get_interaction_mode(names),
            strict=True,
        )
    }

# SPDX-License-Identifier: Apache-2.0
"""cbctl modes."""

from __future__ import annotations

from typing import Any

import typer

from ..output import mode_text, show
from ..session import Session
from ..tables import grid
from .arguments import Joints

UNCALIBRATED = "not calibrated"

#: Modes of joints whose calibration is still to come, or under way.
BEFORE_CALIBRATION = ("cal", "cfgn")


def modes(context: typer.Context, joints: Joints = None) -> None:
    """Show the control and interaction mode of joints, and which are not calibrated."""
    session: Session = context.obj
    rows = read_modes(session, session.joints(joints))

    def render() -> Any:
        columns: dict[str, list[Any]] = {
            "joint": list(rows),
            "control mode": [],
            "interaction mode": [],
        }
        for row in rows.values():
            control, interaction = row["control_mode"], row["interaction_mode"]
            note = f" ({UNCALIBRATED})" if lacks_calibration(row) else ""
            text = f"{control:5}{row['control_mode_name']}{note}"
            columns["control mode"].append(mode_text(control, text))
            text = f"{interaction:5}{row['interaction_mode_name']}"
            columns["interaction mode"].append(mode_text(interaction, text))
        return grid(columns, names=session.names)

    show(session, rows, render)


def lacks_calibration(row: dict[str, Any]) -> bool:
    """Whether a joint needs a calibration before it takes a mode, and none is under way (K7)."""
    return row["calibrated"] is False and row["control_mode"] not in BEFORE_CALIBRATION


def read_modes(session: Session, names: list[str]) -> dict[str, dict[str, Any]]:
    """Both modes of each joint, as codes and names, and whether it is calibrated."""
    client = session.client
    calibrated = read_calibrated(session)
    return {
        name: {
            "control_mode": control.code,
            "control_mode_name": control.name,
            "interaction_mode": interaction.code,
            "interaction_mode_name": interaction.name,
            "calibrated": calibrated.get(name),
        }
        for name, control, interaction in zip(
            names,
            client.get_control_mode(names),
            client.get_interaction_mode(names),
            strict=True,
        )
    }


def read_calibrated(session: Session) -> dict[str, bool]:
    """Whether each joint knows its angle; empty where the board does not say so."""
    from control_board_ros.client import BoardTimeout

    try:
        state = session.client.get_state()
    except BoardTimeout:  # its states do not come through: the modes are worth showing still
        return {}
    return dict(zip(state.names, state.calibrated.tolist(), strict=False))

# SPDX-License-Identifier: Apache-2.0
"""cbctl impedance."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from ..output import conclude, show
from ..session import Session, by_joint
from ..tables import grid
from .arguments import Joints


def impedance(
    context: typer.Context,
    joints: Joints = None,
    stiffness: Annotated[
        float | None, typer.Option("--stiffness", "-k", help="N·m/rad (N/m).")
    ] = None,
    damping: Annotated[
        float | None, typer.Option("--damping", "-d", help="N·m·s/rad (N·s/m).")
    ] = None,
) -> int:
    """Show the stiffness and damping of joints, or set them; without -d it fits -k."""
    session: Session = context.obj
    names = session.joints(joints)
    if stiffness is None and damping is None:
        rows = read_impedance(session, names)
        show(session, rows, lambda: render(session, rows))
        return 0
    reply = session.client.set_impedance(names, stiffness, damping)
    return conclude(session, reply, f"impedance set: {', '.join(names)}")


def read_impedance(session: Session, names: list[str]) -> dict[str, dict[str, float]]:
    """Stiffness, damping, their maxima and the torque offset of each joint."""
    client = session.client
    stiffness, damping = (by_joint(names, v) for v in client.get_impedance(names))
    max_stiffness, max_damping = (by_joint(names, v) for v in client.get_max_impedance(names))
    offset = by_joint(names, client.get_torque_offset(names))
    return {
        name: {
            "stiffness": stiffness[name],
            "damping": damping[name],
            "max_stiffness": max_stiffness[name],
            "max_damping": max_damping[name],
            "torque_offset": offset[name],
        }
        for name in names
    }


def render(session: Session, rows: dict[str, dict[str, float]]) -> Any:
    fields = {
        "stiffness": "stiffness",
        "max": "max_stiffness",
        "damping": "damping",
        "max ": "max_damping",
        "torque offset": "torque_offset",
    }
    columns = {
        title: [f"{row[field]:.4g}" for row in rows.values()] for title, field in fields.items()
    }
    return grid(
        {"joint": list(rows), **columns},
        names=session.names,
        right=list(fields),
        caption="N·m/rad, N·m·s/rad, N·m; sliding joints: N/m, N·s/m, N",
    )

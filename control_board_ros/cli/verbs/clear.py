# SPDX-License-Identifier: Apache-2.0
"""cbctl clear."""

from __future__ import annotations

from typing import Any

import typer

from ..output import DONE, REFUSED, show
from ..power import tell_of_falling
from ..session import Session
from ..tables import grid
from .arguments import Joints
from .faults import read_faults


def clear(context: typer.Context, joints: Joints = None) -> int:
    """Send FORCE_IDLE to the joints in fault; tell which causes persist."""
    session: Session = context.obj
    names = session.joints(joints)
    rows = clear_faults(session, names)
    nothing = f"nothing to clear: none of {len(names)} is in fault"
    stuck = any(not row["cleared"] for row in rows.values())
    show(
        session,
        {"success": not stuck, "joints": rows},
        lambda: render(session, rows) if rows else nothing,
    )
    tell_of_falling(session, [name for name, row in rows.items() if row["cleared"]])
    return REFUSED if stuck else DONE


def clear_faults(session: Session, names: list[str]) -> dict[str, dict[str, Any]]:
    """What the fault of each joint in fault was, and whether it is cleared now."""
    before = {n: r for n, r in read_faults(session, names).items() if r["active"]}
    rows = {}
    for name, record in before.items():
        reply = session.client.set_control_mode(name, "fidl")
        rows[name] = {
            "code": record["code"],
            "fault": record["text"],
            "cleared": bool(reply),
            "message": reply.message,
        }
    return rows


def render(session: Session, rows: dict[str, dict[str, Any]]) -> Any:
    from rich.text import Text

    states = {True: Text("idle, cleared", "green"), False: Text("the cause persists", "bold red")}
    columns = {
        "joint": list(rows),
        "fault": [row["fault"] for row in rows.values()],
        "now": [states[row["cleared"]] for row in rows.values()],
    }
    return grid(columns, names=session.names, fold=("fault",))

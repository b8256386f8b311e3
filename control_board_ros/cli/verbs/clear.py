# SPDX-License-Identifier: Apache-2.0
"""cbctl clear."""

from __future__ import annotations

from typing import Any

import typer

from ..output import DONE, REFUSED, short_names, show, table
from ..power import tell_of_falling
from ..session import Session
from .arguments import Joints
from .faults import read_faults


def clear(context: typer.Context, joints: Joints = None) -> int:
    """Send FORCE_IDLE to the joints in fault; tell which causes persist."""
    session: Session = context.obj
    names = session.joints(joints)
    rows = clear_faults(session, names)
    stuck = any(not row["cleared"] for row in rows.values())
    show(
        session,
        {"success": not stuck, "joints": rows},
        lambda: render(rows) if rows else f"nothing to clear: none of {len(names)} is in fault",
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


def render(rows: dict[str, dict[str, Any]]) -> Any:
    shown = table("joint", "fault", "now", fold=("fault",))
    shorts = short_names(list(rows))
    for name, row in rows.items():
        now = "[green]idle, cleared[/]" if row["cleared"] else "[bold red]the cause persists[/]"
        shown.add_row(shorts[name], row["fault"], now)
    return shown

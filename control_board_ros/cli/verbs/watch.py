# SPDX-License-Identifier: Apache-2.0
"""cbctl watch."""

from __future__ import annotations

import time
from typing import Annotated, Any

import typer

from ..output import bar, console, mode_text, position_text, show, table
from ..session import Session
from ..words import UsageError
from .arguments import Joints
from .faults import read_faults
from .modes import read_modes


def watch(
    context: typer.Context,
    joints: Joints = None,
    once: Annotated[bool, typer.Option("--once", help="Show it once and end.")] = False,
    rate: Annotated[float, typer.Option(help="Times a second.")] = 10.0,
) -> None:
    """Watch joints live; Ctrl-C ends it. With --json a line per time."""
    session: Session = context.obj
    if not 0.0 < rate <= 100.0:
        raise UsageError(f"--rate {rate:g} is not valid; give times a second, above 0 up to 100")
    names = session.joints(joints)
    rows = read_rows(session, names)
    if once:
        show(session, rows, lambda: render(session, rows))
        return
    try:
        follow(session, names, 1.0 / rate)
    except KeyboardInterrupt:
        return


def follow(session: Session, names: list[str], period: float) -> None:
    """Show the rows again and again."""
    if session.options.json:
        while True:
            show(session, read_rows(session, names), str)
            time.sleep(period)
    from rich.live import Live

    rows = read_rows(session, names)
    with Live(render(session, rows), console=console(), auto_refresh=False) as live:
        while True:
            live.update(render(session, read_rows(session, names)), refresh=True)
            time.sleep(period)


def read_rows(session: Session, names: list[str]) -> dict[str, dict[str, Any]]:
    """All that is to be seen of each joint."""
    state = session.client.get_state()
    modes = read_modes(session, names)
    faults = read_faults(session, names)
    rows = {}
    for name in names:
        j = state.names.index(name)
        rows[name] = modes[name] | {
            "position": float(state.position[j]),
            "velocity": float(state.velocity[j]),
            "position_reference": float(state.position_reference[j]),
            "torque": float(state.torque[j]),
            "output": float(state.output[j]),
            "current": float(state.current[j]),
            "motion_done": bool(state.motion_done[j]),
            "rejected_commands": int(state.rejected_commands[j]),
            "fault": faults[name]["text"] if faults[name]["active"] else "",
        }
    return rows


def render(session: Session, rows: dict[str, dict[str, Any]]) -> Any:
    right = ("position", "reference", "torque", "output")
    shown = table(
        "joint",
        "mode",
        "int.",
        "position",
        "its limits",
        "reference",
        "torque",
        "output",
        "fault",
        right=right,
    )
    for name, row in rows.items():
        joint = session.robot.get(name)
        prismatic = joint is not None and joint.prismatic
        limits = (joint.lower, joint.upper) if joint is not None else (0.0, 0.0)
        shown.add_row(
            name,
            mode_text(row["control_mode"]),
            mode_text(row["interaction_mode"]),
            position_text(row["position"], prismatic),
            bar(row["position"], *limits),
            position_text(row["position_reference"], prismatic),
            f"{row['torque']:.1f}{'N' if prismatic else 'N·m'}",
            f"{row['output']:.0f}%",
            f"[red]{row['fault']}[/]" if row["fault"] else "",
        )
    return shown

# SPDX-License-Identifier: Apache-2.0
"""Arguments that several verbs share, with what completes them."""

from __future__ import annotations

from typing import Annotated

import typer

from control_board_ros.core.vocabs import ControlMode, InteractionMode

from ..options import Options
from ..session import Session

COMPLETION_TIMEOUT = 2.0  # s; a Tab must not hang


def joint_names(context: typer.Context, incomplete: str) -> list[str]:
    """Names for Tab, from the board itself; none when there is no board."""
    from control_board_ros.client import BoardError

    given = context.parent.params if context.parent is not None else {}
    options = Options(
        board=given.get("board") or "control_board",
        namespace=given.get("namespace") or "",
        timeout=COMPLETION_TIMEOUT,
        domain=given.get("domain"),
    )
    try:
        with Session(options) as session:
            names = session.names
    except BoardError:
        return []
    return [name for name in names if name.startswith(incomplete)]


def joint_or_mode(context: typer.Context, incomplete: str) -> list[str]:
    """Joints, and the modes that may be asked for."""
    codes = [mode.code for mode in (*ControlMode, *InteractionMode)]
    codes = [code for code in codes if code.startswith(incomplete)]
    return codes + joint_names(context, incomplete)


def joint_value(context: typer.Context, incomplete: str) -> list[str]:
    """``JOINT=``."""
    return [f"{name}=" for name in joint_names(context, incomplete)]


Joints = Annotated[
    list[str] | None,
    typer.Argument(metavar="[JOINT]…", help="Joints; none: all.", autocompletion=joint_names),
]
JointsThenMode = Annotated[
    list[str],
    typer.Argument(
        metavar="JOINT… MODE", help="Joints, then a mode.", autocompletion=joint_or_mode
    ),
]
Values = Annotated[
    list[str],
    typer.Argument(
        metavar="JOINT=VALUE…", help="A value for each joint.", autocompletion=joint_value
    ),
]
For = Annotated[
    str | None,
    typer.Option("--for", metavar="TIME", help="How long, e.g. 2s; then it stops."),
]
Speed = Annotated[
    str | None, typer.Option(metavar="SPEED", help="Mean speed, e.g. 20deg; else as set.")
]

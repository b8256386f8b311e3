# SPDX-License-Identifier: Apache-2.0
"""Arguments that several verbs share, with what completes them."""

from __future__ import annotations

from typing import Annotated

import typer

from ..offers import offers
from ..options import Options
from ..session import Session

COMPLETION_TIMEOUT = 2.0  # s; a Tab must not hang


def next_words(context: typer.Context, incomplete: str) -> list[str]:
    """Words for Tab, with the joints of the board itself; none when there is no board."""
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
    typed = context.params.get("words") or context.params.get("joints") or []
    return offers(context.info_name or "", typed, incomplete, names)


Joints = Annotated[
    list[str] | None,
    typer.Argument(metavar="JOINT", help="Joints; none: all.", autocompletion=next_words),
]
JointsThenMode = Annotated[
    list[str],
    typer.Argument(metavar="JOINT… MODE", help="Joints, then a mode.", autocompletion=next_words),
]
Values = Annotated[
    list[str],
    typer.Argument(
        metavar="JOINT=VALUE", help="A value for each joint.", autocompletion=next_words
    ),
]
For = Annotated[
    str | None,
    typer.Option("--for", metavar="TIME", help="How long, e.g. 2s; then it stops."),
]
Speed = Annotated[
    str | None, typer.Option(metavar="SPEED", help="Mean speed, e.g. 20deg; else as set.")
]

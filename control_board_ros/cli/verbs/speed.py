# SPDX-License-Identifier: Apache-2.0
"""cbctl speed."""

from __future__ import annotations

from typing import Annotated

import typer

from ..output import conclude
from ..session import Session
from ..words import assignments
from .arguments import Values


def speed(
    context: typer.Context,
    words: Values,
    acceleration: Annotated[
        bool, typer.Option("--acceleration", help="Set accelerations in place of speeds.")
    ] = False,
) -> int:
    """Set the reference speeds of later moves."""
    session: Session = context.obj
    kind = "acceleration" if acceleration else "speed"
    values = session.values(assignments(words, kind))
    names, numbers = list(values), list(values.values())
    if acceleration:
        reply = session.client.set_ref_acceleration(names, numbers)
    else:
        reply = session.client.set_ref_speed(names, numbers)
    return conclude(session, reply, f"reference {kind} set: {', '.join(names)}")

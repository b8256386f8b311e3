# SPDX-License-Identifier: Apache-2.0
"""cbctl velocity."""

from __future__ import annotations

from typing import Annotated

import typer

from ..output import conclude, note
from ..session import Session
from ..words import UsageError, assignments
from .arguments import For, Values
from .streaming import duration, stream


def velocity(
    context: typer.Context,
    words: Values,
    time: For = None,
    once: Annotated[
        bool, typer.Option("--once", help="Send it once; it expires (0.2 s) unless repeated.")
    ] = False,
) -> int:
    """Stream velocities (mode vel or mix) for a time, or until Ctrl-C; then stop."""
    session: Session = context.obj
    seconds = duration(time)
    if once and seconds is not None:
        raise UsageError("--once and --for exclude each other")
    values = session.values(assignments(words, "speed"))
    names = list(values)
    if once:
        reply = session.client.velocity_move(names, list(values.values()))
        return conclude(session, reply, f"sent: {', '.join(names)}")
    if seconds is None:
        note(session, "streaming until Ctrl-C")
    return stream(session, session.client.velocity_move, values, seconds)

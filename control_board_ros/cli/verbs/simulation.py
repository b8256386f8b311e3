# SPDX-License-Identifier: Apache-2.0
"""cbctl pause, resume, step and reset: a simulated board only."""

from __future__ import annotations

from typing import Annotated

import typer

from ..output import conclude
from ..session import Session
from ..words import UsageError


def pause(context: typer.Context) -> int:
    """Pause the simulation."""
    session: Session = context.obj
    return conclude(session, session.client.pause(True), "paused; go on with: cbctl resume")


def resume(context: typer.Context) -> int:
    """Let a paused simulation go on."""
    session: Session = context.obj
    return conclude(session, session.client.pause(False), "running")


def step(
    context: typer.Context,
    steps: Annotated[int, typer.Argument(help="Control cycles.")] = 1,
) -> int:
    """Advance a paused simulation by control cycles."""
    session: Session = context.obj
    if not 0 < steps < 2**32:
        raise UsageError(f"steps {steps} is not valid; give 1 to {2**32 - 1}")
    return conclude(session, session.client.step(steps), f"advanced by {steps}")


def reset(context: typer.Context) -> int:
    """Go back to the initial pose and power-on."""
    session: Session = context.obj
    return conclude(session, session.client.reset(), "reset")

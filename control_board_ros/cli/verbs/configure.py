# SPDX-License-Identifier: Apache-2.0
"""cbctl configure, cbctl power-cycle."""

from __future__ import annotations

import typer

from ..output import conclude
from ..session import Session


def configure(context: typer.Context) -> int:
    """Leave NOT_CONFIGURED, on a board that does not do so by itself."""
    session: Session = context.obj
    return conclude(session, session.client.configure(), "configured")


def power_cycle(context: typer.Context) -> int:
    """Go back to power-on."""
    session: Session = context.obj
    return conclude(session, session.client.power_cycle(), "power cycled")

# SPDX-License-Identifier: Apache-2.0
"""cbctl direct."""

from __future__ import annotations

import typer

from ..output import conclude
from ..session import Session
from ..words import assignments
from .arguments import Values


def direct(context: typer.Context, words: Values) -> int:
    """Step the position references at once (mode posd)."""
    session: Session = context.obj
    values = session.targets(assignments(words, "position"))
    reply = session.client.set_position(list(values), list(values.values()))
    told = ", ".join(f"{name} to {session.show_angle(name, v)}" for name, v in values.items())
    return conclude(session, reply, told)

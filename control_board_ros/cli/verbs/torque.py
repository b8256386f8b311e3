# SPDX-License-Identifier: Apache-2.0
"""cbctl torque."""

from __future__ import annotations

import typer

from ..output import conclude
from ..session import Session
from ..words import assignments
from .arguments import For, Values
from .streaming import duration, stream


def torque(context: typer.Context, words: Values, time: For = None) -> int:
    """Set torques (mode torq); with --for stream them, then set zero."""
    session: Session = context.obj
    seconds = duration(time)
    values = session.values(assignments(words, "torque"))
    if seconds is not None:
        return stream(session, session.client.set_ref_torque, values, seconds)
    reply = session.client.set_ref_torque(list(values), list(values.values()))
    told = ", ".join(f"{name} {value:g}" for name, value in values.items())
    return conclude(session, reply, f"torque references: {told}; they stay until changed")

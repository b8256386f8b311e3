# SPDX-License-Identifier: Apache-2.0
"""cbctl inject: a simulated board only."""

from __future__ import annotations

from typing import Annotated

import typer

from ..offers import FAULTS
from ..output import conclude
from ..session import Session
from ..words import UsageError
from .arguments import next_words


def inject(
    context: typer.Context,
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="JOINT… FAULT",
            help=f"Joints, then one of {', '.join(FAULTS)}.",
            autocompletion=next_words,
        ),
    ] = None,
    persistent: Annotated[
        bool, typer.Option("--persistent", help="The cause stays until --clear.")
    ] = False,
    clear: Annotated[bool, typer.Option("--clear", help="Remove all injected causes.")] = False,
) -> int:
    """Break something in simulated joints, so that the board finds it."""
    session: Session = context.obj
    if clear and not words:
        reply = session.client.clear_injected_faults()
        return conclude(session, reply, "injected causes removed; clear the faults: cbctl clear")
    if clear or words is None or len(words) < 2:
        raise UsageError("name joints, then a fault, e.g. cbctl inject 0 encoder; or --clear")
    *joints, fault = words
    names = session.joints(joints)
    reply = session.client.inject_fault(names, fault, persistent)
    return conclude(session, reply, f"{fault} injected: {', '.join(names)}")

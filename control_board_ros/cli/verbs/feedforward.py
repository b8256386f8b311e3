# SPDX-License-Identifier: Apache-2.0
"""cbctl feedforward."""

from __future__ import annotations

from typing import Annotated

import typer

from ..output import conclude
from ..session import Session
from ..words import UsageError, quantity
from .arguments import Joints


def feedforward(
    context: typer.Context,
    joints: Joints = None,
    output: Annotated[
        str | None, typer.Option(metavar="PERCENT", help="On the output, e.g. 5%.")
    ] = None,
    torque: Annotated[
        str | None, typer.Option(metavar="TORQUE", help="On the impedance torque, e.g. 2Nm.")
    ] = None,
) -> int:
    """Set the feed-forward terms of joints."""
    session: Session = context.obj
    if output is None and torque is None:
        raise UsageError("give --output, --torque or both")
    outputs = None if output is None else quantity(output, "output").value
    torques = None if torque is None else quantity(torque, "torque").value
    names = session.joints(joints)
    reply = session.client.set_feedforward(names, outputs, torques)
    return conclude(session, reply, f"feed-forward set: {', '.join(names)}")

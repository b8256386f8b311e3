# SPDX-License-Identifier: Apache-2.0
"""cbctl stop."""

from __future__ import annotations

import typer

from ..output import conclude
from ..session import Session
from .arguments import Joints


def stop(context: typer.Context, joints: Joints = None) -> int:
    """Stop joints where they are; their modes stay."""
    session: Session = context.obj
    reply = session.client.stop(session.joints(joints))
    return conclude(session, reply, f"stopped: {', '.join(reply.joints)}")

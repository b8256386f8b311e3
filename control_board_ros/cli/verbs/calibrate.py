# SPDX-License-Identifier: Apache-2.0
"""cbctl calibrate."""

from __future__ import annotations

from typing import Any

import typer

from ..output import conclude
from ..session import Session
from .arguments import Joints
from .move import cancelled
from .progress import Bar


def calibrate(context: typer.Context, joints: Joints = None) -> int:
    """Calibrate joints and wait for the end. Ctrl-C aborts it: idle, uncalibrated."""
    session: Session = context.obj
    names = session.joints(joints)
    try:
        with Bar(session, "calibrating") as bar:

            def feedback(sent: Any) -> None:
                bar.update(float(sent.progress.mean()), sent.phase)

            reply = session.client.calibrate(names, wait=True, feedback=feedback)
            if reply:
                bar.update(1.0, "done")
    except KeyboardInterrupt:
        return cancelled(session, "calibration", names)
    return conclude(session, reply, f"calibrated: {', '.join(names)}")

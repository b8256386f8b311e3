# SPDX-License-Identifier: Apache-2.0
"""cbctl calibrate, configure and power-cycle."""

from __future__ import annotations

from typing import Any

from ..board.progress import Bar
from ..board.session import Session
from ..board.status import cancelled
from ..line.arguments import JOINTS, with_arguments
from ..text.output import conclude


@with_arguments(JOINTS)
def calibrate(session: Session, joints: list[str]) -> int:
    """Calibrate joints and wait for the end. Ctrl-C aborts it: idle, uncalibrated."""
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


def configure(session: Session) -> int:
    """Leave NOT_CONFIGURED, on a board without autoconfigure."""
    return conclude(session, session.client.configure(), "configured")


def power_cycle(session: Session) -> int:
    """Return to power-on."""
    return conclude(session, session.client.power_cycle(), "power cycled")

# SPDX-License-Identifier: Apache-2.0
"""Joints that follow trajectories: the move to the start, and their modes at the end."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Sequence

from control_board_ros.core.terms.reply import Reply
from control_board_ros.core.terms.vocabs import ControlMode

from ..line.words import UsageError
from ..text.output import note
from .session import Session

#: Modes of joints after an early end.
MOVING = (ControlMode.POSITION, ControlMode.POSITION_DIRECT)
#: Mean speed of the move to the start, as a share of the speed limit.
APPROACH = 0.1


@contextlib.contextmanager
def followed(session: Session, names: list[str]) -> Iterator[None]:
    """Stop the joints at the end, and restore their control modes."""
    client = session.client
    before = client.get_control_mode(names)
    try:
        yield
    finally:
        changes = zip(names, before, client.get_control_mode(names), strict=True)
        back = {
            name: mode
            for name, mode, now in changes
            if now in MOVING and mode not in (now, ControlMode.IDLE)
        }
        if back:
            client.stop(list(back))
            client.set_control_mode(list(back), list(back.values()))


def approach(
    session: Session, names: list[str], starts: dict[str, float], speeds: Sequence[float]
) -> Reply:
    """Move to the start of a trajectory, in POSITION and STIFF; then POSITION_DIRECT."""
    client = session.client
    reply = client.set_control_mode(names, ControlMode.POSITION)
    if reply:
        reply = client.move(names, list(starts.values()), [APPROACH * speed for speed in speeds])
    return client.set_control_mode(names, ControlMode.POSITION_DIRECT) if reply else reply


def check_asking(yes: bool) -> None:
    """Raise UsageError without a terminal for the confirmation of a motion."""
    if not yes and not sys.stdin.isatty():
        raise UsageError("no terminal for the confirmation to move; give --yes")


def agreed(session: Session, motion: str, yes: bool) -> bool:
    """Report a motion, and ask for confirmation on the terminal, unless ``yes``."""
    note(session, motion)
    if yes:
        return True
    print("Go on? [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")

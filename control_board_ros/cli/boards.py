# SPDX-License-Identifier: Apache-2.0
"""Which boards a pattern means, for verbs that make sense on several."""

from __future__ import annotations

import time
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from .words import Refused

if TYPE_CHECKING:
    from .session import Session

#: s that boards have to show up after the first one did.
GATHERING = 1.0
POLL = 0.05


def boards_meant(session: Session) -> list[str]:
    """Absolute names of the boards that ``--board`` names, which may be a pattern: ``/icub/*``.

    Raises:
        Refused: no board fits the pattern.
    """
    asked = session.options.board
    if not any(mark in asked for mark in "*?["):
        return [asked]
    node = session.node
    pattern = node.resolve_topic_name("x").rpartition("/")[0] + "/" + asked
    pattern = asked if asked.startswith("/") else pattern
    deadline = time.monotonic() + session.options.timeout
    found: list[str] = []
    while time.monotonic() < deadline:
        now = [name for name in boards_there(session) if fnmatchcase(name, pattern)]
        if now and now == found:
            return found
        found = now
        time.sleep(GATHERING if found else POLL)
    there = ", ".join(boards_there(session)) or "none"
    raise Refused(f"no board fits {pattern}; boards there are: {there}")


def boards_there(session: Session) -> list[str]:
    """Absolute names of all boards that are seen, from their ~/modes topics."""
    from control_board_ros.interface import MODES

    below = MODES.of("")
    return sorted(
        name.removesuffix(below)
        for name, types in session.node.get_topic_names_and_types()
        if MODES.type in types and name.endswith(below)
    )

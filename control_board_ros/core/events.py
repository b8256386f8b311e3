# SPDX-License-Identifier: Apache-2.0
"""What happens on a board and belongs in a log."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

#: Events that nobody takes are dropped from here on, oldest first.
EVENTS_KEPT = 1000


@dataclass(frozen=True, slots=True)
class BoardEvent:
    """Something that happened in a cycle and belongs in a log.

    Attributes: level (``info``, ``warning`` or ``error``), key (what repeats of it share),
    joint (name), text (one line).
    """

    level: str
    key: str
    joint: str
    text: str


class Events:
    """The events of a board, until somebody takes them."""

    def __init__(self) -> None:
        self._waiting: deque[BoardEvent] = deque(maxlen=EVENTS_KEPT)

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, level: str, key: str, joint: str, text: str) -> None:
        """Add an event."""
        self._waiting.append(BoardEvent(level, key, joint, text))

    def take(self) -> list[BoardEvent]:
        """The events since the last call, oldest first."""
        taken = list(self._waiting)
        self._waiting.clear()
        return taken

# SPDX-License-Identifier: Apache-2.0
"""Events of a board, for its log."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

#: Maximum number of unread events; the oldest are dropped.
EVENTS_KEPT = 1000


@dataclass(frozen=True, slots=True)
class BoardEvent:
    """An event of a control cycle, for the log.

    Attributes: level (``info``, ``warning`` or ``error``), key (shared by its repetitions),
    joint (name), text (one line).
    """

    level: str
    key: str
    joint: str
    text: str


class Events:
    """The unread events of a board.

    Args:
        owners: names of parts by joint; events of others are the whole board's, whose name is
            empty.
    """

    def __init__(self, owners: Mapping[str, str] = MappingProxyType({})) -> None:
        self._owners = owners
        parts = {"", *owners.values()}
        self._waiting = {part: deque[BoardEvent](maxlen=EVENTS_KEPT) for part in parts}

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values()))

    def add(self, level: str, key: str, joint: str, text: str) -> None:
        """Add an event."""
        waiting = self._waiting[self._owners.get(joint, "")]
        waiting.append(BoardEvent(level, key, joint, text))

    def take(self, part: str = "") -> list[BoardEvent]:
        """The events of a part, or of the board, since the last call, oldest first."""
        waiting = self._waiting[part]
        events = list(waiting)
        waiting.clear()
        return events

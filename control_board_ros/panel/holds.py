# SPDX-License-Identifier: Apache-2.0
"""References active while a control is held (dead man's switch). Pure; time is an argument.

A browser confirms a held control periodically. On release, timeout or disconnection the joint
returns to rest: no velocity, no output, or the holding torque.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

#: s without confirmation after which a control counts as released.
PATIENCE = 0.3


@dataclass(slots=True)
class Hold:
    """A held control.

    Attributes: browser, board, joint, kind (of the reference), value, rest (reference after
    release), until (s).
    """

    browser: int
    board: str
    joint: str
    kind: str
    value: float
    rest: float
    until: float


class Holds:
    """All held controls."""

    def __init__(self) -> None:
        self._held: dict[tuple[str, str], Hold] = {}

    def __len__(self) -> int:
        return len(self._held)

    def __iter__(self) -> Iterator[Hold]:
        return iter(list(self._held.values()))

    def get(self, board: str, joint: str) -> Hold | None:
        return self._held.get((board, joint))

    def hold(self, hold: Hold, now: float) -> None:
        """Add or confirm a held control; a later one of the same joint replaces it."""
        hold.until = now + PATIENCE
        self._held[hold.board, hold.joint] = hold

    def release(self, board: str, joint: str) -> Hold | None:
        """Remove a released control and return it; None if not held."""
        return self._held.pop((board, joint), None)

    def expired(self, now: float) -> list[Hold]:
        """Remove and return expired controls."""
        return self._drop([hold for hold in self if now >= hold.until])

    def of_browser(self, browser: int) -> list[Hold]:
        """Remove and return the controls of a browser that left or no longer operates."""
        return self._drop([hold for hold in self if hold.browser == browser])

    def everything(self) -> list[Hold]:
        """Remove and return all controls."""
        return self._drop(list(self))

    def _drop(self, holds: list[Hold]) -> list[Hold]:
        for hold in holds:
            del self._held[hold.board, hold.joint]
        return holds

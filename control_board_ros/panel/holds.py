# SPDX-License-Identifier: Apache-2.0
"""References that act while somebody holds a control: dead man. Pure; time is given.

A browser says again and again that the control is still held. When it says so no more, lets go
or is gone, the joint gets what it had before: no velocity, no output, or the torque that held it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

#: s after which a control that was not confirmed counts as let go.
PATIENCE = 0.3


@dataclass(slots=True)
class Hold:
    """One control that is held.

    Attributes: browser, board, joint, kind (of the reference), value, rest (what it gets in the
    end), until (s).
    """

    browser: int
    board: str
    joint: str
    kind: str
    value: float
    rest: float
    until: float


class Holds:
    """All controls that are held now."""

    def __init__(self) -> None:
        self._held: dict[tuple[str, str], Hold] = {}

    def __len__(self) -> int:
        return len(self._held)

    def __iter__(self) -> Iterator[Hold]:
        return iter(list(self._held.values()))

    def get(self, board: str, joint: str) -> Hold | None:
        """What is held of a joint."""
        return self._held.get((board, joint))

    def hold(self, hold: Hold, now: float) -> None:
        """A control is held, or still held; a later one of the same joint takes its place."""
        hold.until = now + PATIENCE
        self._held[hold.board, hold.joint] = hold

    def release(self, board: str, joint: str) -> Hold | None:
        """A control was let go; what it was, or None where it was not held."""
        return self._held.pop((board, joint), None)

    def expired(self, now: float) -> list[Hold]:
        """Those that nobody confirmed in time; they are held no more."""
        return self._drop([hold for hold in self if now >= hold.until])

    def of_browser(self, browser: int) -> list[Hold]:
        """Those of a browser that is gone or operates no more; they are held no more."""
        return self._drop([hold for hold in self if hold.browser == browser])

    def everything(self) -> list[Hold]:
        """All of them; they are held no more."""
        return self._drop(list(self))

    def _drop(self, holds: list[Hold]) -> list[Hold]:
        for hold in holds:
            del self._held[hold.board, hold.joint]
        return holds

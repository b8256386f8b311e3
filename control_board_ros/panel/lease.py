# SPDX-License-Identifier: Apache-2.0
"""Who operates: one browser at a time holds the lease, the others watch. Pure; time is given."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: s that the operator has to answer who wants to take over; then silence means yes.
ANSWER_TIME = 10.0


@dataclass(slots=True)
class Lease:
    """The operator, and who asks to take over.

    Attributes: holder (browser's number; None: nobody), asking (None: nobody), until (s, when
    silence means yes).
    """

    holder: int | None = None
    asking: int | None = None
    until: float = math.inf

    def ask(self, who: int, now: float) -> str:
        """Somebody wants to operate.

        Returns:
            Empty when granted; else what to wait for, or why not.
        """
        if self.holder in (None, who):
            self.holder = who
            self._settled()
            return ""
        if self.asking not in (None, who):
            return "somebody else is asking already; wait for the operator's answer"
        if self.asking is None:
            self.asking, self.until = who, now + ANSWER_TIME
        return f"the operator is asked; without an answer you operate in {ANSWER_TIME:g} s"

    def answer(self, who: int, *, yes: bool) -> int | None:
        """The operator's answer; the number of who asked, or None where it is nobody's to give."""
        if who != self.holder or self.asking is None:
            return None
        asked = self.asking
        if yes:
            self.holder = asked
        self._settled()
        return asked

    def tick(self, now: float) -> bool:
        """Whether silence has handed the lease over."""
        if self.asking is None or now < self.until:
            return False
        self.holder = self.asking
        self._settled()
        return True

    def leave(self, who: int) -> bool:
        """A browser is gone, or steps back; whether that changes anything."""
        if who == self.asking:
            self._settled()
            return True
        if who != self.holder:
            return False
        self.holder = self.asking
        self._settled()
        return True

    def _settled(self) -> None:
        self.asking, self.until = None, math.inf

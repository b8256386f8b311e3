# SPDX-License-Identifier: Apache-2.0
"""Who operates: one browser at a time holds the lease, the others watch. Pure; time is given.

A browser is a number; another panel of the domain, whose browsers are its own affair, a name.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

#: s that the operator has to answer who wants to take over; then silence means yes.
ANSWER_TIME = 10.0

Who = int | str


@dataclass(slots=True)
class Lease:
    """The operator, and who asks to take over.

    Attributes: holder (None: nobody), asking (None: nobody), until (s, when silence means yes;
    where another panel holds the lease, that panel counts), answer_time (s).
    """

    holder: Who | None = None
    asking: Who | None = None
    until: float = math.inf
    answer_time: float = ANSWER_TIME

    def ask(self, who: Who, now: float) -> str:
        """Somebody wants to operate.

        Returns:
            Empty when granted; else what to wait for, or why not.
        """
        if self.holder in (None, who):
            self.give_to(who)
            return ""
        if self.asking not in (None, who):
            return "somebody else is asking already; wait for the operator's answer"
        if self.asking is None:
            self.asking = who
            self.until = now + self.answer_time if isinstance(self.holder, int) else math.inf
        return f"the operator is asked; without an answer you operate in {self.answer_time:g} s"

    def answer(self, who: int, *, yes: bool) -> Who | None:
        """The operator's answer; who asked, or None where it is nobody's to give."""
        if who != self.holder or self.asking is None:
            return None
        asked = self.asking
        self.give_to(asked if yes else who)
        return asked

    def tick(self, now: float) -> bool:
        """Whether silence has handed the lease over."""
        if self.asking is None or now < self.until:
            return False
        self.give_to(self.asking)
        return True

    def leave(self, who: Who) -> bool:
        """Somebody is gone, or steps back; whether that changes anything."""
        if who == self.asking:
            self.give_to(self.holder)
            return True
        if who != self.holder:
            return False
        self.give_to(self.asking)
        return True

    def give_to(self, who: Who | None) -> None:
        """Somebody holds the lease from now on; nobody asks."""
        self.holder, self.asking, self.until = who, None, math.inf

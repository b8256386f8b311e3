# SPDX-License-Identifier: Apache-2.0
"""The lease: one browser at a time operates, the others watch. Pure; time is an argument.

A browser is a number; another panel of the domain, with all its browsers, a name.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

#: s for the operator's answer to a takeover request; then the lease passes.
ANSWER_TIME = 10.0

Who = int | str


@dataclass(slots=True)
class Lease:
    """The operator and a takeover request.

    Attributes: holder (or None), asking (or None), until (s, end of the answer time;
    counted by the panel that holds the lease), answer_time (s).
    """

    holder: Who | None = None
    asking: Who | None = None
    until: float = math.inf
    answer_time: float = ANSWER_TIME

    def ask(self, who: Who, now: float) -> str:
        """Request the lease.

        Returns:
            Empty if granted; else the reason or next step.
        """
        if self.holder in (None, who):
            self.give_to(who)
            return ""
        if self.asking not in (None, who):
            return "another request is open already; wait for the operator's answer"
        if self.asking is None:
            self.asking = who
            self.until = now + self.answer_time if isinstance(self.holder, int) else math.inf
        return f"the operator is asked; without an answer you operate in {self.answer_time:g} s"

    def answer(self, who: int, *, yes: bool) -> Who | None:
        """Apply the operator's answer; returns the applicant, None if not applicable."""
        if who != self.holder or self.asking is None:
            return None
        asked = self.asking
        self.give_to(asked if yes else who)
        return asked

    def tick(self, now: float) -> bool:
        """Whether the answer time has passed the lease on."""
        if self.asking is None or now < self.until:
            return False
        self.give_to(self.asking)
        return True

    def leave(self, who: Who) -> bool:
        """Remove a participant; returns whether the lease changes."""
        if who == self.asking:
            self.give_to(self.holder)
            return True
        if who != self.holder:
            return False
        self.give_to(self.asking)
        return True

    def give_to(self, who: Who | None) -> None:
        """Assign the lease and clear the request."""
        self.holder, self.asking, self.until = who, None, math.inf

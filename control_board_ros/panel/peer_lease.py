# SPDX-License-Identifier: Apache-2.0
"""The panel of the domain that holds the lease. Pure; time is an argument.

Every panel sends a beat twice a second and at each change. The claim of the greatest term counts,
at equal terms that of the greater name: all panels agree after an exchange. A panel not received
for EXPIRY, or unable to send a beat for that time, holds nothing.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields

from control_board_ros.text import clean, clean_name

from .lease import Lease

#: s between beats, s until a silent panel counts as gone, s for a handover.
PERIOD, EXPIRY, HANDOVER = 0.5, 5.0, 2.0
MAX_BEAT, MAX_TERM = 2000, 2**52


@dataclass(frozen=True, slots=True, kw_only=True)
class Beat:
    """A panel's message.

    Attributes: panel (its own name), who (operator or applicant there, for display), holder
    (holder of the lease as far as this panel decides: itself, the panel of a handover, or empty),
    term (of that claim), wish (number of its takeover request; 0: none), refused (panel and number
    of the request that its operator has refused).
    """

    panel: str
    who: str = ""
    holder: str = ""
    term: int = 0
    wish: int = 0
    refused: str = ""

    def text(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def read(cls, text: str) -> Beat | None:
        """Parse a beat; None if invalid: any node can publish."""
        if len(text) > MAX_BEAT:
            return None
        try:
            message = json.loads(text)
        except (ValueError, RecursionError):
            return None
        kinds = {field.name: str if field.type == "str" else int for field in fields(cls)}
        if not isinstance(message, dict) or message.keys() != kinds.keys():
            return None
        if any(type(message[name]) is not kind for name, kind in kinds.items()):
            return None
        ids = (message["panel"], message["holder"], message["refused"])
        if not (0 <= message["term"] < MAX_TERM and message["panel"]) or any(
            clean_name(word) != word for word in ids
        ):
            return None
        return cls(**message | {"who": clean(message["who"])})


class PeerLease:
    """This panel among the others.

    Args:
        name: unique name of this panel.
        lease: of this panel; names represent other panels.
        now: s.
    """

    def __init__(self, name: str, lease: Lease, now: float) -> None:
        self.name, self._lease = name, lease
        self._others: dict[str, tuple[Beat, float]] = {}
        self._claim, self._term, self._claimed = "", 0, 0.0
        self._top = 0  # greatest term, including that of panels that may return
        self._wish, self._wisher = 0, 0
        self._refused = ""
        self._beaten = self._sure_from = now
        self._alone = True

    def receive(self, beat: Beat, now: float) -> None:
        if beat.panel != self.name:
            self._others[beat.panel] = (beat, now)
            self._top = max(self._top, beat.term)

    def is_sure(self, now: float) -> bool:
        """Whether no other panel can have expired this one."""
        if self._alone:
            return True
        return now - self._beaten < EXPIRY and now >= self._sure_from

    def who(self, panel: str) -> str:
        """Operator or applicant at another panel."""
        return self._others[panel][0].who if panel in self._others else "another browser"

    def sent(self, now: float) -> None:
        """Record a beat of this panel."""
        if now - self._beaten >= EXPIRY:  # it was blocked: process received beats first
            self._sure_from = now + PERIOD
        self._beaten = now

    def beat(self, who: str) -> Beat:
        """The present beat; ``who``: operator or applicant here."""
        holder, term = (self._claim, self._term) if self._claim else ("", 0)
        wish = self._wish if self._wisher else 0
        return Beat(
            panel=self.name, who=who, holder=holder, term=term, wish=wish, refused=self._refused
        )

    def reconcile(self, now: float) -> int | None:
        """Reconcile the lease with other panels.

        Returns:
            The browser whose takeover request was refused by another panel, if any.
        """
        if self._others:
            self._alone = False
        self._others = {p: o for p, o in self._others.items() if now - o[1] < EXPIRY}
        self._note_own(now)
        best = self._best()
        if self._claim == self.name:
            if best is not None and (best.term, best.panel) > (self._term, self.name):
                self._claim = ""
                self._lease.give_to(best.holder if best.holder != self.name else best.panel)
            else:
                self._take_wishes(now)
        else:
            self._follow(best)
            self._note_own(now)
        return self._note_wish()

    def _best(self) -> Beat | None:
        claims = [beat for beat, _ in self._others.values() if beat.holder]
        return max(claims, key=lambda beat: (beat.term, beat.panel), default=None)

    def _note_own(self, now: float) -> None:
        """Apply a change of this panel's lease: a claim, a handover, or neither."""
        holder, best = self._lease.holder, self._best()
        top = max(self._term, self._top)
        if isinstance(holder, int):
            if self._claim == self.name:
                return
            if best is not None and best.holder != self.name:  # another panel was faster
                self._lease.give_to(best.holder)
            else:
                self._claim, self._term = self.name, top + 1
        elif self._claim == self.name:
            self._claim, self._term, self._claimed = holder or "", top + 1, now
        elif now - self._claimed >= HANDOVER:
            self._claim = ""

    def _follow(self, best: Beat | None) -> None:
        """Apply that another panel, or none, holds the lease."""
        lease = self._lease
        holder = best.holder if best is not None else self._claim
        if best is not None and holder == self.name:  # handed over to us
            if isinstance(lease.asking, int):
                lease.give_to(lease.asking)
        elif holder:
            if lease.holder != holder:
                lease.holder = holder
        elif isinstance(lease.holder, str):
            lease.leave(lease.holder)

    def _take_wishes(self, now: float) -> None:
        """Process takeover requests of other panels and their withdrawal."""
        lease = self._lease
        for panel, (beat, _) in sorted(self._others.items()):
            if beat.wish and lease.asking is None and self._refused != f"{panel} {beat.wish}":
                lease.ask(panel, now)
        asking = lease.asking
        if isinstance(asking, str) and (asking not in self._others or not self._wish_of(asking)):
            lease.leave(asking)

    def _wish_of(self, panel: str) -> int:
        return self._others[panel][0].wish if panel in self._others else 0

    def refuse(self, panel: str) -> None:
        self._refused = f"{panel} {self._wish_of(panel)}"

    def _note_wish(self) -> int | None:
        """Update the request of this panel; returns the refused browser."""
        lease = self._lease
        wisher = lease.asking if isinstance(lease.holder, str) else None
        if not isinstance(wisher, int):
            self._wisher = 0
            return None
        if wisher != self._wisher:
            self._wisher, self._wish = wisher, self._wish + 1
        refused = f"{self.name} {self._wish}"
        if all(beat.refused != refused for beat, _ in self._others.values()):
            return None
        lease.leave(wisher)
        self._wisher = 0
        return wisher

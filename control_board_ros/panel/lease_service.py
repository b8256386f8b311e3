# SPDX-License-Identifier: Apache-2.0
"""The operator among all browsers of all panels of the domain, and the effects of a change."""

from __future__ import annotations

import socket
import time
import uuid
from collections.abc import Callable

from .browser import Browser
from .hub_state import HubState
from .lease import Lease, Who
from .peer_lease import PERIOD, Beat, PeerLease
from .protocol import BadRequest, Request
from .subscriptions import OperatorTopic

#: s of initial discovery of other panels, without operation.
LOOK_ROUND = 1.5
NOBODY = "you only watch; request control first"


class LeaseService:
    """The lease, shared among panels.

    Args:
        state: the browsers.
        topic: of the panels' beats.
        look_round: s of initial discovery of other panels.
        answer_time: timeout of the operator's answer to a takeover request, s.
        dismiss: called with the number of a former operator.
    """

    def __init__(
        self,
        state: HubState,
        topic: OperatorTopic,
        look_round: float,
        answer_time: float,
        dismiss: Callable[[int], None],
    ) -> None:
        now = time.monotonic()
        self.lease = Lease(answer_time=answer_time)
        self._state, self._topic, self._dismiss = state, topic, dismiss
        self._peers = PeerLease(uuid.uuid4().hex, self.lease, now)
        self._ready, self._open = now + look_round, False
        self._holder: Who | None = None
        self._sent: dict[str, object] = {}
        self._beat, self._beaten = Beat(panel=self._peers.name), 0.0

    def enter(self, browser: Browser) -> None:
        """Add a browser; it operates if permitted and no other browser does."""
        if self._open and self.lease.holder is None and not self._state.read_only:
            self.lease.ask(browser.number, time.monotonic())
        self.changed()

    def leave(self, browser: Browser) -> None:
        """Remove a browser; a page that was loaded again before it left goes on operating."""
        tabs = {b.tab: b.number for b in self._state.browsers.values() if b.tab}
        operated = self.lease.holder == browser.number
        self.lease.leave(browser.number)
        if operated and self.lease.holder is None:
            self.lease.give_to(tabs.get(browser.tab))
        self.changed()

    def check(self, browser: Browser, request: Request) -> None:
        """Reject a command of a browser that does not operate; raises BadRequest with the
        reason.
        """
        if self.lease.holder != browser.number:
            raise BadRequest(NOBODY, request.id)
        if not self._peers.is_sure(time.monotonic()):
            raise BadRequest("the panel was blocked for several seconds; try again", request.id)

    def process(self, browser: Browser, request: Request) -> None:
        """Process a request for, an answer about, or a return of the lease."""
        now, ok, message = time.monotonic(), True, ""
        if request.do == "operate" and self.lease.holder is None and not self._open:
            ok, message = False, "the panel still searches for other panels; retry in 2 s"
        elif request.do == "operate":
            message = self.lease.ask(browser.number, now)
        elif request.do == "hand_over":
            ok = self._answer(browser, yes=request.fields["yes"])
            message = "" if ok else "there is no takeover request"
        elif not self.lease.leave(browser.number):
            ok, message = False, "you do not operate"
        browser.send("answer", id=request.id, ok=ok, message=message)
        self.changed()

    def _answer(self, browser: Browser, *, yes: bool) -> bool:
        asked = self.lease.answer(browser.number, yes=yes)
        if not yes and isinstance(asked, int):
            self._notify_refused(asked, browser.name)
        elif not yes and isinstance(asked, str):
            self._peers.refuse(asked)
        return asked is not None

    def _notify_refused(self, number: int, who: str) -> None:
        if number in self._state.browsers:
            self._state.browsers[number].send("notice", message=f"{who} keeps operating")

    def look(self) -> None:
        """Process other panels' beats, advance time, send beats; called frequently."""
        now = time.monotonic()
        for text in self._topic.take():
            if (beat := Beat.read(text)) is not None:
                self._peers.receive(beat, now)
        self.lease.tick(now)
        if not self._open and now >= self._ready:
            self._peers.reconcile(now)
            self._open = True
            for browser in list(self._state.browsers.values())[:1]:
                self.enter(browser)
        self.changed()

    def changed(self) -> None:
        """Apply changes: settle with other panels, inform browsers, dismiss former operators."""
        now = time.monotonic()
        holder = self.lease.holder
        who = self._peers.who(holder) if isinstance(holder, str) else ""
        refused = self._peers.reconcile(now)
        if refused is not None:
            self._notify_refused(refused, who)
        before, self._holder = self._holder, self.lease.holder
        if isinstance(before, int) and before != self._holder:
            self._dismiss(before)
        if (news := self._operator_fields()) != self._sent:
            self._sent = news
            self._state.send_all("operator", **news)
        self._send_beat(now)

    def _send_beat(self, now: float) -> None:
        local = self.lease.holder if isinstance(self.lease.holder, int) else self.lease.asking
        browser = self._state.browsers.get(local) if isinstance(local, int) else None
        who = f"{browser.name} at {socket.gethostname()}" if browser else ""
        if now - self._beaten >= PERIOD or self._peers.beat(who) != self._beat:
            self._peers.sent(now)
            self._beat, self._beaten = self._peers.beat(who), now
            self._topic.send(self._beat.text())

    def _operator_fields(self) -> dict[str, object]:
        """Operator, watchers and takeover request for the page."""
        names: dict[Who, str] = {b.number: b.name for b in self._state.browsers.values()}
        for who in (self.lease.holder, self.lease.asking):
            if isinstance(who, str):
                names[who] = self._peers.who(who)
        return {
            "holder": self.lease.holder,
            "asking": self.lease.asking,
            "seconds": self.lease.answer_time,
            "browsers": names,
        }

    def close(self) -> None:
        """End operation at this panel."""
        self.lease.give_to(None)
        self.changed()

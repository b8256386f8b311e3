# SPDX-License-Identifier: Apache-2.0
"""Panels of one domain: one browser of theirs operates, whatever dies, stalls or is late."""

from __future__ import annotations

import json
import random
from dataclasses import dataclass, field, replace

import pytest

from control_board_ros.panel.lease import ANSWER_TIME, Lease
from control_board_ros.panel.peer_lease import EXPIRY, HANDOVER, PERIOD, Beat, PeerLease

TICK = 0.05


@dataclass
class Panel:
    """A panel with browser 1, as the program runs it."""

    name: str
    lease: Lease = field(default_factory=Lease)
    alive: bool = True
    refused: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.peers = PeerLease(self.name, self.lease, 0.0)
        self.beaten = -PERIOD
        self.last = Beat(panel=self.name)

    @property
    def operates(self) -> bool:
        return isinstance(self.lease.holder, int)


class Domain:
    """Panels, and beats on their way."""

    def __init__(self, *names: str, seed: int = 0, slowest: float = 0.0) -> None:
        self.panels = {name: Panel(name) for name in names}
        self.now, self._random, self._slowest = 0.0, random.Random(seed), slowest
        self._arrivals: dict[str, float] = {}
        self._under_way: list[tuple[float, str, Beat]] = []

    def __getitem__(self, name: str) -> Panel:
        return self.panels[name]

    def run(self, seconds: float) -> None:
        """Let time pass."""
        for _ in range(round(seconds / TICK)):
            self.now += TICK
            for panel in self.panels.values():
                if panel.alive:
                    self._tick(panel)

    def _tick(self, panel: Panel) -> None:
        arrived = [entry for entry in self._under_way if entry[0] <= self.now]
        for entry in [entry for entry in arrived if entry[1] == panel.name]:
            self._under_way.remove(entry)
            panel.peers.receive(entry[2], self.now)
        panel.lease.tick(self.now)
        refused = panel.peers.reconcile(self.now)
        panel.refused += [] if refused is None else [refused]
        beat = panel.peers.beat(panel.name)
        if beat != panel.last or self.now - panel.beaten >= PERIOD:
            panel.peers.sent(self.now)
            panel.last, panel.beaten = beat, self.now
            for other in self.panels:
                self._send(panel.name, other, beat)

    def _send(self, sender: str, receiver: str, beat: Beat) -> None:
        """In order between two panels, as DDS has it; as late as the network likes."""
        way = f"{sender} {receiver}"
        late = self.now + self._random.uniform(0.0, self._slowest)
        self._arrivals[way] = max(late, self._arrivals.get(way, 0.0))
        self._under_way.append((self._arrivals[way], receiver, beat))

    def operators(self) -> list[str]:
        return [name for name, panel in self.panels.items() if panel.alive and panel.operates]


@pytest.fixture
def domain() -> Domain:
    """Browser 1 of panel a operates."""
    domain = Domain("a", "b", "c")
    assert domain["a"].lease.ask(1, 0.0) == ""
    domain.run(0.2)
    assert [panel.lease.holder for panel in domain.panels.values()] == [1, "a", "a"]
    return domain


def test_requests_at_another_panel_wait_for_the_operator(domain: Domain) -> None:
    assert "asked" in domain["b"].lease.ask(1, domain.now)
    domain.run(0.2)
    assert domain["a"].lease.asking == "b"
    assert domain["a"].peers.who("b") == "b"
    assert domain["a"].lease.answer(1, yes=True) == "b"
    for _ in range(10):  # at no time do two operate
        domain.run(TICK)
        assert domain.operators() in ([], ["b"])
    assert [panel.lease.holder for panel in domain.panels.values()] == ["b", 1, "b"]


def test_a_wish_is_refused_and_may_be_repeated(domain: Domain) -> None:
    for count in (1, 2):
        domain["b"].lease.ask(1, domain.now)
        domain.run(0.2)
        assert domain["a"].lease.answer(1, yes=False) == "b"
        domain["a"].peers.refuse("b")
        domain.run(0.2)
        assert domain["b"].refused == [1] * count
        assert domain["b"].lease.asking is None
        assert domain["a"].lease.asking is None
        assert domain.operators() == ["a"]


def test_silence_hands_over_to_another_panel(domain: Domain) -> None:
    domain["b"].lease.ask(1, domain.now)
    domain.run(0.9 * ANSWER_TIME)
    assert domain.operators() == ["a"]
    domain.run(0.2 * ANSWER_TIME)
    assert domain.operators() == ["b"]


def test_a_wish_ends_with_its_browser(domain: Domain) -> None:
    domain["b"].lease.ask(1, domain.now)
    domain.run(0.2)
    domain["b"].lease.leave(1)
    domain.run(0.2)
    assert domain["a"].lease.asking is None


def test_a_dead_panels_lease_expires(domain: Domain) -> None:
    domain["a"].alive = False
    domain["c"].lease.ask(1, domain.now)
    domain.run(EXPIRY - PERIOD - 2 * TICK)
    assert domain["b"].lease.holder == "a"
    domain.run(PERIOD + 0.2)
    assert domain.operators() == ["c"]  # the panel that asked gets it
    assert domain["b"].lease.holder == "c"


def test_a_lease_given_to_a_dead_panel_is_free(domain: Domain) -> None:
    domain["b"].lease.ask(1, domain.now)
    domain.run(0.2)
    domain["b"].alive = False
    domain["a"].lease.answer(1, yes=True)
    domain.run(max(EXPIRY, HANDOVER) + 0.2)
    assert domain["a"].lease.holder is None
    assert domain["c"].lease.holder is None


def test_a_panel_that_stood_still_is_not_sure_and_gives_way(domain: Domain) -> None:
    """It had expired; requests before it has received the others' beats do nothing."""
    domain["b"].lease.ask(1, domain.now)
    domain["a"].lease.leave(1)
    domain.run(0.2)
    panel = domain["b"]
    panel.alive = False
    domain.run(EXPIRY + 0.2)
    assert domain["a"].lease.ask(1, domain.now) == ""
    domain.run(0.2)
    assert panel.operates
    assert not panel.peers.is_sure(domain.now)
    panel.alive = True
    domain.run(TICK)
    assert not panel.operates
    assert not panel.peers.is_sure(domain.now)
    domain.run(PERIOD + 2 * TICK)
    assert panel.peers.is_sure(domain.now)
    assert panel.lease.holder == "a"


def test_the_first_panel_operates() -> None:
    """A claim in transit counts more than one not sent yet."""
    domain = Domain("b", "a")  # b receives it with its next tick
    domain["a"].lease.ask(1, 0.0)
    domain.run(TICK)
    assert domain["b"].lease.ask(1, domain.now) == ""
    domain.run(TICK)
    assert domain.operators() == ["a"]


def test_a_refusal_counts_until_it_has_arrived() -> None:
    """The request is still received for a while, and not repeated."""
    domain = Domain("a", "b")
    domain["a"].lease.ask(1, 0.0)
    domain.run(0.2)
    domain["b"].lease.ask(1, domain.now)
    domain.run(0.2)
    domain["b"].alive = False  # slow, for a second
    domain["a"].lease.answer(1, yes=False)
    domain["a"].peers.refuse("b")
    domain.run(1.0)
    assert domain["a"].lease.asking is None


def test_two_that_begin_at_once_agree() -> None:
    domain = Domain("a", "b", slowest=0.3)
    for panel in domain.panels.values():
        panel.lease.ask(1, 0.0)
    domain.run(2.0)
    assert domain.operators() == ["b"]
    assert domain["a"].lease.holder == "b"


@pytest.mark.parametrize("seed", range(25))
def test_they_agree_in_the_end(seed: int) -> None:
    """People ask, answer, leave; panels stall, die and come back; the network is slow."""
    chance = random.Random(seed)
    domain = Domain(*"abc", seed=seed, slowest=chance.choice([0.0, 0.1, 0.4]))
    for _ in range(60):
        panel = chance.choice(list(domain.panels.values()))
        lease = panel.lease
        match chance.randrange(6):
            case 0 | 1:
                lease.ask(1, domain.now)
            case 2:
                lease.leave(1)
            case 3:
                panel.alive = not panel.alive
            case _ if isinstance(asking := lease.asking, str):
                yes = chance.random() < 0.5
                if lease.answer(1, yes=yes) is not None and not yes:
                    panel.peers.refuse(asking)
        domain.run(chance.choice([TICK, 0.5, 3.0]))
    for panel in domain.panels.values():
        panel.alive = True
    domain.run(ANSWER_TIME + 2 * EXPIRY)
    assert len(domain.operators()) <= 1
    holder = next(iter(domain.operators()), None)
    for panel in domain.panels.values():
        assert panel.lease.holder == (1 if panel.name == holder else holder)


def test_beats_on_the_wire() -> None:
    beat = Beat(panel="a", who="Chrome (desk)", holder="b", term=3, wish=2, refused="c 1")
    assert Beat.read(beat.text()) == beat


GOOD = json.loads(Beat(panel="a", term=1).text())
WRONG = [
    "", "{", "[]", "7", "[" * 10_000, json.dumps(GOOD | {"panel": ""}),
    json.dumps(GOOD | {"term": -1}), json.dumps(GOOD | {"term": 2**60}),
    json.dumps(GOOD | {"term": True}), json.dumps(GOOD | {"term": 1.5}),
    json.dumps(GOOD | {"who": 7}), json.dumps(GOOD | {"more": 1}),
    json.dumps(GOOD | {"who": "x" * 3000}), json.dumps({"panel": "a"}),
]  # fmt: skip


@pytest.mark.parametrize("text", WRONG)
def test_invalid_beats(text: str) -> None:
    assert Beat.read(text) is None


def test_its_own_beats_mean_nothing() -> None:
    domain = Domain("a")
    domain["a"].peers.receive(replace(Beat(panel="a"), holder="a", term=9), 0.0)
    domain.run(0.2)
    assert domain["a"].lease.holder is None

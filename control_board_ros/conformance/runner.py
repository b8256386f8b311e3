# SPDX-License-Identifier: Apache-2.0
"""Which joint is tried, the rules one after the other, and everything left as found."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from control_board_ros.client import BoardError, ControlBoardClient
from control_board_ros.protocols import Floats

from .as_found import AsFound
from .bench import Allowed, Bench
from .channel import Channel
from .limits import Range, read_limits
from .rules import NotHeld, NotTestable, Rule

#: A load that a joint may fall under, as a part of that of the joint that bears most.
LIGHT = 0.02


class Outcome(StrEnum):
    """How a rule went."""

    HELD = "held"
    NOT_HELD = "not held"
    NOT_TESTABLE = "not testable"


@dataclass(frozen=True, slots=True)
class Result:
    """A rule, how it went, the evidence or the reason, and how long it took (s)."""

    rule: Rule
    outcome: Outcome
    evidence: str
    seconds: float


def choose(client: ControlBoardClient, found: AsFound, wanted: str | None) -> str:
    """The joint to try: the one asked for, else the last of those that offer most, bear least.

    A joint that bears a load falls while it is unpowered; the last ones move the least mass.

    Raises:
        NotTestable: the one asked for cannot be tried.
    """
    if wanted is not None:
        if wanted not in found.names:
            raise NotTestable(f"{wanted} cannot be tried; these can: {', '.join(found.names)}")
        return wanted
    available = dict(zip(found.names, client.get_available_modes(found.names), strict=True))
    offers = {name: len(modes) + 2 * len(ways) for name, (modes, ways) in available.items()}
    most = [name for name in found.names if offers[name] == max(offers.values())]
    loads = np.nan_to_num(np.abs(client.get_torque(most)))
    return most[lightest(loads)]


def lightest(loads: Floats) -> int:
    """The last of the joints that bear next to nothing, else the one that bears least."""
    return int(np.flatnonzero(loads <= max(LIGHT * loads.max(), loads.min()))[-1])


class Session:
    """One run on one board.

    Args:
        node: that nobody spins.
        client: of the board.
        joint: to try; None: choose one.
        fraction: of the joint's limits that is used.
        allowed: what else may be done.
        patience: s to wait for an answer.

    Attributes: bench, found.

    Raises:
        NotTestable: no joint can be tried.
        BoardError: no board.
    """

    def __init__(
        self,
        node: Any,
        client: ControlBoardClient,
        *,
        joint: str | None = None,
        fraction: float = 0.1,
        allowed: Allowed | None = None,
        patience: float = 5.0,
    ) -> None:
        self.found = AsFound.of(client)
        name = choose(client, self.found, joint)
        number = client.names.index(name)
        partner = next((other for other in self.found.names if other != name), None)
        position = float(client.get_encoder(name)[0])
        limits = Range.of(read_limits(client, name), position, fraction)
        self.channel = Channel(node, client.board_name, patience)
        self.bench = Bench(client, self.channel, number, partner, limits, allowed or Allowed())

    def close(self) -> None:
        """End the connection."""
        self.channel.close()

    @contextmanager
    def holding(self, problems: list[str]) -> Iterator[Bench]:
        """Hold all joints, and leave them as found; what could not be goes into ``problems``."""
        try:
            self.found.hold(self.bench.client)
            yield self.bench
        finally:
            problems += self.found.restore(self.bench)

    def try_one(self, rule: Rule) -> Result:
        """Try a rule from rest."""
        begin = time.monotonic()
        outcome, evidence = Outcome.HELD, ""
        try:
            self.found.hold(self.bench.client)
            self.found.give_back(self.bench.client)
            self.bench.home()
            evidence = rule.check(self.bench)
        except NotHeld as error:
            outcome, evidence = Outcome.NOT_HELD, str(error)
        except NotTestable as error:
            outcome, evidence = Outcome.NOT_TESTABLE, str(error)
        except (BoardError, ValueError) as error:  # no answer, or one that cannot be read
            outcome, evidence = Outcome.NOT_HELD, f"{error}"
        return Result(rule, outcome, evidence, time.monotonic() - begin)

    def is_there(self) -> bool:
        """Whether the board can still be asked."""
        try:
            self.bench.client.wait_until_found(self.channel.patience)
        except BoardError:
            return False
        return True


def run(
    session: Session, rules: Sequence[Rule], tell: Callable[[Result], None] = lambda _: None
) -> tuple[list[Result], list[str]]:
    """Try rules in their order.

    Args:
        session: with a board.
        rules: to try.
        tell: given each result as it comes.

    Returns:
        The results, and what could not be left as it was found.
    """
    results: list[Result] = []
    problems: list[str] = []
    gone = False
    with session.holding(problems):
        for rule in rules:
            if gone:
                result = Result(rule, Outcome.NOT_TESTABLE, "the board is gone", 0.0)
            else:
                result = session.try_one(rule)
                gone = result.outcome is Outcome.NOT_HELD and not session.is_there()
            results.append(result)
            tell(result)
    return results, problems

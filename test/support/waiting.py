# SPDX-License-Identifier: Apache-2.0
"""How tests wait: until a condition is true, with a guard against what never comes."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

#: Timeout of every wait, s; long enough for the busiest machine: no test is decided by it.
GUARD = 120.0
#: Time after which ``insist`` acts again, s.
AGAIN = 3.0
#: Time between two checks, s: a poll without a pause takes the processor from what it waits for.
PERIOD = 0.01
#: The same, as a share of the time waited so far: a long wait needs few checks, too.
SHARE = 0.05


def until(
    condition: Callable[[], T],
    report: Callable[[], object] = lambda: "condition not reached",
    *,
    period: float = PERIOD,
) -> T:
    """Wait until a condition returns something true, and return that.

    Args:
        condition: called every ``period`` seconds, and more rarely the longer it takes.
        report: what a failure shows, called when it is due.
        period: s.

    Raises:
        AssertionError: the condition was not true within ``GUARD`` seconds.
    """
    start = time.monotonic()
    while not (found := condition()):
        waited = time.monotonic() - start
        assert waited < GUARD, report()
        time.sleep(max(period, SHARE * waited))
    return found


def insist(act: Callable[[], object], reached: Callable[[], object]) -> None:
    """Act until it is so, every few seconds: a board that stood still drops what waited (B6), as
    does a page that does not hear it.

    Raises:
        AssertionError: it was not so within ``GUARD`` seconds.
    """

    def acted() -> bool:
        act()
        end = time.monotonic() + AGAIN
        while not (found := reached()) and time.monotonic() < end:
            time.sleep(PERIOD)
        return bool(found)

    until(acted)

# SPDX-License-Identifier: Apache-2.0
"""The rules by name, and how the test of one ends other than with its evidence."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

from control_board_ros.client import BoardError
from control_board_ros.core.selection import RequestError

#: A test of a rule: with the bench, it returns the evidence.
Check = TypeVar("Check", bound=Callable[..., str])


class NotHeld(Exception):  # noqa: N818
    """The board violates the rule; the text has the observed and the expected value."""


class NotTestable(Exception):  # noqa: N818
    """The rule does not apply to this board; the text has the reason."""


class NotTested(Exception):  # noqa: N818
    """The rule applies but could not be tested; the text has the reason."""


class OutOfTime(NotTested):
    """The rule exceeded its time limit."""


def expect(condition: object, text: str) -> None:
    """The rule itself; raises NotHeld where the condition is false."""
    if not condition:
        raise NotHeld(text)


def assume(condition: object, text: str) -> None:
    """A precondition covered by another rule; raises NotTested where the condition is false."""
    if not condition:
        raise NotTested(text)


def offered(condition: object, text: str) -> None:
    """A feature that the rule requires; raises NotTestable where the condition is false."""
    if not condition:
        raise NotTestable(text)


@contextmanager
def feature(text: str) -> Iterator[None]:
    """Requests of a feature that a board may lack; raises NotTestable where it refuses them."""
    try:
        yield
    except (BoardError, RequestError) as error:
        raise NotTestable(f"{text}: {error}") from None


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of the specification.

    Attributes: name (``M4``), title, check (tests it; returns the evidence).
    """

    name: str
    title: str
    check: Callable[..., str]


#: All of them by name, in the order of the specification once the package is imported.
RULES: dict[str, Rule] = {}

#: The groups of the specification, in its order.
GROUPS = ("V", "M", "P", "I", "F", "K", "N", "A", "D", "Y", "E")


def rule(name: str, title: str) -> Callable[[Check], Check]:
    """Register a function as a rule."""

    def register(check: Check) -> Check:
        RULES[name] = Rule(name, title, check)
        return check

    return register


def inside(name: str, title: str, why: str) -> None:
    """Register a rule that is not externally visible."""

    @rule(name, title)
    def check(_bench: object) -> str:
        raise NotTestable(why)


def in_order() -> list[Rule]:
    """The rules in the order of the specification."""

    def place(rule: Rule) -> tuple[int, int]:
        return GROUPS.index(rule.name[0]), int(rule.name[1:] or 0)

    return sorted(RULES.values(), key=place)

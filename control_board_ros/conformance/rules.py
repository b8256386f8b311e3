# SPDX-License-Identifier: Apache-2.0
"""What a rule is, and how its function says how it went."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .bench import Bench


class NotHeld(Exception):  # noqa: N818
    """The board does not keep the rule; the text says what was seen and what was expected."""


class NotTestable(Exception):  # noqa: N818
    """Nothing can be said of the rule on this board; the text says why."""


class NotTested(Exception):  # noqa: N818
    """The board offers what a rule is about, yet it could not be tried; the text says why."""


class OutOfTime(NotTested):
    """The rule took longer than a rule may take."""


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of the specification.

    Attributes: name (``M4``), title (what it is about), check (tries it; returns the evidence).
    """

    name: str
    title: str
    check: Callable[[Bench], str]


#: All of them by name, in the order of the specification once the package is imported.
RULES: dict[str, Rule] = {}

#: The groups of the specification, in its order.
GROUPS = ("V", "M", "P", "I", "F", "K", "N", "A", "D", "Y")


def rule(name: str, title: str) -> Callable[[Callable[[Bench], str]], Callable[[Bench], str]]:
    """Make a rule of a function."""

    def register(check: Callable[[Bench], str]) -> Callable[[Bench], str]:
        RULES[name] = Rule(name, title, check)
        return check

    return register


def inside(name: str, title: str, why: str) -> None:
    """Note a rule that nobody sees from outside."""

    @rule(name, title)
    def check(_bench: Bench) -> str:
        raise NotTestable(why)


def in_order() -> list[Rule]:
    """The rules in the order of the specification."""

    def place(found: Rule) -> tuple[int, int]:
        return GROUPS.index(found.name[0]), int(found.name[1:] or 0)

    return sorted(RULES.values(), key=place)


def expect(condition: object, text: str) -> None:
    """The rule itself.

    Raises:
        NotHeld: the condition is false.
    """
    if not condition:
        raise NotHeld(text)


def assume(condition: object, text: str) -> None:
    """What a rule builds on and another rule is about.

    Raises:
        NotTested: the condition is false.
    """
    if not condition:
        raise NotTested(text)


def offered(condition: object, text: str) -> None:
    """What the board must offer, or may be asked for, so that the rule has a meaning.

    Raises:
        NotTestable: the condition is false.
    """
    if not condition:
        raise NotTestable(text)

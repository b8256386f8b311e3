# SPDX-License-Identifier: Apache-2.0
"""The rules by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .bench import Bench
from .outcomes import NotTestable


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of the specification.

    Attributes: name (``M4``), title, check (tests it; returns the evidence).
    """

    name: str
    title: str
    check: Callable[[Bench], str]


#: All of them by name, in the order of the specification once the package is imported.
RULES: dict[str, Rule] = {}

#: The groups of the specification, in its order.
GROUPS = ("V", "M", "P", "I", "F", "K", "N", "A", "D", "Y")


def rule(name: str, title: str) -> Callable[[Callable[[Bench], str]], Callable[[Bench], str]]:
    """Register a function as a rule."""

    def register(check: Callable[[Bench], str]) -> Callable[[Bench], str]:
        RULES[name] = Rule(name, title, check)
        return check

    return register


def inside(name: str, title: str, why: str) -> None:
    """Register a rule that is not externally visible."""

    @rule(name, title)
    def check(_bench: Bench) -> str:
        raise NotTestable(why)


def in_order() -> list[Rule]:
    """The rules in the order of the specification."""

    def place(found: Rule) -> tuple[int, int]:
        return GROUPS.index(found.name[0]), int(found.name[1:] or 0)

    return sorted(RULES.values(), key=place)

# SPDX-License-Identifier: Apache-2.0
"""Completion of arguments: the words that Tab offers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from .words import short_names


class TypedLine(NamedTuple):
    """A line at the cursor, and its board.

    Attributes: before (the words between the verb and the one that is typed), incomplete (what is
    typed of it), joints and poses (ask the board for its own).
    """

    before: Sequence[str]
    incomplete: str
    joints: Callable[[], Sequence[str]]
    poses: Callable[[], Sequence[str]]


#: The words of an argument; the caller drops those that do not begin with the typed characters.
Offers = Callable[[TypedLine], Iterable[str]]


def joints(typed: TypedLine) -> list[str]:
    """Joints: short names where one begins with the typed characters."""
    names = typed.joints()
    shorts = list(short_names(names).values())
    return shorts if any(short.startswith(typed.incomplete) for short in shorts) else [*names]


def joints_or_all(typed: TypedLine) -> list[str]:
    return [*joints(typed), "all"]


def assignments(typed: TypedLine) -> list[str]:
    return [f"{joint}=" for joint in joints(typed)]


def one_of(words: Sequence[str]) -> Offers:
    """One of these words, and nothing after it."""
    return lambda typed: () if typed.before else words


def joints_then(words: Sequence[str]) -> Offers:
    def offered(typed: TypedLine) -> Sequence[str]:
        last = [word for word in words if word.startswith(typed.incomplete)]
        return last if typed.before and last else joints_or_all(typed)

    return offered

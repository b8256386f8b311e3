# SPDX-License-Identifier: Apache-2.0
"""The arguments of verbs: a table beside each verb, read with argparse."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, TypeVar

from control_board_ros.text import nearest

from .offers import Offers, TypedLine, assignments, joints_or_all, joints_then
from .words import EXAMPLES, UsageError, quantity

Verb = TypeVar("Verb", bound=Callable[..., Any])

HELP = ("-h", "--help")
#: A value that argparse would read as an option: ``-2Nm``.
NEGATIVE = re.compile(r"-\.?\d")
#: Before a word that is no option although it begins with a dash: it follows ``--``.
NO_OPTION = "\0"


def number(text: str) -> float:
    """A number, as the ``type`` of an argument.

    Raises:
        ArgumentTypeError: it is none; argparse names the option.
    """
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is no number") from None


@dataclass(frozen=True, slots=True)
class Argument:
    """Names and settings of ``ArgumentParser.add_argument``, and the words that Tab offers."""

    names: tuple[str, ...]
    settings: dict[str, Any]
    offers: Offers | None = None

    @property
    def positional(self) -> bool:
        return not self.names[0].startswith("-")


def argument(*names: str, offers: Offers | None = None, **settings: Any) -> Argument:
    """An argument, or an option where its names begin with a dash."""
    return Argument(names, settings, offers)


def amount(name: str, kind: str, **settings: Any) -> Argument:
    """An option with a quantity above 0, e.g. ``--for 2s``, read in SI units."""

    def above_zero(text: str) -> float:
        value = quantity(text, kind).value
        if value <= 0.0:
            raise UsageError(
                f"{name} {text} is not valid; give a {kind} above 0, e.g. {EXAMPLES[kind]}"
            )
        return value

    return argument(name, type=above_zero, **settings)


def with_arguments(*arguments: Argument) -> Callable[[Verb], Verb]:
    """Declare the arguments of a verb, passed by keyword after the session."""

    def note_down(verb: Verb) -> Verb:
        verb.arguments = arguments  # type: ignore[attr-defined]
        return verb

    return note_down


def several(verb: Verb) -> Verb:
    """Mark a verb that runs once for each board, where ``--board`` is a pattern."""
    verb.several = True  # type: ignore[attr-defined]
    return verb


def ahead(request: Callable[..., Any]) -> Callable[[Verb], Verb]:
    """Mark a verb of several boards that makes a request of each as soon as it is found.

    Args:
        request: Of the arguments of the verb, which makes it again, and says what came of it.
    """

    def mark(verb: Verb) -> Verb:
        verb.ahead = request  # type: ignore[attr-defined]
        return several(verb)

    return mark


def patterns(verb: Verb) -> Verb:
    """Mark a verb that handles a pattern of ``--board`` itself."""
    verb.patterns = True  # type: ignore[attr-defined]
    return verb


def arguments_of(verb: Callable[..., Any]) -> tuple[Argument, ...]:
    arguments: tuple[Argument, ...] = getattr(verb, "arguments", ())
    return arguments


def offered(verb: Callable[..., Any], typed: TypedLine) -> list[str]:
    """The words that may follow on the line of a verb; no options."""
    if typed.incomplete.startswith("-"):
        return []
    words = [word for entry in arguments_of(verb) if entry.offers for word in entry.offers(typed)]
    return [word for word in words if word.startswith(typed.incomplete)]


class Parser(argparse.ArgumentParser):
    """Reads words; errors are raised, and help is drawn by ``help``."""

    def __init__(self, name: str, arguments: Sequence[Argument]) -> None:
        super().__init__(prog=name, usage=name, add_help=False, allow_abbrev=False)
        self.valued = set[str]()
        self.unknown: list[str] = []  # that begin with a dash
        for entry in arguments:
            settings = {key: value for key, value in entry.settings.items() if key != "help"}
            action = self.add_argument(*entry.names, **settings)
            if action.nargs != 0:
                self.valued.update(action.option_strings)

    def read(self, words: Sequence[str]) -> dict[str, Any]:
        """The values by name; options may be anywhere among the words.

        Raises:
            UsageError: an argument is missing, unknown or invalid.
        """
        k = words.index("--") if "--" in words else len(words)
        self.unknown = [word for word in words[:k] if self.looks_like_an_option(word)]
        joined: list[str] = []
        for word in words[:k]:
            if joined and joined[-1] in self.valued and NEGATIVE.match(word):
                joined[-1] += f"={word}"
            else:
                joined.append(word)
        joined += [NO_OPTION + word if word.startswith("-") else word for word in words[k + 1 :]]
        values, left = self.parse_known_intermixed_args(joined)
        if left:
            hint = nearest(left[0].partition("=")[0], self._option_string_actions)
            self.error(f"unrecognized arguments: {' '.join(left)}{hint}")
        return {name: plain(value) for name, value in vars(values).items()}

    def looks_like_an_option(self, word: str) -> bool:
        """Whether a word begins with one dash, and is no option of the verb."""
        dashed = word.startswith("-") and not word.startswith("--")
        return dashed and not (NEGATIVE.match(word) or word[:2] in self._option_string_actions)

    def error(self, message: str) -> NoReturn:
        if self.unknown:
            message += f"; {self.unknown[0][:40]} is no option: write -- before a joint so named"
        raise UsageError(f"{message}; see {self.prog} --help")


def plain(value: Any) -> Any:
    """The value of an argument, without the marks of words that are no options."""
    if isinstance(value, list):
        return [plain(entry) for entry in value]
    return value.removeprefix(NO_OPTION) if isinstance(value, str) else value


def joints_then_mode(codes: Sequence[str]) -> Argument:
    return argument(
        "words",
        nargs="+",
        metavar="JOINT… MODE",
        help="Joints, then a mode.",
        offers=joints_then(codes),
    )


JOINTS = argument(
    "joints", nargs="*", metavar="JOINT", help="Joints; none: all.", offers=joints_or_all
)
VALUES = argument(
    "words", nargs="+", metavar="JOINT=VALUE", help="A value for each joint.", offers=assignments
)
FOR = amount(
    "--for", "time", dest="time", metavar="TIME", help="Duration, e.g. 2s; then it stops."
)

# SPDX-License-Identifier: Apache-2.0
"""Completion with Tab in bash, zsh and fish."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from .board.boards import boards_meant
from .board.session import Session
from .line.arguments import arguments_of, offered
from .line.options import ARGUMENTS, Options, hoist, read_options
from .line.words import Refused, UsageError
from .text.output import DONE, put
from .verbs import VERBS, load

#: Timeout for finding a board and for its answers, s: Tab must not hang.
TIMEOUT = 2.0


def complete(environment: Mapping[str, str]) -> int:
    """Print the words that may follow at the cursor, a line each; returns the exit code.

    Args:
        environment: with COMP_WORDS, the line, and COMP_CWORD, the index of the word at the
            cursor.
    """
    words, k = environment.get("COMP_WORDS", "").split(), int(environment.get("COMP_CWORD", 0))
    incomplete = words[k] if k < len(words) else ""
    try:
        candidates = at_cursor(words[1:k], incomplete)
    except UsageError:  # the value of an option is typed
        candidates = []
    for word in candidates:
        if word.startswith(incomplete):
            put(word)
    return DONE


def at_cursor(words: Sequence[str], incomplete: str) -> Sequence[str]:
    """Verbs, options, or arguments of the verb from the present board.

    Raises:
        UsageError: an option has no value yet.
    """
    if words and words[-1] == "--board":
        front, _ = hoist(words[:-1])
        options, _ = read_options(front, [])
        return all_boards(options)
    front, rest = hoist(words)
    options, _ = read_options(front, [])
    if incomplete.startswith("-"):
        known = arguments_of(load(rest[0])) if rest and rest[0] in VERBS else ()
        names = [name for entry in (*known, *ARGUMENTS) for name in entry.names]
        return [name for name in (*names, "--help") if name.startswith("--")]
    if not rest:
        return list(VERBS)
    if rest[0] not in VERBS:
        return []
    options.timeout = TIMEOUT
    with Session(options) as session:
        return offered(load(rest[0]), session.typed(rest[1:], incomplete))


def all_boards(options: Options) -> list[str]:
    """The names of the discovered boards."""
    with Session(replace(options, board="/*", timeout=TIMEOUT)) as session:
        try:
            return boards_meant(session)
        except Refused:
            return []

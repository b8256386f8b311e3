# SPDX-License-Identifier: Apache-2.0
"""Names and texts of other origin, made safe for display, storage and file names.

ROS messages, drives and recordings contain texts of unknown origin. A terminal executes some
characters (titles, colours, the clipboard), others reverse the direction of writing, lone
surrogates are invalid, and ``../`` in a path leaves its folder.
"""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Iterable, Sequence

#: Maximum characters of a text and of a name.
TEXT, NAME = 500, 120
#: Replaces a character that is not displayed.
REPLACED = "\N{REPLACEMENT CHARACTER}"
_SPACES = frozenset("\t\n\v\f\r\x85\N{LINE SEPARATOR}\N{PARAGRAPH SEPARATOR}")


class OneLineError(ValueError):
    """A one-line error in a user's file; unprintable characters are replaced."""

    def __init__(self, text: str) -> None:
        shown = (c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
        super().__init__("".join(shown))


def clean(text: object, max_length: int = TEXT) -> str:
    """A text on one line, ``most`` characters long at most, safe for a terminal.

    Separators of lines and columns become spaces; control characters, changes of the direction
    of writing, and lone surrogates become U+FFFD. The end has the number of omitted ones.
    """
    whole = text if type(text) is str else _words_of(text)
    if len(whole) <= max_length and whole.isprintable():
        return whole
    kept = "".join(map(_shown, whole[:max_length]))
    left = len(whole) - max_length
    return f"{kept} … ({left} characters more)" if left > 0 else kept


def clean_lines(text: str) -> str:
    """A text of several lines and columns, cleaned as by ``clean``, of any length."""
    if text.isprintable():
        return text
    return "".join(c if c in "\n\t" else _shown(c) for c in text)


def clean_name(name: object) -> str:
    """A name, cleaned as by ``clean``."""
    return clean(name, NAME)


def clean_names(names: Iterable[object]) -> tuple[str, ...]:
    """Names, cleaned as by ``clean``."""
    return tuple(clean(name, NAME) for name in names)


def json_line(value: object) -> str:
    """JSON on one line; characters that are not displayed are escaped."""
    made = json.dumps(value, ensure_ascii=False)
    if made.isprintable():
        return made
    return "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in made)


def file_name(name: object) -> str:
    """A file name: letters, digits, ``_``, ``-`` and ``.``, no path to another folder."""
    safe = re.sub(r"[^\w.-]", "_", clean(name, NAME).encode("ascii", "replace").decode())
    return safe.lstrip(".") or "_"


def _words_of(something: object) -> str:
    """As ``str``, also of objects whose ``__str__`` fails."""
    try:
        return str.__str__(str(something))
    except Exception as error:  # noqa: BLE001 - foreign code
        return f"{type(something).__name__} ({type(error).__name__} in its text)"


def _shown(character: str) -> str:
    if character.isprintable():
        return character
    if character in _SPACES:
        return " "
    return character if unicodedata.category(character) == "Zs" else REPLACED


def nearest(word: str, known: Iterable[str], likeness: float = 0.6) -> str:
    """The end of a phrase that suggests a known word: ``; did you mean 'park'?``, or nothing.

    Args:
        word: an unknown word.
        known: the known words.
        likeness: minimum similarity of the two, 0 to 1.
    """
    from difflib import get_close_matches  # only where something is misspelt

    names = {name.casefold(): name for name in known}
    near = get_close_matches(word[:200].casefold(), names, n=1, cutoff=likeness)
    return f"; did you mean {names[near[0]]!r}?" if near else ""


def count_of(count: int, plural: str) -> str:
    """``1 joint``, ``2 joints``, ``1 velocity``: a number of what has its plural by an s."""
    one = plural[:-3] + "y" if plural.endswith("ies") else plural.removesuffix("s")
    return f"{count} {one if count == 1 else plural}"


def first_of(texts: Sequence[str], most: int) -> str:
    """The first texts, and the number of the others: ``a, b, c and 4 more``."""
    more = len(texts) - most
    return ", ".join(texts[:most]) + (f" and {more} more" if more > 0 else "")


def unknown_word(
    what: str,
    word: object,
    known: Iterable[str],
    lead: str = "one of",
    short: Iterable[str] = (),
) -> str:
    """``joint 'ellbow' unknown; did you mean 'elbow'?; joints: shoulder, elbow``.

    Args:
        what: the word would name.
        word: as the user wrote it.
        known: the known words.
        lead: to them, e.g. ``joints:``.
        short: other forms of them that may be meant, too.
    """
    names = list(known)
    shown = repr(word[:64]) if isinstance(word, str) else repr(word)[:64]
    hint = nearest(str(word), [*names, *short])
    return f"{what} {shown} unknown{hint}; {lead} {', '.join(names) or 'none'}"

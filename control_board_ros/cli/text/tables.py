# SPDX-License-Identifier: Apache-2.0
"""Tables within the width of a terminal: further columns go below; no number is cut."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..line.words import short_names
from .output import console

if TYPE_CHECKING:
    from rich.text import Text

    Columns = dict[str, list[Text]]

#: Between two columns.
GAP = 2
#: Minimum width of a column of words with longer cells, characters.
FOLDED = 14


def grid(
    columns: Mapping[str, Sequence[Any]],
    *,
    names: Sequence[str] = (),
    keys: int = 1,
    right: Sequence[str] = (),
    fold: Sequence[str] = (),
    title: str = "",
    caption: str = "",
) -> Any:
    """A table; wider than the terminal: short names, then stacked titles, then several tables.

    Args:
        columns: cells by title, text or rich's Text; the joints are in the last of the keys.
        names: all joints of the board, for the short names.
        keys: number of leading columns that every part repeats.
        right: titles of columns that are aligned to the right.
        fold: titles of columns of words, that may have several lines.
        title: a line above.
        caption: a line below.
    """
    from rich.console import Group

    room = console().width
    made = {head: [text_of(cell) for cell in cells] for head, cells in columns.items()}
    joint = list(made)[keys - 1]
    if needed(made, fold) > room:
        shorts = short_names([cell.plain for cell in made[joint]], names)
        made[joint] = [text_of(shorts[cell.plain]) for cell in made[joint]]
    stack = " " if needed(made, fold) > room else ""  # titles of two words in two lines
    parts = [
        drawn(part, right, fold, stack, breaks=joint if needed(part, fold, stack) > room else "")
        for part in packed(made, fold, keys, room, stack)
    ]
    spaced = [line for part in parts for line in (part, "")][:-1]
    return Group(*[text_of(title)] * bool(title), *spaced, *[text_of(caption)] * bool(caption))


def text_of(cell: Any) -> Text:
    from rich.text import Text

    return Text(cell) if isinstance(cell, str) else cell


def heads(title: str, stack: str) -> list[str]:
    """The lines of a title; trailing spaces distinguish equal titles."""
    plain = title.strip()
    return plain.split(stack) if stack and plain else [plain]


def column_width(title: str, cells: Sequence[Text], fold: Sequence[str], stack: str) -> int:
    """Minimum width of a column, characters."""
    content = max((cell.cell_len for cell in cells), default=0)
    if title in fold:
        words = [len(word) for cell in cells for word in cell.plain.split()]
        content = max(min(content, FOLDED), *words, 0) if words else 0
    return max(content, *map(len, heads(title, stack)))


def needed(columns: Mapping[str, Sequence[Text]], fold: Sequence[str], stack: str = "") -> int:
    """Minimum width of a table, characters."""
    widths = [column_width(title, cells, fold, stack) for title, cells in columns.items()]
    return sum(widths) + GAP * (len(widths) - 1)


def packed(
    columns: Columns, fold: Sequence[str], keys: int, room: int, stack: str
) -> list[Columns]:
    """The columns in as many tables as they need, each beginning with the keys."""
    titles = list(columns)
    first = {title: columns[title] for title in titles[:keys]}
    parts = [dict(first)]
    for title in titles[keys:]:
        longer = parts[-1] | {title: columns[title]}
        if needed(longer, fold, stack) > room and len(parts[-1]) > keys:
            longer = first | {title: columns[title]}
            parts.append(longer)
        parts[-1] = longer
    return parts


def drawn(
    columns: Columns,
    right: Sequence[str],
    fold: Sequence[str] = (),
    stack: str = "",
    breaks: str = "",
) -> Any:
    """One table in the house style; the column ``breaks`` may have several lines for a word."""
    from rich import box
    from rich.table import Table

    made = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
    for title in columns:
        made.add_column(
            "\n".join(heads(title, stack)),
            justify="right" if title in right else "left",
            no_wrap=False,
            overflow="fold",
            min_width=None
            if title == breaks
            else column_width(title, columns[title], fold, stack),
        )
    for cells in zip(*columns.values(), strict=True):
        made.add_row(*cells)
    return made

# SPDX-License-Identifier: Apache-2.0
"""Many rows on one screen: a table in blocks beside each other, with what there is room for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .tables import drawn, needed

if TYPE_CHECKING:
    from rich.text import Text

#: Characters between two blocks, and lines of each block's head.
BESIDE, HEAD = 3, 2


def fitting(
    columns: Mapping[str, list[Text]], dispensable: Sequence[str], width: int, height: int
) -> tuple[dict[str, list[Text]], int]:
    """The columns to show, and how many blocks of them fit beside each other.

    Columns are left out, the first of the dispensable ones first, until all rows find room.
    """
    kept = dict(columns)
    count = max(map(len, kept.values()))
    left = list(dispensable)
    while True:
        blocks = max((width + BESIDE) // (needed(kept, ()) + BESIDE), 1)
        if blocks * max(height - HEAD, 1) >= count or not left:
            return kept, blocks
        kept.pop(left.pop(0), None)


def dense(
    columns: Mapping[str, list[Text]],
    right: Sequence[str],
    dispensable: Sequence[str],
    width: int,
    height: int,
) -> tuple[Any, int]:
    """A table of many rows within a width and a height, characters.

    Args:
        columns: cells by title.
        right: titles of columns that are aligned to the right.
        dispensable: titles of columns in the order in which they are left out.
        width: of the screen.
        height: likewise.

    Returns:
        What to draw, and how many of the rows found room.
    """
    from rich.table import Table

    kept, fit = fitting(columns, dispensable, width, height)
    count, room = max(map(len, kept.values())), max(height - HEAD, 1)
    blocks = min(fit, -(-count // room))
    rows = min(room, -(-count // blocks))
    beside = Table.grid(padding=(0, BESIDE, 0, 0))
    beside.add_row(
        *(
            drawn(
                {title: cells[k * rows : (k + 1) * rows] for title, cells in kept.items()}, right
            )
            for k in range(blocks)
        )
    )
    return beside, min(blocks * rows, count)

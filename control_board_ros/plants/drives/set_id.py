# SPDX-License-Identifier: Apache-2.0
"""A new id for a drive: it is read back before it counts as set."""

from __future__ import annotations

from collections.abc import Callable


class UnheardError(ConnectionError):
    """No drive answers."""


def check(old: int, new: int, ids: range, heard: Callable[[int], int]) -> None:
    """Before an id is written.

    Args:
        old: The drive's id.
        new: That which it gets.
        ids: That such a drive can have.
        heard: How many drives answer as an id.

    Raises:
        ValueError: there is no such id.
        UnheardError: no drive answers.
        ConnectionError: several do, or the new id is taken.
    """
    if new not in ids:
        raise ValueError(f"id {new}: {ids[0]} to {ids[-1]} is required")
    if old == new:
        raise ValueError(f"id {new} is its id already")
    if (count := heard(old)) != 1:
        error = ConnectionError if count else UnheardError
        raise error(
            f"{count or 'no'} {'drives answer' if count else 'drive answers'} as id {old}; "
            "connect one drive alone, and look with: cbctl drives scan"
        )
    if heard(new):
        raise ConnectionError(f"a drive answers as id {new} already; choose another")


def verify(old: int, new: int, heard: Callable[[int], int]) -> None:
    """After an id was written.

    Raises:
        ConnectionError: the drive does not answer by it, or still by the old one.
    """
    if not heard(new):
        still = f"it still answers as id {old}" if heard(old) else f"nor as id {old}"
        raise ConnectionError(
            f"no drive answers as id {new}, {still}; look with: cbctl drives scan"
        )

# SPDX-License-Identifier: Apache-2.0
"""Which joints a request means, and the checks of a whole request (SPEC M7, P13)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np

from .measurement import Array
from .state import Indices

#: Selections of at most this many different requests are remembered.
REMEMBERED = 256


class RequestError(ValueError):
    """A request that is wrong as a whole; the text is the message of its reply (M7)."""


@dataclass(frozen=True, slots=True)
class Selection:
    """Chosen joints in the order asked: indices, shape (k,), and names."""

    joints: Indices
    names: tuple[str, ...]


class Selector:
    """Resolves what users call joints."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self._index = {name: j for j, name in enumerate(names)}
        self.everyone = Selection(np.arange(len(names)), names)
        self._known: dict[Any, Selection] = {}

    def select(self, joints: int | str | Sequence[int | str] | None) -> Selection:
        """The joints of an index, a name, a sequence of them, or None or () for all.

        Raises:
            RequestError: an unknown joint, or a joint named twice.
        """
        if joints is None:
            return self.everyone
        try:
            key = joints if isinstance(joints, int | str | np.integer) else tuple(joints)
            found = self._known.get(key)
        except TypeError:  # neither names nor numbers
            raise RequestError(self._unknown(joints)) from None
        if isinstance(key, tuple) and not key:
            return self.everyone
        if found is None:
            found = self._resolve(key if isinstance(key, tuple) else (key,))
            if len(self._known) < REMEMBERED:
                self._known[key] = found
        return found

    def _resolve(self, joints: tuple[int | str, ...]) -> Selection:
        seen: dict[int, None] = {}
        for joint in joints:
            j = self._one(joint)
            if j in seen:
                raise RequestError(
                    f"joint {self.names[j]!r} named twice; name each joint once, or none for all"
                )
            seen[j] = None
        return Selection(np.array(list(seen)), tuple(self.names[j] for j in seen))

    def _one(self, joint: int | str) -> int:
        if isinstance(joint, str):
            if (j := self._index.get(joint)) is not None:
                return j
        elif not isinstance(joint, bool) and isinstance(joint, (int, np.integer)):
            if 0 <= joint < len(self.names):
                return int(joint)
            raise RequestError(
                f"joint index {int(joint)} out of range; joints are 0 to {len(self.names) - 1}"
            )
        raise RequestError(self._unknown(joint))

    def _unknown(self, joint: Any) -> str:
        text = str(joint)
        shown = text if len(text) <= 64 else text[:64] + "…"
        near = get_close_matches(text[:64], self.names, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        many = ", …" if len(self.names) > 16 else ""
        return f"joint {shown!r} unknown{hint}; joints: {', '.join(self.names[:16])}{many}"


def spread(values: Any, count: int, what: str) -> Array:
    """One float per chosen joint: a single value goes to all of them.

    Args:
        values: a number or ``count`` numbers; not checked for being finite.
        count: how many joints were chosen.
        what: what the values are, for the message.

    Raises:
        RequestError: the length fits neither, or the values are no numbers.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise RequestError(f"{what} must be numbers; send one per joint") from None
    if array.shape == (count,):
        return array
    if array.ndim == 0:
        return np.full(count, float(array))
    raise RequestError(
        f"{array.size} {what} for {count} joint{'s' if count != 1 else ''}; "
        "send one value per named joint"
    )

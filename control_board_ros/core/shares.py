# SPDX-License-Identifier: Apache-2.0
"""A request over several boards, shared out among them, and their answers put together (R3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np

from ..protocols import Floats
from .board import Board
from .reply import Answer, Reply, decided
from .selection import REMEMBERED, Selection
from .state import Indices

T = TypeVar("T")
P = ParamSpec("P")


@dataclass(frozen=True, slots=True)
class Share:
    """What a request asks of one board.

    Attributes: board, joints (numbers on the board, in the order asked), places (where they stand
    in the request, shape (k,)).
    """

    board: Board
    joints: list[int]
    places: Indices

    @property
    def selection(self) -> Selection:
        """Its joints as the board's own methods take them."""
        return self.board.selector.select(self.joints)

    def of(self, values: Floats | None) -> Floats | None:
        """What of a request's values, shape (k,), is the board's."""
        return None if values is None else values[self.places]


class Shares:
    """Shares requests out among boards, whose joints follow each other in their order."""

    def __init__(self, boards: Sequence[Board]) -> None:
        self._boards = tuple(boards)
        self._owner = np.repeat(np.arange(len(boards)), [board.count for board in boards])
        self._local = np.concatenate([np.arange(board.count) for board in boards])
        self._known: dict[bytes, list[Share]] = {}

    def of(self, selection: Selection) -> list[Share]:
        """The shares of the boards that a request concerns; joints are numbered over all."""
        key = selection.joints.tobytes()
        found = self._known.get(key)
        if found is None:
            owners = self._owner[selection.joints]
            found = []
            for b, board in enumerate(self._boards):
                places = np.flatnonzero(owners == b)
                if places.size:
                    local = self._local[selection.joints[places]]
                    found.append(Share(board, local.tolist(), places))
            if len(self._known) < REMEMBERED:
                self._known[key] = found
        return found

    def ask(self, selection: Selection, ask: Callable[[Share], Reply]) -> Reply:
        """Ask each board its share; one reply, joint by joint in the order asked.

        The request is valid as a whole, so that no board refuses its share as a whole.
        """
        verdicts = [(Answer.ACCEPTED, "")] * len(selection.names)
        for share in self.of(selection):
            reply = ask(share)
            reasons = reply.reasons or ("",) * len(reply.answers)
            for place, answer, reason in zip(
                share.places.tolist(), reply.answers, reasons, strict=True
            ):
                verdicts[place] = answer, reason
        return decided(selection.names, verdicts)

    def read(self, selection: Selection, read: Callable[[Share], Sequence[T]]) -> list[T]:
        """What each board says of its share, one value per joint in the order asked."""
        found: dict[int, T] = {}
        for share in self.of(selection):
            found |= zip(share.places.tolist(), read(share), strict=True)
        return [found[place] for place in range(len(selection.names))]

    def floats(self, selection: Selection, read: Callable[[Share], Floats]) -> Floats:
        """As :meth:`read`, for arrays of shape (k,)."""
        values = np.empty(len(selection.names))
        for share in self.of(selection):
            values[share.places] = read(share)
        return values


def values_of(
    read: Callable[Concatenate[Any, P], list[T]],
) -> Callable[Concatenate[Any, P], list[T]]:
    """A get method of a board, as one of what has ``shares`` of several: a value per joint."""
    method: Callable[Concatenate[Any, P], list[T]] = _shared(read, Shares.read)
    return method


def floats_of(
    read: Callable[Concatenate[Any, P], Floats],
) -> Callable[Concatenate[Any, P], Floats]:
    """As :func:`values_of`, for arrays of shape (k,)."""
    method: Callable[Concatenate[Any, P], Floats] = _shared(read, Shares.floats)
    return method


def _shared(read: Any, join: Any) -> Any:
    @wraps(read)
    def method(self: Any, joints: Any = None) -> Any:
        return join(
            self.shares,
            self.selector.select(joints),
            lambda share: read(share.board, share.joints),
        )

    return method


def reasons_of(reasons: Mapping[int, str] | None, columns: slice) -> Mapping[int, str] | None:
    """The reasons of a part, whose joints are these columns, by the part's own numbers."""
    if not reasons:
        return None
    return {j - columns.start: reasons[j] for j in reasons if columns.start <= j < columns.stop}

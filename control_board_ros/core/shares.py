# SPDX-License-Identifier: Apache-2.0
"""A request over several boards, shared out among them, and their answers put together (R3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ..protocols import Floats
from .board import Board
from .reply import Answer, Reply, decided
from .selection import REMEMBERED, Selection
from .state import Indices

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Share:
    """What a request asks of one board.

    Attributes: board, joints (numbers on the board, in the order asked), places (where they stand
    in the request, shape (k,)).
    """

    board: Board
    joints: list[int]
    places: Indices


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

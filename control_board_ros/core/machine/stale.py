# SPDX-License-Identifier: Apache-2.0
"""Streams that outlived a fault, or a stop by a contact, do not act (SPEC F8, X2).

A program that repeats references does not know of a fault. After the recovery the joint is
elsewhere, and the next reference would move it at once. Therefore a stream whose references go on
over a fault is void, until

- one position lies within NEAR of the joint,
- or no reference came for PAUSE,
- or a mode was requested after the recovery.

One that goes on over a contact would drive the joint on into it: it is void until the last two.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..config.config import BoardConfig
from ..state import Indices, StateArrays
from ..terms.arguments import Array
from ..terms.reply import Reason
from ..terms.vocabs import CommandKind

#: Time without a reference after which the next one begins a stream, s.
PAUSE = 0.5
#: A position this close to the joint takes it up where it is, rad or m.
NEAR_ANGLE, NEAR_DISTANCE = 0.05, 5e-3
#: References of a stream at least; one before a fault and one after it are none.
MIN_STREAM = 2
#: The kinds that name a place.
POSITIONS = frozenset({CommandKind.POSITION, CommandKind.POSITION_DIRECT})


class StaleStreams:
    """Which joints receive a stream that outlived their fault: of references, or of feed-forwards.

    Args:
        config: Of the board.
        state: Its positions and time.
    """

    def __init__(self, config: BoardConfig, state: StateArrays) -> None:
        self._state = state
        self._near = np.array(
            [joint.kind.choose(NEAR_ANGLE, NEAR_DISTANCE) for joint in config.joints]
        )
        self._last = np.full(state.n, -np.inf)  # time of the last reference, s
        self._count = np.zeros(state.n, dtype=np.intp)  # references without a pause
        self._void: dict[int, Reason] = {}  # joints whose stream is void, and why

    def note(self, joints: Indices) -> None:
        """Record references of joints."""
        time = self._state.time
        goes_on = time - self._last[joints] < PAUSE
        self._count[joints] = np.where(goes_on, self._count[joints] + 1, 1)
        self._last[joints] = time

    def cut(self, j: int, reason: Reason = Reason.STALE) -> None:
        """Void the stream of a joint."""
        self._void[j] = reason

    def forget(self, joints: Iterable[int]) -> None:
        """Accept the next reference of joints, whatever came before."""
        for j in joints:
            self._void.pop(j, None)

    def void(
        self,
        kind: CommandKind | None,
        joints: Indices,
        values: Array,
        accepted: NDArray[np.bool_] | Sequence[bool],
    ) -> list[Reason] | None:
        """Why references that the modes of joints accept belong to a void stream, one per joint.

        None: no one does. References without one are noted as the joint's first.

        Args:
            kind: Of the references; None: feed-forwards.
            joints: Shape (k,).
            values: Likewise.
            accepted: By their modes, likewise.
        """
        if self._void.keys().isdisjoint(joints.tolist()):
            return None
        reasons = [Reason.NONE] * len(joints)
        for k, j in enumerate(joints.tolist()):
            if j in self._void and accepted[k]:
                if self._outlived(j) and not self._meets(kind, j, float(values[k])):
                    reasons[k] = self._void[j]
                else:
                    del self._void[j]
        return reasons

    def _outlived(self, j: int) -> bool:
        """Whether references of a joint have come without a pause."""
        return bool(self._count[j] >= MIN_STREAM and self._state.time - self._last[j] < PAUSE)

    def _meets(self, kind: CommandKind | None, j: int, value: float) -> bool:
        """Whether a position takes a joint up where it is."""
        near = kind in POSITIONS and abs(value - self._state.position[j]) <= self._near[j]
        return bool(near and self._void[j] is Reason.STALE)

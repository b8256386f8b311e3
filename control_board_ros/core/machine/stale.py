# SPDX-License-Identifier: Apache-2.0
"""Streams that outlived a fault do not act (SPEC F8).

A program that repeats references does not know of a fault. After the recovery the joint is
elsewhere, and the next reference would move it at once. Therefore a stream whose references go on
over a fault is void, until

- one position lies within NEAR of the joint,
- or no reference came for PAUSE,
- or a mode was requested after the recovery.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..config.config import BoardConfig
from ..state import Indices, StateArrays
from ..terms.arguments import Array
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
    """Which joints receive a stream that outlived their fault.

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
        self._void: set[int] = set()  # joints that have been in fault since

    def note(self, joints: Indices) -> None:
        """Record references of joints."""
        time = self._state.time
        goes_on = time - self._last[joints] < PAUSE
        self._count[joints] = np.where(goes_on, self._count[joints] + 1, 1)
        self._last[joints] = time

    def on_fault(self, j: int) -> None:
        """Void the stream of a joint that faults."""
        self._void.add(j)

    def forget(self, joints: Iterable[int]) -> None:
        """Accept the next reference of joints, whatever came before."""
        self._void.difference_update(joints)

    def void(
        self, kind: CommandKind, joints: Indices, values: Array, accepted: NDArray[np.bool_]
    ) -> NDArray[np.bool_] | None:
        """Which references that the modes of joints accept belong to a void stream, shape (k,).

        None: no one does. References without one are noted as the joint's first.
        """
        if self._void.isdisjoint(joints.tolist()):
            return None
        stale = np.zeros(len(joints), dtype=np.bool_)
        for k, j in enumerate(joints.tolist()):
            if j in self._void and accepted[k]:
                stale[k] = self._outlived(j) and not self._meets(kind, j, float(values[k]))
                if not stale[k]:
                    self._void.discard(j)
        return stale

    def _outlived(self, j: int) -> bool:
        """Whether references of a joint have come without a pause."""
        return bool(self._count[j] >= MIN_STREAM and self._state.time - self._last[j] < PAUSE)

    def _meets(self, kind: CommandKind, j: int, value: float) -> bool:
        """Whether a position takes a joint up where it is."""
        return kind in POSITIONS and abs(value - self._state.position[j]) <= self._near[j]

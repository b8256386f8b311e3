# SPDX-License-Identifier: Apache-2.0
"""When references expire (SPEC P12), counted in control cycles."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..state import Indices
from ..terms.measurement import Array
from ..terms.vocabs import CommandKind


class ReferenceTimeouts:
    """The deadline of each joint's last reference of a kind that expires.

    Args:
        cycles: how long each kind lasts, cycles, shape (kinds, n); infinite where it never
            expires.
    """

    def __init__(self, cycles: Array) -> None:
        n = cycles.shape[1]
        self._cycles = cycles
        self._renewed = np.zeros(n)  # cycle of the last reference that expires …
        self._kind = np.full(n, -1)  # … and its kind; -1: none
        self._deadline = np.full(n, np.inf)
        self._next = math.inf
        self._running: set[int] = set()  # joints with a reference of any kind

    def reconfigure(self, cycles: Array) -> None:
        """Take new durations, also for the references that run."""
        self._cycles = cycles
        for j in np.flatnonzero(self._kind >= 0):
            self._deadline[j] = self._renewed[j] + cycles[self._kind[j], j]
        self._next = float(self._deadline.min())

    def renew(self, kind: CommandKind, joints: Indices, cycle: int) -> None:
        """Let the timeouts of a kind run from this cycle."""
        self._running.update(joints.tolist())
        self._renewed[joints], self._kind[joints] = cycle, kind
        self._deadline[joints] = cycle + self._cycles[kind, joints]
        self._next = float(self._deadline.min())

    def cancel(self, joints: Sequence[int]) -> None:
        """Let no reference of these joints expire."""
        if self._running.isdisjoint(joints):
            return
        self._running.difference_update(joints)
        self._deadline[joints], self._kind[joints] = np.inf, -1
        self._next = float(self._deadline.min())

    def expired(self, cycle: int) -> NDArray[np.intp] | None:
        """The joints whose reference ran out in this cycle, or None."""
        if cycle < self._next:
            return None
        late = np.flatnonzero(self._deadline <= cycle)
        self.cancel(late.tolist())
        return late

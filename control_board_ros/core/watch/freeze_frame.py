# SPDX-License-Identifier: Apache-2.0
"""Freeze frames: readings and references around each joint's last fault (E3).

Plain Python in Cython's pure mode, as the laws are: every cycle is kept.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ... import nocython as cython
from ..state import BLOCK_ROWS, StateArrays

#: Time that is kept of a fault, s: before it, and after it.
BEFORE, AFTER = 1.5, 0.5

Floats32 = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class FreezeFrame:
    """The cycles around a fault of one joint.

    Attributes: stamps (s, of the readings, shape (k,)), block (rows of the state block, ``Row``
    and ``Reference``, shape (k, rows)), done (no position move under way, shape (k,)).
    """

    stamps: NDArray[np.float64]
    block: Floats32
    done: NDArray[np.bool_]


@cython.cclass
class FreezeFrames:
    """Keeps the last cycles of all joints, and the frame of each joint's last fault.

    A frame is cut out of the ring in the cycle in which it is complete, one joint per cycle; the
    ring is longer by a cycle per joint for it. Single precision: 10 MB at 32 joints and 1 kHz.

    Args:
        state: of the board.
        period: of control, s.
    """

    _state: StateArrays
    _after: cython.Py_ssize_t
    _length: cython.Py_ssize_t
    _size: cython.Py_ssize_t
    _cycles: cython.Py_ssize_t
    _block: Floats32
    _done: NDArray[np.bool_]
    _stamps: NDArray[np.float64]
    _due: deque[tuple[int, int]]  # cycle, joint
    _frames: dict[int, FreezeFrame]
    # views of the arrays above, and of the state
    ring: cython.float[:, :, ::1]
    ring_done: cython.uchar[:, ::1]
    ring_stamps: cython.double[::1]
    block: cython.double[:, ::1]
    done: cython.uchar[::1]

    def __init__(self, state: StateArrays, period: float) -> None:
        self._state = state
        self._after = round(AFTER / period)
        self._length = round((BEFORE + AFTER) / period)
        self._size = self._length + state.n
        self._block = np.zeros((self._size, BLOCK_ROWS, state.n), dtype=np.float32)
        self._done = np.zeros((self._size, state.n), dtype=np.bool_)
        self._stamps = np.zeros(self._size)
        self.ring, self.ring_stamps = self._block, self._stamps
        self.ring_done = self._done.view(np.uint8)
        self.block, self.done = state.block, state.done.view(np.uint8)
        self._cycles = 0
        self._due = deque()
        self._frames = {}

    @property
    def size(self) -> int:
        """Memory of the ring, bytes."""
        kept = [self._block, self._done, self._stamps]
        for frame in self._frames.values():
            kept += [frame.stamps, frame.block, frame.done]
        return sum(array.nbytes for array in kept)

    def note(self) -> None:
        """Keep the cycle that ends; cut out a frame that is complete."""
        row: cython.Py_ssize_t
        place = self._cycles % self._size
        for row in range(BLOCK_ROWS):
            for k in range(len(self.done)):
                self.ring[place, row, k] = self.block[row, k]
        for k in range(len(self.done)):
            self.ring_done[place, k] = self.done[k]
        self.ring_stamps[place] = self._state.time
        self._cycles += 1
        if self._due and self._due[0][0] <= self._cycles:
            end, j = self._due.popleft()
            self._frames[j] = self._cut(j, end)

    def fault(self, j: int) -> None:
        """Keep the cycles around the present one, in which a joint has faulted."""
        self._frames.pop(j, None)
        self._due = deque(due for due in self._due if due[1] != j)
        self._due.append((self._cycles + self._after, j))

    def of(self, j: int) -> FreezeFrame | None:
        """The frame of a joint's last fault, up to the present cycle; None: no fault yet."""
        if j in self._frames:
            return self._frames[j]
        end = next((end for end, joint in self._due if joint == j), None)
        return None if end is None else self._cut(j, min(end, self._cycles))

    def _cut(self, j: int, end: int) -> FreezeFrame:
        """The cycles of a joint before one of them."""
        first = max(0, end - self._length)
        places = np.arange(first, end) % self._size
        return FreezeFrame(self._stamps[places], self._block[places, :, j], self._done[places, j])

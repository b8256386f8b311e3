# SPDX-License-Identifier: Apache-2.0
"""A lock that passes to the waiting thread, and the joints while it is held."""

from __future__ import annotations

import threading
from collections.abc import Callable

from ...core.group import JointGroup


class FairLock:
    """A lock that its last holder cannot acquire again while another thread waits.

    A plain lock of Python goes to the thread that asks first after its release, which is the one
    that released it when that runs on: a control loop that runs as fast as it can would shut all
    others out. Here the thread that waits holds the gate, and the next one waits at the gate.
    """

    __slots__ = ("_gate", "_lock")

    def __init__(self) -> None:
        self._gate, self._lock = threading.Lock(), threading.Lock()

    def acquire(self) -> None:
        with self._gate:
            self._lock.acquire()

    def release(self) -> None:
        self._lock.release()

    def __enter__(self) -> None:
        self.acquire()

    def __exit__(self, *_error: object) -> None:
        self._lock.release()


class Exclusive:
    """Context manager of :meth:`Member.exclusive`: a group of joints while the lock is held.

    A class, as a generator would cost each request and command 1 µs more.
    """

    __slots__ = ("_board", "_end", "_lock")

    def __init__(self, lock: FairLock, board: JointGroup, end: Callable[[], None]) -> None:
        self._lock, self._board, self._end = lock, board, end

    def __enter__(self) -> JointGroup:
        self._lock.acquire()
        return self._board

    def __exit__(self, *_error: object) -> None:
        try:
            self._end()
        finally:
            self._lock.release()

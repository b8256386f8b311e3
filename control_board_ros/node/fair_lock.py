# SPDX-License-Identifier: Apache-2.0
"""A lock that whoever waits for it gets next."""

from __future__ import annotations

import threading


class FairLock:
    """A lock that its last holder cannot take again while others wait.

    A plain lock of Python goes to whoever asks first after its release, which is the thread that
    released it, when this one runs on: a control loop that runs as fast as it can would shut
    everybody else out. Here whoever waits holds the gate, and the next one waits at the gate.
    """

    __slots__ = ("_gate", "_lock")

    def __init__(self) -> None:
        self._gate, self._lock = threading.Lock(), threading.Lock()

    def __enter__(self) -> None:
        with self._gate:
            self._lock.acquire()

    def __exit__(self, *_error: object) -> None:
        self._lock.release()

# SPDX-License-Identifier: Apache-2.0
"""Writing in a thread of its own: a slow disk, or a long recording, delays no reception."""

from __future__ import annotations

import queue
import threading
from collections.abc import Mapping
from typing import Protocol

from .errors import RecordingError
from .topics import Topic

#: Maximum bytes that wait for the disk; beyond them messages are left out.
MAX_WAITING_BYTES = 256_000_000
#: s without a message after which the sink is synced all the same.
PATIENCE = 0.25


class Sink(Protocol):
    """Where messages go. All but ``begin`` raise RecordingError where the disk is full."""

    def begin(self, latched: Mapping[Topic, bytes], /) -> None: ...
    def write(self, topic: Topic, stamp: int, data: bytes, /) -> None: ...
    def sync(self) -> None: ...
    def close(self) -> None: ...


class Writing:
    """Passes messages to a sink, in order, in a thread.

    Args:
        sink: Of the messages; used by the thread only, from ``begin`` to ``close``.

    Attributes:
        left_out: Messages for which there was no room.
    """

    def __init__(self, sink: Sink, max_waiting: int = MAX_WAITING_BYTES) -> None:
        self._sink, self._max_waiting = sink, max_waiting
        self._messages = queue.SimpleQueue[tuple[Topic, int, bytes] | None]()
        self._put = self._taken = 0  # bytes, each counted by one thread
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="writing")
        self.left_out = 0

    def begin(self, latched: Mapping[Topic, bytes]) -> None:
        self._sink.begin(latched)
        self._thread.start()

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Hand a message over.

        Raises:
            RecordingError: the sink failed earlier.
        """
        self._check()
        if self._put - self._taken > self._max_waiting:
            self.left_out += 1
            return
        self._put += len(data)
        self._messages.put((topic, stamp, data))

    def close(self) -> None:
        """Write what waits, and finish the sink.

        Raises:
            RecordingError: it fails, or did so earlier.
        """
        self._messages.put(None)
        self._thread.join()
        self._check()

    def _check(self) -> None:
        if self._error is not None:
            if isinstance(self._error, RecordingError):
                raise self._error
            raise RecordingError(f"{type(self._error).__name__}: {self._error}") from self._error

    def _run(self) -> None:
        for work in (self._pass_on, self._sink.close):
            try:
                work()
            except Exception as error:  # noqa: BLE001  (raised by the next call)
                self._error = self._error or error

    def _pass_on(self) -> None:
        """Write until the end."""
        while True:
            try:
                message = self._messages.get(timeout=PATIENCE)
            except queue.Empty:
                self._sink.sync()
                continue
            if message is None:
                return
            self._taken += len(message[2])
            self._sink.write(*message)
            self._sink.sync()

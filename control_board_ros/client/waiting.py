# SPDX-License-Identifier: Apache-2.0
"""What an operation awaits: an event from the board, for a thread, asyncio, or rclpy."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable, Generator
from typing import Protocol


class Event(Protocol):
    """What a coroutine of the client awaits; its driver blocks, or waits in the user's task."""

    def block(self) -> None: ...

    async def wait(self, wake: Callable[[], None], /) -> None: ...


class Wait:
    """An event completed by the link's thread: done, timed out, or failed.

    Args:
        timeout: s; None: unlimited.
        condition: polled by the link's thread; true finishes the wait.
    """

    def __init__(self, timeout: float | None, condition: Callable[[], bool] | None = None) -> None:
        self.deadline = None if timeout is None else time.monotonic() + timeout
        self.condition = condition
        self.done = False
        self._error: Exception | None = None
        self._finished = threading.Event()
        self._lock = threading.Lock()
        self._callbacks: list[Callable[[], None]] = []

    @property
    def finished(self) -> bool:
        return self._finished.is_set()

    def finish(self, *, done: bool = True, error: Exception | None = None) -> None:
        """End the wait; the first call counts. ``error``: why it failed."""
        with self._lock:
            if self._finished.is_set():
                return
            self.done, self._error = done, error
            self._finished.set()
            callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback()

    def look(self, now: float) -> None:
        """Finish it on its condition or deadline; ``now`` is monotonic, s."""
        try:
            met = self.condition is not None and self.condition()
        except Exception as error:  # noqa: BLE001  (raised in the waiting call)
            self.finish(done=False, error=error)
            return
        if met:
            self.finish()
        elif self.deadline is not None and now >= self.deadline:
            self.finish(done=False)

    def block(self) -> None:
        self._finished.wait()

    def __await__(self) -> Generator[Wait, None, bool]:
        """Wait by the driver; true if done, false on timeout.

        Raises:
            Exception: the error passed to finish.
        """
        yield self
        if self._error is not None:
            raise self._error
        return self.done

    def on_finish(self, callback: Callable[[], None]) -> None:
        """Call back from the link's thread, or immediately if finished."""
        with self._lock:
            if not self._finished.is_set():
                self._callbacks.append(callback)
                return
        callback()

    async def wait(self, wake: Callable[[], None]) -> None:
        """Wait in this coroutine; ``wake`` wakes an rclpy executor."""
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            self.on_finish(wake)
            while not self.finished:
                await _Resume()
            return
        future = loop.create_future()

        def settle() -> None:
            if not future.done():
                future.set_result(None)

        def settle_there() -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(settle)

        self.on_finish(settle_there)
        await future


class _Resume:
    """Suspends a coroutine until its rclpy executor is woken."""

    def __await__(self) -> Generator[None, None, None]:
        yield

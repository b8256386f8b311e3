# SPDX-License-Identifier: Apache-2.0
"""One code for the blocking and the awaitable form of every method.

A method of the client is written as a generator that yields a :class:`Wait` wherever something
must come from the board. :func:`operation` makes the blocking form of it, :class:`Aio` the
awaitable one, which runs under asyncio and in callbacks of an rclpy executor alike.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable, Coroutine, Generator
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

from .errors import BoardError

R = TypeVar("R")
P = ParamSpec("P")
Self = TypeVar("Self")


class Wait:
    """Something that the link's thread will finish: done, timed out, or closed.

    Args:
        timeout: s until it counts as timed out; None: never.
        condition: asked again and again by the link's thread; true finishes the wait.
    """

    def __init__(self, timeout: float | None, condition: Callable[[], bool] | None = None) -> None:
        self.deadline = None if timeout is None else time.monotonic() + timeout
        self.condition = condition
        self.done = False
        self._closed = ""
        self._finished = threading.Event()
        self._lock = threading.Lock()
        self._callbacks: list[Callable[[], None]] = []

    @property
    def finished(self) -> bool:
        return self._finished.is_set()

    def finish(self, *, done: bool = True, closed: str = "") -> None:
        """End the wait; the first call counts. ``closed`` says why nothing can come any more."""
        with self._lock:
            if self._finished.is_set():
                return
            self.done, self._closed = done, closed
            self._finished.set()
            callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback()

    def block(self) -> None:
        """Wait in this thread."""
        self._finished.wait()

    def check(self) -> None:
        """Raise BoardError when the wait ended because the link was closed."""
        if self._closed:
            raise BoardError(self._closed)

    def on_finish(self, callback: Callable[[], None]) -> None:
        """Call back from the link's thread, or at once when it is finished already."""
        with self._lock:
            if not self._finished.is_set():
                self._callbacks.append(callback)
                return
        callback()

    async def wait(self, wake: Callable[[], None]) -> None:
        """Wait in this coroutine; ``wake`` makes an rclpy executor look at it again."""
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
            with contextlib.suppress(RuntimeError):  # the loop has ended: nobody waits there
                loop.call_soon_threadsafe(settle)

        self.on_finish(settle_there)
        await future


class _Resume:
    """Gives control back to an rclpy executor until it is woken."""

    def __await__(self) -> Generator[None, None, None]:
        yield


Steps = Generator[Wait, None, R]


def run(steps: Steps[R]) -> R:
    """The blocking form: wait in this thread at every step."""
    try:
        wait = next(steps)
        while True:
            try:
                wait.block()
                wait.check()
            except BaseException as error:  # noqa: BLE001  (handed on, not kept)
                wait = steps.throw(error)  # Ctrl-C too: a move then cancels its goal
            else:
                wait = steps.send(None)
    except StopIteration as stop:
        result: R = stop.value
        return result


async def run_async(steps: Steps[R], wake: Callable[[], None]) -> R:
    """The awaitable form: wait in this coroutine at every step."""
    try:
        wait = next(steps)
        while True:
            try:
                await wait.wait(wake)
                wait.check()
            except BaseException as error:  # noqa: BLE001  (handed on, not kept)
                wait = steps.throw(error)
            else:
                wait = steps.send(None)
    except StopIteration as stop:
        result: R = stop.value
        return result


def operation(
    steps: Callable[Concatenate[Self, P], Steps[R]],
) -> Callable[Concatenate[Self, P], R]:
    """Make a method that blocks out of one that yields; ``client.aio`` finds the steps."""

    @wraps(steps)
    def method(self: Self, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return run(steps(self, *args, **kwargs))

    method.steps = steps  # type: ignore[attr-defined]
    return method


class Aio:
    """The awaitable form of a client's methods: ``await client.aio.set_control_mode(…)``."""

    def __init__(self, client: Any, wake: Callable[[], None]) -> None:
        self._client, self._wake = client, wake

    def __getattr__(self, name: str) -> Callable[..., Coroutine[Any, Any, Any]]:
        steps = getattr(getattr(type(self._client), name, None), "steps", None)
        if steps is None:
            raise AttributeError(f"{name} has no awaitable form; see dir(client.aio)")

        async def form(*args: Any, **kwargs: Any) -> Any:
            return await run_async(steps(self._client, *args, **kwargs), self._wake)

        form.__name__, form.__doc__ = name, steps.__doc__
        return form

    def __dir__(self) -> list[str]:
        kind = type(self._client)
        return [name for name in dir(kind) if hasattr(getattr(kind, name), "steps")]

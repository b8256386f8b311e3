# SPDX-License-Identifier: Apache-2.0
"""The thread that serves the client's hidden node and completes waits."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle, NotInitializedException
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from .errors import BoardError
from .waiting import Wait

POLL_PERIOD = 0.002  # s between polls of states without an rclpy event: matching
#: Raised by rclpy for destroyed entities and contexts that were shut down.
GONE = (InvalidHandle, NotInitializedException, rclpy_implementation.RCLError)
ERROR_PAUSE = 0.01  # s after an error: limits the load of a persistent one


def hidden_node(name: str, context: Context, namespace: str | None = None) -> Node:
    """A node without the program's arguments, log topic and parameter services."""
    return Node(
        name,
        context=context,
        namespace=namespace,
        use_global_arguments=False,
        enable_rosout=False,
        start_parameter_services=False,
    )


class ExecutorThread:
    """Processes messages and answers, and completes waits; survives errors of rclpy.

    Args:
        node: the hidden node.
        report: called with an exception that lost a message.

    Attributes: closed (reason for the end; empty while it runs).
    """

    def __init__(self, node: Node, report: Callable[[Exception], None]) -> None:
        self.closed = ""
        self._report = report
        self._context = node.context
        self._waits: list[Wait] = []
        self._lock = threading.Lock()
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._serve, name="board client", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread; calls that wait raise BoardError."""
        self.closed = self.closed or "the client was closed"
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            with contextlib.suppress(*GONE):  # the thread then ends by itself
                self._wake()
            self._thread.join(timeout=5.0)
        self._executor.shutdown(timeout_sec=1.0)

    # Inside the thread

    def _serve(self) -> None:
        try:
            while not self.closed:
                self._serve_once()
        except (ExternalShutdownException, ShutdownException):
            self.closed = self.closed or "the rclpy context was shut down; make a new client"
        finally:
            self.closed = self.closed or "the client's thread ended; make a new client"
            with self._lock:
                waits, self._waits = self._waits, []
            for wait in waits:
                wait.finish(done=False, error=BoardError(self.closed))

    def _serve_once(self) -> None:
        try:
            self._executor.spin_once(timeout_sec=self._patience())
        except (ExternalShutdownException, ShutdownException):
            raise
        except Exception as error:
            if not self._context.ok():
                raise ExternalShutdownException from error
            if not self.closed:
                self._report(error)
                time.sleep(ERROR_PAUSE)
        self._finish_due()

    def _patience(self) -> float | None:
        """Time until the next poll or deadline, s."""
        with self._lock:
            if any(wait.condition for wait in self._waits):
                return POLL_PERIOD
            deadlines = [wait.deadline for wait in self._waits if wait.deadline is not None]
        return max(min(deadlines) - time.monotonic(), 0.0) + 1e-4 if deadlines else None

    def _finish_due(self) -> None:
        now = time.monotonic()
        with self._lock:
            waits = list(self._waits)
        for wait in waits:
            wait.look(now)
        with self._lock:
            self._waits = [wait for wait in self._waits if not wait.finished]

    def _wake(self) -> None:
        self._executor.create_task(lambda: None)  # spin_once returns only after work

    # For other threads

    def wait(self, timeout: float | None, condition: Callable[[], bool] | None = None) -> Wait:
        """A wait, finished by this thread.

        Raises:
            BoardError: the thread has ended.
        """
        wait = Wait(timeout, condition)
        with self._lock:
            closed = self.closed
            if not closed:
                self._waits.append(wait)
        if closed:
            raise BoardError(closed)
        self._wake()
        return wait

    async def until(self, condition: Callable[[], bool], timeout: float | None) -> bool:
        """Wait until the condition holds; false on timeout."""
        if condition():
            return True
        return await self.wait(timeout, condition)

    async def outcome(self, future: Any, timeout: float | None) -> bool:
        """Wait for an rclpy future; false on timeout."""
        if not future.done():
            wait = self.wait(timeout)
            future.add_done_callback(lambda _: wait.finish())
            await wait
        return bool(future.done())

    def later(self, function: Callable[[], Any]) -> Any:
        """Run a function in this thread; returns its future.

        Requests of actions use it: rclpy drops an answer processed before the requesting thread
        has stored the request. Its service clients hold a lock for that.

        Raises:
            BoardError: the thread has ended.
        """
        if self.closed:
            raise BoardError(self.closed)
        return self._executor.create_task(function)

    async def run(self, function: Callable[[], Any]) -> Any:
        """Run a function in this thread; returns its result."""
        task = self.later(function)
        await self.outcome(task, None)
        return task.result()

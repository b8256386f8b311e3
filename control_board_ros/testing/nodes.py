# SPDX-License-Identifier: Apache-2.0
"""Nodes for tests, each with its own rclpy context."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator
from typing import Any

from ..startup import announce_often
from .domains import DISCOVERY


@contextlib.contextmanager
def ros_node(
    domain: int, name: str = "test_node", *, namespace: str = "", spin: bool = True
) -> Iterator[Any]:
    """A node on this domain, spinning in its own thread.

    With ``spin=False`` it is not spun. The rclpy context is separate: several can be used in one
    process, sequentially or in parallel.
    """
    from rclpy.context import Context
    from rclpy.exceptions import InvalidHandle
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.node import Node

    announce_often()
    context = Context()
    with _localhost_only():  # read once, at the creation of the context
        context.init(args=[], domain_id=domain)
    node = Node(name, namespace=namespace or None, context=context, use_global_arguments=False)
    executor = SingleThreadedExecutor(context=context)
    thread: threading.Thread | None = None
    ended = threading.Event()

    def run() -> None:
        with contextlib.suppress(ExternalShutdownException):
            while not ended.is_set():
                with contextlib.suppress(InvalidHandle):  # destroyed by the test
                    executor.spin_once()

    try:
        if spin:
            executor.add_node(node)
            thread = threading.Thread(target=run, name=f"spin {name}", daemon=True)
            thread.start()
        yield node
    finally:
        ended.set()
        if thread is not None:
            executor.create_task(lambda: None)  # spin_once returns only after work
            thread.join(timeout=5.0)
        executor.shutdown(timeout_sec=5.0)
        node.destroy_node()
        context.try_shutdown()


@contextlib.contextmanager
def _localhost_only() -> Iterator[None]:
    before = os.environ.get(DISCOVERY)
    os.environ[DISCOVERY] = "LOCALHOST"
    try:
        yield
    finally:
        if before is None:
            del os.environ[DISCOVERY]
        else:
            os.environ[DISCOVERY] = before

# SPDX-License-Identifier: Apache-2.0
"""Nodes for tests, each with an rclpy context of its own."""

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
    """A node on this domain, spinning in a thread of its own.

    With ``spin=False`` nothing spins it. The rclpy context is its own too, so that many can be
    used in one process, one after the other or at the same time.
    """
    from rclpy.context import Context
    from rclpy.exceptions import InvalidHandle
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.node import Node

    announce_often()
    context = Context()
    with _localhost_only():  # read once, when the context is made
        context.init(args=[], domain_id=domain)
    node = Node(name, namespace=namespace or None, context=context, use_global_arguments=False)
    executor = SingleThreadedExecutor(context=context)
    thread: threading.Thread | None = None
    ended = threading.Event()

    def run() -> None:
        with contextlib.suppress(ExternalShutdownException):
            while not ended.is_set():
                with contextlib.suppress(InvalidHandle):  # destroyed by the test meanwhile
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
            executor.create_task(lambda: None)  # only work makes spin_once return
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

# SPDX-License-Identifier: Apache-2.0
"""A response that is no message is answered all the same: nobody waits indefinitely."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest
from rcl_interfaces.srv import ListParameters
from rclpy.node import Node
from std_srvs.srv import Trigger

from control_board_ros.node.process.executor import KeptWaitSetExecutor
from control_board_ros.testing import free_domain, ros_node

pytestmark = pytest.mark.ros
NO_TEXT = "voltage \ud800"


class Serving:
    """A node with services that answer what cannot be sent."""

    def __init__(self, node: Node) -> None:
        self.errors: list[str] = []
        self.executor = KeptWaitSetExecutor(
            lambda error, name: self.errors.append(f"{name}: {error}"), context=node.context
        )
        node.create_service(Trigger, "at_once", self.answer)
        node.create_service(Trigger, "later", self.answer_later)
        node.create_service(ListParameters, "without_success", self.list)
        self.executor.add_node(node)
        self.thread = threading.Thread(target=self.executor.spin, daemon=True)
        self.thread.start()

    def answer(self, _request: Any, response: Any) -> Any:
        response.success, response.message = True, NO_TEXT
        return response

    async def answer_later(self, request: Any, response: Any) -> Any:
        return self.answer(request, response)

    def list(self, _request: Any, response: Any) -> Any:
        response.result.names = ["good", NO_TEXT]
        return response


@pytest.fixture
def serving() -> Iterator[tuple[Serving, Node]]:
    with free_domain() as domain, ros_node(domain, spin=False) as node, ros_node(domain) as peer:
        made = Serving(node)
        yield made, peer
        made.executor.end()
        made.thread.join()


@pytest.mark.parametrize("name", ["at_once", "later", "without_success"])
def test_an_answer_that_cannot_be_sent(serving: tuple[Serving, Node], name: str) -> None:
    """It says so, as a failure where the type knows of one; so does the log."""
    made, peer = serving
    kind = ListParameters if name == "without_success" else Trigger
    client = peer.create_client(kind, name)
    assert client.wait_for_service(30.0)
    future = client.call_async(kind.Request())
    answered = threading.Event()
    future.add_done_callback(lambda _: answered.set())
    assert answered.wait(30.0)
    response = future.result()
    if kind is Trigger:
        assert not response.success
        assert response.message.startswith(f"the answer of /{name} is no message: Unicode")
    else:
        assert list(response.result.names) == []
    assert name in made.errors[0]

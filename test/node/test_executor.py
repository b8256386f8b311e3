# SPDX-License-Identifier: Apache-2.0
"""The executor: it serves what comes and goes, and answers whatever a callback does."""

from __future__ import annotations

import ast
import inspect
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from rcl_interfaces.srv import ListParameters
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger
from waiting import GUARD, until

from control_board_ros.node.process import executor
from control_board_ros.node.process.executor import KeptWaitSetExecutor
from control_board_ros.testing import free_domain

pytestmark = pytest.mark.ros
NO_TEXT = "voltage \ud800"
#: What the executor takes of rclpy that rclpy documents nowhere.
UNDOCUMENTED = """
WaitSet.clear_entities WaitSet.wait WaitSet.get_ready_entities WaitSet.add_service
WaitSet.add_timer WaitSet.add_client WaitSet.add_guard_condition WaitSet.add_subscription
Service.service_take_request Subscription.take_message Client.take_response
Timer.is_timer_ready Timer.call_timer
Service.pointer Subscription.pointer Client.pointer Timer.pointer GuardCondition.pointer
rmw_service_info_t.source_timestamp rmw_service_info_t.request_id
"""


class Served:
    """A node served by the executor in a thread, and what its callbacks raised."""

    def __init__(self, context: Context, domain: int) -> None:
        context.init(args=[], domain_id=domain)
        self.node = Node("served", context=context, use_global_arguments=False)
        self.errors: list[tuple[str, str]] = []
        self.executor = KeptWaitSetExecutor(
            lambda error, where: self.errors.append((str(error), where)), context=context
        )
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=self.executor.spin, daemon=True)
        self.thread.start()


@pytest.fixture
def served() -> Iterator[Served]:
    with free_domain() as domain:
        context = Context()
        made = Served(context, domain)
        yield made
        made.executor.end()
        made.thread.join(GUARD)
        assert not made.thread.is_alive()
        made.executor.shutdown()
        made.node.destroy_node()
        context.try_shutdown()


def test_rclpy_has_what_it_documents_nowhere() -> None:
    """A later rclpy may have it no more: then the executor needs another way, or rclpy's own."""
    gone = []
    for name in UNDOCUMENTED.split():
        kind, _, attribute = name.partition(".")
        if not hasattr(getattr(rclpy_implementation, kind, None), attribute):
            gone.append(name)
    assert not gone, f"this rclpy lacks {', '.join(gone)}, which {executor.__name__} stands on"


def test_it_uses_no_private_name_of_rclpy() -> None:
    tree = ast.parse(inspect.getsource(executor))
    attributes = [node for node in ast.walk(tree) if isinstance(node, ast.Attribute)]
    private = {a.attr for a in attributes if a.attr.startswith("_") and a.attr[1] != "_"}
    others = {
        a.attr
        for a in attributes
        if a.attr in private and not (isinstance(a.value, ast.Name) and a.value.id == "self")
    }
    assert not others
    context = Context()
    context.init(args=[])
    plain = Executor(context=context)
    try:
        assert len(private) > 10
        assert private & {*vars(plain), *dir(Executor)} == set()
    finally:
        plain.shutdown()
        context.try_shutdown()


def test_it_serves_entities_made_while_it_spins(served: Served) -> None:
    """Services, clients, topics and timers may come and go."""
    received: list[str] = []
    node = served.node
    node.create_subscription(String, "talk", lambda m: received.append(m.data), 10)
    publisher = node.create_publisher(String, "talk", 10)
    timer = node.create_timer(
        0.01,
        lambda: publisher.publish(String(data="tick")),
        clock=Clock(clock_type=ClockType.STEADY_TIME),
    )
    until(lambda: len(received) >= 5)
    node.destroy_timer(timer)
    node.create_service(Trigger, "ask", lambda _, r: Trigger.Response(success=True, message="yes"))
    client = node.create_client(Trigger, "ask")
    assert client.wait_for_service(GUARD)
    future = client.call_async(Trigger.Request())
    until(future.done)
    assert future.result().message == "yes"
    assert not served.errors


def test_it_lives_on_when_callbacks_raise(served: Served) -> None:
    """No callback of any kind ends it, and each is reported with its name."""
    node, received = served.node, []

    def fail(*_: Any) -> Any:
        raise RuntimeError("on purpose")

    def subscribed(message: Any) -> None:
        received.append(message)
        fail()

    node.create_subscription(String, "talk", subscribed, 10)
    node.create_service(Trigger, "ask", fail)
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    timer = node.create_timer(0.05, fail, clock=steady)
    guard = node.create_guard_condition(fail)
    publisher, client = (
        node.create_publisher(String, "talk", 10),
        node.create_client(Trigger, "ask"),
    )
    assert client.wait_for_service(GUARD)
    client.call_async(Trigger.Request())
    guard.trigger()
    until(lambda: publisher.publish(String()) or len(received) >= 3)
    wheres = {"/talk", "/ask", "Timer", "GuardCondition"}
    until(lambda: {where for _, where in served.errors} >= wheres)
    assert {text for text, _ in served.errors} == {"on purpose"}
    node.destroy_timer(timer)


def test_it_answers_later(served: Served) -> None:
    """A service whose callback is a coroutine answers when its future is set, by any thread."""
    asked = Future()

    async def answer(_request: Any, response: Any) -> Any:
        response.message = await asked
        return response

    served.node.create_service(Trigger, "ask", answer)
    client = served.node.create_client(Trigger, "ask")
    assert client.wait_for_service(GUARD)
    future = client.call_async(Trigger.Request())
    time.sleep(0.05)
    assert not future.done()
    served.executor.create_task(lambda: asked.set_result("at last"))
    until(future.done)
    assert future.result().message == "at last"


@pytest.mark.parametrize("name", ["at_once", "later", "without_success"])
def test_an_answer_that_cannot_be_sent(served: Served, name: str) -> None:
    """It says so, as a failure where the type knows of one; so does the log."""

    def answer(_request: Any, response: Any) -> Any:
        response.success, response.message = True, NO_TEXT
        return response

    async def later(request: Any, response: Any) -> Any:
        return answer(request, response)

    def names(_request: Any, response: Any) -> Any:
        response.result.names = ["good", NO_TEXT]
        return response

    kind = ListParameters if name == "without_success" else Trigger
    callback = {"at_once": answer, "later": later, "without_success": names}[name]
    served.node.create_service(kind, name, callback)
    client = served.node.create_client(kind, name)
    assert client.wait_for_service(GUARD)
    future = client.call_async(kind.Request())
    until(future.done)
    response = future.result()
    if kind is Trigger:
        assert not response.success
        assert response.message.startswith(f"the answer of /{name} is no message: Unicode")
    else:
        assert list(response.result.names) == []
    ((_, where),) = served.errors
    assert where == f"/{name}"

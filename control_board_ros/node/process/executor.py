# SPDX-License-Identifier: Apache-2.0
"""A single-threaded executor that keeps its wait set.

rclpy's SingleThreadedExecutor gathers all entities of the node and builds a new wait set for
every single callback, and wakes itself twice for each of them; with the board's 60 entities
that is most of a service's round trip. This one gathers only when entities come or go, serves
everything that a wait found ready, and guards every callback: an exception is reported and the
executor continues.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from contextlib import ExitStack, suppress
from operator import attrgetter
from typing import Any, cast

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.subscription import Subscription
from rclpy.waitable import NumberOfEntities

from ..loop.pulse import Pulse

#: Messages read from one subscription before the others and the services have their turn.
BATCH = 10
HANDLE = attrgetter("handle")


class KeptWaitSetExecutor(SingleThreadedExecutor):
    """Serves one or more nodes from one thread, which calls :meth:`spin`.

    Callback groups are not consulted: with one thread, callbacks exclude each other anyway.

    Args:
        on_error: called with the exception that a callback raised and the entity's name.
        context: the rclpy context; None for the default one.

    Attributes: pulse (of the thread that spins), failure (what ended :meth:`spin`, if anything),
    sent (when the last request was, ns of system time).
    """

    def __init__(
        self,
        on_error: Callable[[Exception, str], None],
        *,
        context: Context | None = None,
    ) -> None:
        self._stale = True
        self._ended = False
        self.sent = 0
        self.pulse = Pulse()
        self.failure: Exception | None = None
        self._on_error = on_error
        self._held = ExitStack()
        self._wait_set: Any = None
        super().__init__(context=context)

    def wake(self) -> None:
        """Entities came or went: gather them before the next wait."""
        self._stale = True
        super().wake()

    def add_node(self, node: Any) -> bool:
        self._stale = True
        return bool(super().add_node(node))

    def remove_node(self, node: Any) -> None:
        self._stale = True
        super().remove_node(node)

    def end(self) -> None:
        """Make spin() return; safe to call from any thread, unlike shutdown() while it spins."""
        self._ended = True
        super().wake()

    def spin(self) -> None:
        """Serve until end() or the end of the context; an error beside the callbacks ends it."""
        try:
            while self._context.ok() and not self._ended:
                self._serve_once()
        except Exception as error:  # noqa: BLE001 - the thread's watch reports it
            self.failure = error
        finally:
            self._held.close()
            self._wait_set = None

    def _serve_once(self) -> None:
        if self._stale:
            self._stale = False
            self._gather()
        with self.pulse:
            self._run_tasks()
        wait_set = self._wait_set
        wait_set.clear_entities()
        for add, handles in self._additions:
            for handle in handles:
                getattr(wait_set, add)(handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        wait_set.wait(-1)
        if self._ended or not self._context.ok():
            return
        with self.pulse:
            self._serve_ready(wait_set)

    def _gather(self) -> None:
        """Hold the handles of all entities and make a wait set of their size."""
        self._held.close()
        nodes = self.get_nodes()

        def held(kind: str) -> dict[int, Any]:
            """By the addresses of their handles."""
            gathered = self._hold([e for node in nodes for e in getattr(node, kind)], HANDLE)
            return {entity.handle.pointer: entity for entity in gathered}

        self._by_kind = [
            ("service", held("services"), self._serve_service),
            ("timer", held("timers"), self._serve_timer),
            ("client", held("clients"), self._serve_client),
            ("guard_condition", held("guards"), self._serve_guard),
            ("subscription", held("subscriptions"), self._serve_subscription),
        ]
        handles = [self._guard.handle, self._sigint_gc.handle]
        for handle in handles:
            self._held.enter_context(handle)
        self._waitables = self._hold([w for n in nodes for w in n.waitables], lambda w: w)
        self._additions = [
            (f"add_{kind}", [entity.handle for entity in entities.values()])
            for kind, entities, _ in self._by_kind
        ]
        self._additions.append(("add_guard_condition", handles))
        services, timers, clients, guards, subscriptions = (len(e) for _, e, _ in self._by_kind)
        size = NumberOfEntities(subscriptions, guards + len(handles), timers, clients, services)
        for waitable in self._waitables:
            size += waitable.get_num_entities()
        self._held.enter_context(cast(Any, self._context.handle))
        self._wait_set = _rclpy.WaitSet(
            size.num_subscriptions,
            size.num_guard_conditions,
            size.num_timers,
            size.num_clients,
            size.num_services,
            size.num_events,
            self._context.handle,
        )

    def _hold(self, entities: list[Any], handle: Callable[[Any], Any]) -> list[Any]:
        """Entities, kept from destruction while waited on."""
        held = []
        for entity in entities:
            with suppress(InvalidHandle):  # since destroyed by another thread
                self._held.enter_context(handle(entity))
                held.append(entity)
        return held

    def _serve_ready(self, wait_set: Any) -> None:
        """Serve what the wait found: services first, then the rest, subscriptions last."""
        ready_waitables = [w for w in self._waitables if w.is_ready(wait_set)]
        for kind, entities, serve in self._by_kind:
            if not entities:
                continue
            for pointer in wait_set.get_ready_entities(kind):
                entity = entities.get(pointer)
                if entity is not None:
                    self._guarded(serve, entity)
        for waitable in ready_waitables:
            self._guarded(self._serve_waitable, waitable)

    def _guarded(self, serve: Callable[[Any], None], entity: Any) -> None:
        try:
            serve(entity)
        except InvalidHandle:
            self._stale = True  # destroyed by an earlier callback of this round
        except Exception as error:  # noqa: BLE001 - the one place that keeps the node alive
            self._on_error(error, describe(entity))

    def _serve_service(self, service: Any) -> None:
        request, header = service.handle.service_take_request(service.srv_type.Request)
        if header is None:
            return
        self.sent = header.source_timestamp
        response = service.callback(request, service.srv_type.Response())
        if inspect.iscoroutine(response):
            self.create_task(self._answer_later, service, header, response)
        else:
            self._send(service, header, response)

    def _send(self, service: Any, header: Any, response: Any) -> None:
        """Answer a request; where the response has what no message can, answer with that error."""
        try:
            service.send_response(response, header)
        except InvalidHandle:
            raise
        except Exception as error:  # noqa: BLE001 - the caller waits for an answer
            name, failed = describe(service), service.srv_type.Response()
            if hasattr(failed, "success") and hasattr(failed, "message"):
                failed.message = f"the answer of {name} is no message: {type(error).__name__}"
            service.send_response(failed, header)
            self._on_error(error, name)

    async def _answer_later(self, service: Any, header: Any, response: Any) -> None:
        self._send(service, header, await response)

    def _serve_subscription(self, subscription: Any) -> None:
        callback = subscription.callback
        whole = subscription._callback_type is Subscription.CallbackType.WithMessageInfo
        take, kind, raw = subscription.handle.take_message, subscription.msg_type, subscription.raw
        for _ in range(BATCH):
            sample = take(kind, raw)
            if sample is None:
                return
            if whole:
                callback(sample[0], sample[1])
            else:
                callback(sample[0])

    def _serve_timer(self, timer: Any) -> None:
        if timer.handle.is_timer_ready():  # a cancelled timer shows up as ready
            timer.handle.call_timer()
            timer.callback()

    def _serve_client(self, client: Any) -> None:
        header, response = client.handle.take_response(client.srv_type.Response)
        if header is None:
            return
        try:
            future = client.get_pending_request(header.request_id.sequence_number)
        except KeyError:  # no longer awaited
            return
        future._set_executor(self)
        future.set_result(response)

    def _serve_guard(self, guard: Any) -> None:
        guard.callback()

    def _serve_waitable(self, waitable: Any) -> None:
        data = waitable.take_data()
        for future in reversed(waitable._futures):  # results of goals are kept for a minute
            known = future._executor
            if known is not None and known() is self:
                break  # as all before it
            future._set_executor(self)
        self._run(self.create_task(waitable.execute, data), describe(waitable))

    def _run_tasks(self) -> None:
        """Resume coroutines of actions and services, and callbacks of futures.

        A task that finishes may be awaited by another one: repeat until none finishes.
        """
        finished = bool(self._tasks)
        while finished:
            with self._tasks_lock:
                tasks = [task for task, _, _ in self._tasks]
            finished = sum(self._run(task, "task") for task in tasks) > 0
            with self._tasks_lock:
                self._tasks = [e for e in self._tasks if not (e[0].done() or e[0].cancelled())]

    def _run(self, task: Any, name: str) -> bool:
        """Resume a task; true if that finished it."""
        if task.done() or task.cancelled():
            return False
        task()
        if not task.done():
            return False
        error = task.exception()
        if error is not None:
            self._on_error(error, name)
        return True


def describe(entity: Any) -> str:
    """The name of a topic, service or action server for a message; else its class."""
    for name in ("topic_name", "service_name"):
        if hasattr(entity, name):
            return str(getattr(entity, name))
    return type(entity).__name__

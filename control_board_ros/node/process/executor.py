# SPDX-License-Identifier: Apache-2.0
"""A single-threaded executor that keeps its wait set.

rclpy's SingleThreadedExecutor gathers all entities of the node and builds a new wait set for
every single callback, and wakes itself twice for each of them; with the board's 60 entities
that is most of a service's round trip. This one gathers only when entities come or go, serves
everything that a wait found ready, and guards every callback: an exception is reported and the
executor continues.

It uses no private name of rclpy. Its wait set and what takes from a handle, though public, are
documented nowhere: ``test_executor.py`` has them all.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from typing import Any, cast

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.task import Task
from rclpy.waitable import NumberOfEntities

from ..loop.pulse import Pulse

#: Messages read from one subscription before the others and the services have their turn.
BATCH = 10


class KeptWaitSetExecutor(Executor):
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
        super().__init__(context=context)
        self.sent = 0
        self.pulse = Pulse()
        self.failure: Exception | None = None
        self._on_error = on_error
        self._stale, self._ended = True, False
        self._alarm = GuardCondition(lambda: None, None, context=self.context)
        self._jobs: list[tuple[Task, str]] = []
        self._held = ExitStack()
        self._wait_set: Any = None

    def wake(self) -> None:
        """Entities came or went: gather them before the next wait."""
        self._stale = True
        self._ring()

    def add_node(self, node: Any) -> bool:
        added = bool(super().add_node(node))
        self.wake()
        return added

    def remove_node(self, node: Any) -> None:
        super().remove_node(node)
        self.wake()

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        """Run a function or a coroutine in the thread that spins; safe to call from any thread."""
        task = Task(callback, args, kwargs, executor=self)
        self._jobs.append((task, "task"))
        self._ring()
        return task

    def end(self) -> None:
        """Make spin() return; safe to call from any thread, unlike shutdown() while it spins."""
        self._ended = True
        self._ring()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        self._alarm.destroy()
        return bool(super().shutdown(timeout_sec))

    def _ring(self) -> None:
        with suppress(InvalidHandle):  # after shutdown nothing waits
            self._alarm.trigger()

    def spin(self) -> None:
        """Serve until end() or the end of the context; an error beside the callbacks ends it."""
        try:
            while self.context.ok() and not self._ended:
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
        for add, entity in self._additions:
            add(entity)
        wait_set.wait(-1)
        if self._ended or not self.context.ok():
            return
        with self.pulse:
            self._serve_ready(wait_set)

    def _gather(self) -> None:
        """Hold the handles of all entities and make a wait set of their size."""
        self._held.close()
        nodes = self.get_nodes()
        kinds: dict[str, tuple[list[Any], Callable[[Any], None]]] = {
            "service": ([s for n in nodes for s in n.services], self._serve_service),
            "timer": ([t for n in nodes for t in n.timers], self._serve_timer),
            "client": ([c for n in nodes for c in n.clients], self._serve_client),
            "guard_condition": ([self._alarm, *(g for n in nodes for g in n.guards)], call_back),
            "subscription": (
                [s for n in nodes for s in n.subscriptions],
                self._serve_subscription,
            ),
        }
        #: By kind and the address of a handle: what serves an entity, and the entity.
        self._served: dict[str, dict[int, tuple[Callable[[Any], None], Any]]] = {
            kind: {
                entity.handle.pointer: (serve, entity)
                for entity in self._hold(entities, lambda entity: entity.handle)
            }
            for kind, (entities, serve) in kinds.items()
        }
        self._informed = {
            s for _, s in self._served["subscription"].values() if not takes_one(s.callback)
        }
        self._waitables = self._hold((w for n in nodes for w in n.waitables), lambda w: w)
        services, timers, clients, guards, subscriptions = map(len, self._served.values())
        size = NumberOfEntities(subscriptions, guards, timers, clients, services)
        for waitable in self._waitables:
            size += waitable.get_num_entities()
        self._held.enter_context(cast(Any, self.context.handle))
        self._wait_set = wait_set = rclpy_implementation.WaitSet(
            size.num_subscriptions,
            size.num_guard_conditions,
            size.num_timers,
            size.num_clients,
            size.num_services,
            size.num_events,
            self.context.handle,
        )
        #: What each wait begins with: functions that add to the wait set, and what they add.
        self._additions: list[tuple[Callable[[Any], None], Any]] = [
            (getattr(wait_set, f"add_{kind}"), entity.handle)
            for kind, served in self._served.items()
            for _, entity in served.values()
        ]
        self._additions += [(w.add_to_wait_set, wait_set) for w in self._waitables]

    def _hold(self, entities: Iterable[Any], handle: Callable[[Any], Any]) -> list[Any]:
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
        for kind, served in self._served.items():
            if not served:
                continue
            for pointer in wait_set.get_ready_entities(kind):
                if pointer in served:
                    self._guarded(*served[pointer])
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
            self._begin(self._answer_later, service, service, header, response)
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
        take, kind, raw = subscription.handle.take_message, subscription.msg_type, subscription.raw
        number = 2 if subscription in self._informed else 1
        for _ in range(BATCH):
            sample = take(kind, raw)
            if sample is None:
                return
            subscription.callback(*sample[:number])

    def _serve_timer(self, timer: Any) -> None:
        if timer.handle.is_timer_ready():  # a cancelled timer shows up as ready
            timer.handle.call_timer()
            timer.callback()

    def _serve_client(self, client: Any) -> None:
        header, response = client.handle.take_response(client.srv_type.Response)
        if header is None:
            return
        with suppress(KeyError):  # no longer awaited
            future = client.get_pending_request(header.request_id.sequence_number)
            future.set_result(response)

    def _serve_waitable(self, waitable: Any) -> None:
        self._begin(waitable.execute, waitable, waitable.take_data())

    def _begin(self, coroutine: Callable[..., Any], entity: Any, *args: Any) -> None:
        """Run a coroutine before the next wait; errors are reported by the entity's name."""
        self._jobs.append((Task(coroutine, args, executor=self), describe(entity)))

    def _run_tasks(self) -> None:
        """Resume coroutines of actions and services, and callbacks of futures.

        A task that ends may be awaited by another one: repeat until none does.
        """
        progress = True
        while progress:
            progress = False
            for job in list(self._jobs):
                task, name = job
                task()
                if not task.done() and not task.cancelled():
                    continue
                self._jobs.remove(job)
                progress = True
                if (error := task.exception()) is not None:
                    self._on_error(error, name)


def call_back(guard: Any) -> None:
    guard.callback()


def takes_one(callback: Callable[..., Any]) -> bool:
    """Whether a subscription's callback takes a message alone; else its information as well."""
    try:
        inspect.signature(callback).bind("message")
    except TypeError:
        return False
    return True


def describe(entity: Any) -> str:
    """The name of a topic, service or action server for a message; else its class."""
    for name in ("topic_name", "service_name"):
        if hasattr(entity, name):
            return str(getattr(entity, name))
    return type(entity).__name__

# SPDX-License-Identifier: Apache-2.0
"""The log of a node, and callbacks that report errors instead of raising."""

from __future__ import annotations

import inspect
import time
import traceback
from collections.abc import Callable, Iterable
from typing import Any

from rclpy.node import Node

from ...interface import SERVICES, Endpoint
from ..loop.snapshots import Snapshots
from .command_subscription import CommandSubscription
from .request_log import RequestLog
from .throttle import ThrottledLog, writers


class Reporter:
    """The log of a node, throttled, and guards for the node's callbacks.

    Args:
        node: whose log is written.

    Attributes: log (rclpy's own).
    """

    def __init__(self, node: Node) -> None:
        self.log = node.get_logger()
        self._node = node
        self._throttled = ThrottledLog()
        self._write = writers(self.log)

    def warn(self, message: str, what: str = "ignored") -> None:
        """Log a warning, once per second and cause; repeats are counted as ``what``."""
        self._throttled.say(self._write["warning"], message, what)

    def on_error(self, error: Exception, where: str) -> None:
        """An exception that should not be: one line, once per second and cause."""
        frames = traceback.extract_tb(error.__traceback__)
        at = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
        text = str(error).partition("\n")[0]
        self._throttled.say(
            self._write["error"],
            f"internal error in {where}: {type(error).__name__}: {text}{at}; please report it",
            what="times",
        )

    def log_events(self, snapshots: Snapshots) -> None:
        """Log what happened in the control cycles."""
        events = snapshots.events
        while events:
            event = events.popleft()
            write = self._write[event.level]
            self._throttled.say(write, event.text, what="times", cause=event.key + event.joint)

    def flush(self) -> None:
        """Tell how often what was held back was repeated; to be called once a second."""
        self._throttled.flush()

    def offer_services(self, requests: RequestLog, *offered: Any) -> None:
        """Offer every service of a board: one of ``offered`` has a method of each one's name.

        What they answer is noted in ``requests``.
        """
        for service in SERVICES:
            by = next(one for one in offered if hasattr(one, service.short))
            callback = self._answering(service, getattr(by, service.short), requests.answered)
            self._node.create_service(
                service.load(), service.name, callback, qos_profile=service.qos.profile()
            )

    def subscribe(
        self, callbacks: Iterable[tuple[Endpoint, Callable[[Any], None]]]
    ) -> list[CommandSubscription]:
        """Listen to command topics."""
        return [
            CommandSubscription(self._node, topic, self._guarded(topic.short, callback))
            for topic, callback in callbacks
        ]

    def _answering(self, service: Endpoint, callback: Any, note: Callable[..., None]) -> Any:
        """A service's callback that always answers, notes it, and never raises."""
        name, kind = service.short, service.load()

        async def later(request: Any, response: Any, begun: float) -> Any:
            made = await response
            note(service, request, made, begun)
            return made

        def answer(request: Any, response: Any) -> Any:
            begun = time.perf_counter()
            made = answered(request, response)
            if inspect.iscoroutine(made):
                return later(request, made, begun)
            note(service, request, made, begun)
            return made

        def answered(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except ValueError as error:
                return kind.Response(success=False, message=str(error))
            except Exception as error:  # noqa: BLE001 - no callback ends the node
                self.on_error(error, name)
                return kind.Response(
                    success=False, message=f"internal error in {name}; the board's log has more"
                )

        return answer

    def _guarded(self, name: str, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """A topic's callback that never raises."""

        def take(message: Any) -> None:
            try:
                callback(message)
            except ValueError as error:
                self.warn(f"{name} ignored: {error}")
            except Exception as error:  # noqa: BLE001 - no callback ends the node
                self.on_error(error, name)

        return take

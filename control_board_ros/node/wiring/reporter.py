# SPDX-License-Identifier: Apache-2.0
"""The log of a node, throttled, and guards for its callbacks, which report instead of raising."""

from __future__ import annotations

import inspect
import re
import threading
import time
import traceback
from collections.abc import Callable, Iterable
from typing import Any

from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node

from ...interface import SERVICES, Endpoint
from ...text import clean
from ..loop.snapshots import Snapshots
from .command_subscription import CommandSubscription
from .request_log import RequestLog

PERIOD = 1.0
#: Causes distinguished within one period; further ones count as one.
MAX_CAUSES = 50
FURTHER_CAUSES = "further causes"
#: Numbers, and not the digits of a name: joint_1 and joint_2 have causes of their own.
NUMBERS = re.compile(r"(?<!\w)[-+]?\d[\d.e+-]*")

#: Characters of a line of the log.
LINE_LENGTH = 2000

Write = Callable[[str], None]
#: Where a repeated message has its count.
COUNT = "\0"


class Reporter:
    """The log of a node, throttled, and guards for the node's callbacks.

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
        """Log an unexpected exception in one line, once per second and cause."""
        frames = traceback.extract_tb(error.__traceback__)
        at = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
        text = str(error).partition("\n")[0]
        self._throttled.say(
            self._write["error"],
            f"internal error in {where}: {type(error).__name__}: {text}{at}; please report it",
            what="times",
        )

    def log_events(self, snapshots: Snapshots) -> None:
        events = snapshots.events
        while events:
            event = events.popleft()
            write = self._write[event.level]
            self._throttled.say(write, event.text, what="times", cause=event.key + event.joint)

    def flush(self) -> None:
        """Log the counts of repeated messages; to be called once a second."""
        self._throttled.flush()

    def offer_services(self, requests: RequestLog, services: Any) -> None:
        """Offer every service of a board, a method of its name; ``requests`` notes the answers."""
        for service in SERVICES:
            method = getattr(services, service.short)
            callback = self._answering(service, method, requests.answered)
            self._node.create_service(
                service.load(), service.name, callback, qos_profile=service.qos.profile()
            )

    def subscribe(
        self,
        callbacks: Iterable[tuple[Endpoint, Callable[[Any], None]]],
        is_void: Callable[[Any, int], bool] = lambda _message, _sent: False,
    ) -> list[CommandSubscription]:
        return [
            CommandSubscription(self._node, topic, self._guarded(topic.short, callback), is_void)
            for topic, callback in callbacks
        ]

    def _answering(self, service: Endpoint, callback: Any, note: Callable[..., None]) -> Any:
        """A service's callback that always answers, notes it, and never raises."""
        name, kind = service.short, service.load()

        async def later(request: Any, response: Any, started: float) -> Any:
            made = await response
            note(service, request, made, started)
            return made

        def answer(request: Any, response: Any) -> Any:
            started = time.perf_counter()
            made = answered(request, response)
            if inspect.iscoroutine(made):
                return later(request, made, started)
            note(service, request, made, started)
            return made

        def answered(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except ValueError as error:
                return kind.Response(success=False, message=str(error))
            except Exception as error:  # noqa: BLE001 - no callback ends the node
                self.on_error(error, name)
                return kind.Response(
                    success=False, message=f"internal error in {name}; see the board's log"
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


def writers(log: RcutilsLogger) -> dict[str, Write]:
    """A function per severity: rclpy lets each line of code log with one severity only.

    A line may include untrusted texts.
    """

    def info(text: str) -> None:
        log.info(clean(text, LINE_LENGTH))

    def warning(text: str) -> None:
        log.warning(clean(text, LINE_LENGTH))

    def error(text: str) -> None:
        log.error(clean(text, LINE_LENGTH))

    return {"info": info, "warning": warning, "error": error}


class ThrottledLog:
    """Collects messages from any thread; :meth:`flush` is to be called once per period.

    The first message of a cause is written at once. Where others follow, the next flush writes
    the last one with the count of all in its period, including the first. Messages that differ
    in numbers only have the same cause.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._repeats: dict[str, tuple[Write, str, int]] = {}
        self._written = set[str]()  # causes whose first message came in this period

    def say(self, write: Write, message: str, what: str = "ignored", cause: str = "") -> None:
        """Write a message, or count it.

        Args:
            write: receives the line, e.g. ``logger.warning``.
            message: one line; a count goes before its first semicolon.
            what: name of the count, e.g. ``ignored``.
            cause: shared by repetitions; empty: the message without its numbers.
        """
        cause = cause or NUMBERS.sub("#", message[:200])
        with self._lock:
            known = self._repeats.get(cause)
            if known is None and len(self._repeats) >= MAX_CAUSES:
                cause = FURTHER_CAUSES
                known = self._repeats.get(FURTHER_CAUSES)
            text = with_count(message, what)
            self._repeats[cause] = (write, text, known[2] + 1 if known else 1)
            if known is None:
                self._written.add(cause)
        if known is None:
            write(message)

    def flush(self) -> None:
        """Write the counts of the last period; causes without new messages are forgotten."""
        with self._lock:
            due, first = self._repeats, self._written
            self._repeats = {cause: (*row[:2], 0) for cause, row in due.items() if row[2]}
            self._written = set()
        for cause, (write, text, count) in due.items():
            if count > (cause in first):  # otherwise already reported
                write(text.replace(COUNT, str(count), 1))


def with_count(message: str, what: str) -> str:
    """The message with a place for its count, before its first semicolon."""
    head, semicolon, rest = message.partition(";")
    return f"{head} ({COUNT} {what} in the last {PERIOD:g} s){semicolon}{rest}"

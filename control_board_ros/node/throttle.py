# SPDX-License-Identifier: Apache-2.0
"""A log that says everything once per second and cause, with the count of what it left out."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable

from rclpy.impl.rcutils_logger import RcutilsLogger

PERIOD = 1.0
#: Causes told apart within one period; what comes on top is counted as one more cause.
MAX_CAUSES = 50
OTHER = "further causes"
NUMBERS = re.compile(r"[-+]?\d[\d.e+-]*")

Write = Callable[[str], None]


def writers(log: RcutilsLogger) -> dict[str, Write]:
    """A function per severity: rclpy lets each line of code log with one severity only."""

    def info(text: str) -> None:
        log.info(text)

    def warning(text: str) -> None:
        log.warning(text)

    def error(text: str) -> None:
        log.error(text)

    return {"info": info, "warning": warning, "error": error}


class ThrottledLog:
    """Collects messages from any thread; :meth:`flush` is to be called once per period.

    The first message of a cause is written at once. Repeats are counted, and written with
    their count at the next flush. Two messages that differ in numbers only have one cause.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._repeats: dict[str, tuple[Write, str, int]] = {}

    def say(self, write: Write, message: str, what: str = "ignored", cause: str = "") -> None:
        """Write a message, or count it.

        Args:
            write: takes the line, e.g. ``logger.warning``.
            message: one line; a count goes before its first semicolon.
            what: what is counted, e.g. ``ignored``.
            cause: what repeats share; the message without its numbers, if empty.
        """
        cause = cause or NUMBERS.sub("#", message[:200])
        with self._lock:
            known = self._repeats.get(cause)
            if known is None and len(self._repeats) >= MAX_CAUSES:
                cause = OTHER
                known = self._repeats.get(OTHER)
            text = with_count(message, what)
            self._repeats[cause] = (write, text, known[2] + 1 if known else 0)
        if known is None:
            write(message)

    def flush(self) -> None:
        """Write the counts of the last period; causes that have fallen silent are forgotten."""
        with self._lock:
            due, self._repeats = self._repeats, {}
            for cause, (write, text, count) in due.items():
                if count:
                    self._repeats[cause] = (write, text, 0)
        for write, text, count in due.values():
            if count:
                write(text.replace(COUNT, str(count), 1))


COUNT = "\0"


def with_count(message: str, what: str) -> str:
    """The message with a place for its count, before what to do about it."""
    head, semicolon, rest = message.partition(";")
    return f"{head} ({COUNT} {what} in the last {PERIOD:g} s){semicolon}{rest}"

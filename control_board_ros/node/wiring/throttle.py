# SPDX-License-Identifier: Apache-2.0
"""A log that writes each cause once per second, with the count of what it left out."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable

from rclpy.impl.rcutils_logger import RcutilsLogger

from ...text import clean

PERIOD = 1.0
#: Causes distinguished within one period; further ones count as one.
MAX_CAUSES = 50
OTHER = "further causes"
#: Numbers, and not the digits of a name: joint_1 and joint_2 have causes of their own.
NUMBERS = re.compile(r"(?<!\w)[-+]?\d[\d.e+-]*")

#: Characters of a line of the log.
LONGEST = 2000

Write = Callable[[str], None]


def writers(log: RcutilsLogger) -> dict[str, Write]:
    """A function per severity: rclpy lets each line of code log with one severity only.

    A line may include untrusted texts.
    """

    def info(text: str) -> None:
        log.info(clean(text, LONGEST))

    def warning(text: str) -> None:
        log.warning(clean(text, LONGEST))

    def error(text: str) -> None:
        log.error(clean(text, LONGEST))

    return {"info": info, "warning": warning, "error": error}


class ThrottledLog:
    """Collects messages from any thread; :meth:`flush` is to be called once per period.

    The first message of a cause is written at once. Where others follow, the next flush writes
    the last of them with the count of all in its period, the first one among them. Two messages
    that differ in numbers only have one cause.
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
            self._repeats[cause] = (write, text, known[2] + 1 if known else 1)
            if known is None:
                self._written.add(cause)
        if known is None:
            write(message)

    def flush(self) -> None:
        """Write the counts of the last period; causes that have fallen silent are forgotten."""
        with self._lock:
            due, first = self._repeats, self._written
            self._repeats = {cause: (*row[:2], 0) for cause, row in due.items() if row[2]}
            self._written = set()
        for cause, (write, text, count) in due.items():
            if count > (cause in first):  # otherwise already reported
                write(text.replace(COUNT, str(count), 1))


COUNT = "\0"


def with_count(message: str, what: str) -> str:
    """The message with a place for its count, before what to do about it."""
    head, semicolon, rest = message.partition(";")
    return f"{head} ({COUNT} {what} in the last {PERIOD:g} s){semicolon}{rest}"

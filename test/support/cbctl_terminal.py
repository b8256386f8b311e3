# SPDX-License-Identifier: Apache-2.0
"""cbctl at a terminal of its own: what it shows, and key presses."""

from __future__ import annotations

import io
import os
import pty
import select
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from waiting import GUARD, until


class Terminal:
    """A process at a terminal of its own.

    Attributes: shown (since what was seen last), all_shown.
    """

    def __init__(self, command: list[str], environment: dict[str, str]) -> None:
        self._master, slave = pty.openpty()
        self.process = subprocess.Popen(
            command, env=environment, stdin=slave, stdout=slave, stderr=slave
        )
        os.close(slave)
        self.shown = self.all_shown = ""

    def see(self, text: str) -> None:
        """Read until this text is shown; what was shown before it is done with."""
        until(
            lambda: text in self.shown or self.read(),
            lambda: f"no {text!r} in {self.shown!r}",
            period=0.0,
        )
        self.shown = self.shown.partition(text)[2]

    def type(self, text: str) -> None:
        """Press keys."""
        os.write(self._master, text.encode())

    def hold(self, key: str, seen: Callable[[str], bool]) -> None:
        """Press a key again and again, as a keyboard does, until what is shown fulfils this."""

        def press() -> None:
            self.type(key)
            self.read()

        until(
            lambda: seen(self.shown) or press(),
            lambda: f"not reached in {self.shown!r}",
            period=0.0,
        )

    def end(self) -> int:
        """Read until the process ends, or shows nothing any more; its exit code."""
        shown, deadline = "", 0.0
        while self.process.poll() is None:
            if self.all_shown != shown or not deadline:
                shown, deadline = self.all_shown, time.monotonic() + GUARD
            if time.monotonic() > deadline:
                self.process.kill()
            self.read()
        os.close(self._master)
        return self.process.wait()

    def read(self) -> None:
        """Read what has been shown by now, or in a moment."""
        ready, _, _ = select.select([self._master], [], [], 0.05)
        if ready:
            try:
                read = os.read(self._master, 65536).decode(errors="replace")
                self.shown += read
                self.all_shown += read
            except OSError:  # the process has closed its end
                time.sleep(0.01)


@contextmanager
def terminal(cbctl: Any, *words: str, **environment: str) -> Iterator[Terminal]:
    """Run cbctl at a terminal; it must end by itself with code 0."""
    known = {"TERM": "xterm-256color", "PROMPT_TOOLKIT_NO_CPR": "1"}
    at = Terminal(cbctl.command(*words), cbctl.environment | known | environment)
    try:
        yield at
    except BaseException:
        at.process.kill()
        at.end()
        raise
    assert at.end() == 0


def drawn(table: Any, width: int) -> str:
    """What a terminal of this width shows of something that rich draws."""
    out = io.StringIO()
    Console(file=out, width=width).print(table)
    return out.getvalue()

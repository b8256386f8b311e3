# SPDX-License-Identifier: Apache-2.0
"""A connected browser: its outgoing queue and active requests."""

from __future__ import annotations

import asyncio
import json
import time
from collections import deque
from collections.abc import Mapping
from typing import Any

from control_board_ros.text import clean

from .security import BURST, RATE, TokenBucket

#: Maximum queued texts of a browser; a slower one is disconnected.
MAX_WAITING = 500
#: Maximum active requests of a browser.
MAX_RUNNING = 50


def message(what: str, fields: Mapping[str, Any]) -> str:
    """A message to browsers, in ASCII: every text has a form on the wire.

    Raises:
        ValueError: JSON has no form for a field.
    """
    try:
        return json.dumps({"is": what, **fields}, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise ValueError(f"a message ({what}) is left out: {error}") from None


def message_or_error(what: str, fields: Mapping[str, Any]) -> str:
    """A message, or in its place one that says why it is left out."""
    try:
        return message(what, fields)
    except ValueError as error:
        return message("error", {"message": clean(error)})


class Browser:
    """A browser.

    Args:
        number: of the connection.
        name: for display: device and address.
        tab: of the page, the same when it is loaded again; empty: unknown.

    Attributes: number, name, tab, watched (names of boards whose frames it receives), running (its
    active requests, by id), bucket (limits its rate), lost (it reads too slowly).
    """

    def __init__(self, number: int, name: str, tab: str = "") -> None:
        self.number, self.name, self.tab = number, name, tab
        self.watched: frozenset[str] = frozenset()
        self.running: dict[int, asyncio.Task[None]] = {}
        self.bucket = TokenBucket(RATE, BURST, BURST, time.monotonic())
        self.lost = False
        self._texts: deque[str] = deque()
        self._frames: dict[int, bytes] = {}
        self._news = asyncio.Event()

    def send(self, what: str, /, **fields: Any) -> None:
        self.send_text(message_or_error(what, fields))

    def send_text(self, text: str) -> None:
        self.lost = self.lost or len(self._texts) >= MAX_WAITING
        self._texts.append(text)
        self._news.set()

    def show(self, board: int, frame: bytes) -> None:
        """Queue a board's frame, in place of an older one of the same board."""
        self._frames[board] = frame
        self._news.set()

    async def write(self, websocket: Any) -> None:
        """Send the queues forever: texts first, then frames in one message.

        Raises:
            ConnectionError: it reads too slowly.
        """
        while not self.lost:
            await self._news.wait()
            self._news.clear()
            while self._texts:
                await websocket.send_text(self._texts.popleft())
            frames, self._frames = self._frames, {}
            if frames:
                await websocket.send_bytes(b"".join(frames.values()))
        raise ConnectionError("the browser reads too slowly")

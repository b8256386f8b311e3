# SPDX-License-Identifier: Apache-2.0
"""One browser that is connected: what waits to be sent to it, and what it has under way."""

from __future__ import annotations

import asyncio
import json
import time
from collections import deque
from typing import Any

from .security import BURST, RATE, TokenBucket

#: Texts that may wait for a browser; one that reads so slowly is let go.
MAX_WAITING = 500
#: Requests of one browser that may be under way.
MAX_RUNNING = 50


class Browser:
    """A browser.

    Args:
        number: of the connection.
        name: for people: where it is.

    Attributes: number, name, watched (names of boards whose frames it gets), running (its
    requests under way, by their id), bucket (bounds its rate), lost (it reads too slowly).
    """

    def __init__(self, number: int, name: str) -> None:
        self.number, self.name = number, name
        self.watched: frozenset[str] = frozenset()
        self.running: dict[int, asyncio.Task[None]] = {}
        self.bucket = TokenBucket.full(RATE, BURST, time.monotonic())
        self.lost = False
        self._texts: deque[str] = deque()
        self._frames: dict[int, bytes] = {}
        self._news = asyncio.Event()

    def tell(self, what: str, /, **fields: Any) -> None:
        """Send it a message."""
        self.tell_text(json.dumps({"is": what} | fields, ensure_ascii=False, allow_nan=False))

    def tell_text(self, text: str) -> None:
        """Send it a message that is text already."""
        self.lost = self.lost or len(self._texts) >= MAX_WAITING
        self._texts.append(text)
        self._news.set()

    def show(self, board: int, frame: bytes) -> None:
        """Send it a board's frame; one of the same board that still waits is older, and goes."""
        self._frames[board] = frame
        self._news.set()

    async def write(self, websocket: Any) -> None:
        """Send what waits, for ever; frames give way to texts, and go in one message.

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

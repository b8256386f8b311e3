# SPDX-License-Identifier: Apache-2.0
"""What all browsers share: boards, recordings, and the log of what was done."""

from __future__ import annotations

import contextlib
import time
from collections import deque
from pathlib import Path
from typing import Any

from control_board_ros.text import clean

from .boards import Board
from .browser import Browser, message, message_or_error
from .recordings import Recordings

#: Log entries sent to a new browser.
HISTORY = 500


class HubState:
    """Boards and browsers, and what every browser is sent.

    Args:
        read_only: operation disabled.
        recordings: folder of recordings.

    Attributes: read_only, boards (by name), browsers (by number), recordings, history (the log).
    """

    def __init__(self, *, read_only: bool, recordings: Path) -> None:
        self.read_only = read_only
        self.boards: dict[str, Board] = {}
        self.browsers: dict[int, Browser] = {}
        self.recordings = Recordings(
            recordings, self.send_recordings, lambda text: self.log("", text)
        )
        self.history = deque[dict[str, Any]](maxlen=HISTORY)

    def send_all(self, what: str, /, **fields: Any) -> None:
        text = message_or_error(what, fields)
        for browser in self.browsers.values():
            browser.send_text(text)

    def send_boards(self) -> None:
        shown = [{"name": b.name, "number": b.number} for b in self.boards.values()]
        self.send_all("boards", boards=sorted(shown, key=lambda b: str(b["name"])))

    def send_recordings(self) -> None:
        self.send_all("recordings", **self.recordings.page_fields())

    def send_targets(self, board: Board) -> None:
        self.send_all("targets", board=board.name, targets=board.targets)

    def log(self, who: str, what: str, **more: Any) -> None:
        """Log an action for all browsers, also later ones; at is in s since 1970."""
        entry = {"at": time.time(), "who": clean(who), "what": clean(what)} | more
        self.send_all("log", **entry)
        with contextlib.suppress(ValueError):  # left out, as browsers were told
            message("log", entry)
            self.history.append(entry)

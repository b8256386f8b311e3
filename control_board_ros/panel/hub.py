# SPDX-License-Identifier: Apache-2.0
"""Connects boards and browsers: messages of browsers, news of boards."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rclpy.node import Node

from control_board_ros.client import BoardError
from control_board_ros.client.ros_link import boards_on
from control_board_ros.core.selection import RequestError
from control_board_ros.text import clean

from .boards import Board
from .browser import Browser
from .dispatcher import Dispatcher
from .hub_state import HubState
from .lease import ANSWER_TIME
from .lease_service import LOOK_ROUND, LeaseService
from .protocol import KINDS, BadRequest, Request, parse
from .subscriptions import OperatorTopic

#: Frames per second for few and for many joints.
FAST, SLOW, MANY = 60.0, 30.0, 16
#: s between updates of modes and faults, other programs' commands, targets, the graph.
POLL, COMMANDS, TARGETS, DISCOVER = 0.05, 0.5, 1.0, 1.0
#: s between requests for the limits of a board.
INFO = 30.0

#: Reported problems that are remembered.
COMPLAINTS = 100


class Hub:
    """The panel between boards and browsers.

    Args:
        node: the panel's node; not spun.
        read_only: operation disabled.
        answer_timeout: timeout of a board's answer, s.
        report: called with log lines.
        recordings: folder of recordings.
        topic: topic of the domain's panels about their operators; None: that of ROS.
        look_round: s of initial discovery of other panels.
        answer_time: timeout of the operator's answer to a takeover request, s.

    Attributes: state, dispatcher, lease_service.
    """

    def __init__(
        self,
        node: Node,
        *,
        read_only: bool,
        answer_timeout: float,
        report: Callable[[str], None],
        recordings: Path,
        topic: OperatorTopic | None = None,
        look_round: float = LOOK_ROUND,
        answer_time: float = ANSWER_TIME,
    ) -> None:
        self._report = report
        self.state = state = HubState(read_only=read_only, recordings=recordings)
        self.dispatcher = Dispatcher(state)
        self.lease_service = LeaseService(
            state,
            topic or OperatorTopic(node),
            look_round,
            answer_time,
            self.dispatcher.dismiss,
        )
        self._node, self._answer_timeout = node, answer_timeout
        self._numbers, self._board_numbers = itertools.count(1), itertools.count()
        self._info_requested: dict[str, float] = {}
        self._known = set[str]()
        self._polled = 0.0
        self._complaints = set[str]()

    # Browsers

    def enter(self, name: str, tab: str = "") -> Browser:
        """Add a browser; the first one operates, if permitted."""
        browser = Browser(next(self._numbers), name, tab)
        self.state.browsers[browser.number] = browser
        browser.send("hello", you=browser.number, read_only=self.state.read_only)
        for board in self.state.boards.values():
            self._introduce(board, browser)
        browser.send("recordings", **self.state.recordings.page_fields())
        browser.send("history", entries=list(self.state.history))
        self.state.send_boards()
        self.lease_service.enter(browser)
        return browser

    async def leave(self, browser: Browser) -> None:
        """Remove a browser: release its controls and cancel its requests."""
        self.state.browsers.pop(browser.number, None)
        for task in browser.running.values():
            task.cancel()
        self._watch()
        await self.dispatcher.release(self.dispatcher.holds.of_browser(browser.number))
        self.lease_service.leave(browser)

    def _introduce(self, board: Board, browser: Browser) -> None:
        for what in ("info", "modes", "faults"):
            if fields := getattr(board, what):
                browser.send(what, board=board.name, **fields)
        browser.send("targets", board=board.name, targets=board.targets)

    def receive(self, browser: Browser, message: str) -> None:
        if not browser.bucket.take(time.monotonic()):
            browser.lost = True
            browser.send("error", message="too many messages; connection closed")
            return
        try:
            request = parse(message)
            self._check(browser, request)
        except BadRequest as error:
            browser.send("answer", id=error.id, ok=False, message=str(error))
            return
        if request.do == "watch":
            browser.watched = frozenset(request.fields["boards"])
            self._watch()
            browser.send("answer", id=request.id, ok=True, message="")
        elif request.do in ("operate", "hand_over", "step_back"):
            self.lease_service.process(browser, request)
        else:
            self.dispatcher.start(browser, request)

    def _check(self, browser: Browser, request: Request) -> None:
        """Check the permission of a browser; raises BadRequest with the reason."""
        commands = KINDS[request.do].commands
        stops = request.do == "stop" or (request.do == "estop" and request.fields["on"])
        if stops:  # who sees can stop
            pass
        elif self.state.read_only and (commands or request.do in ("operate", "hand_over")):
            raise BadRequest("the panel is read-only; start it without --read-only", request.id)
        elif commands:
            self.lease_service.check(browser, request)
        if request.board and request.board not in self.state.boards:
            raise BadRequest(f"no board {request.board}; it may have ended", request.id)

    # Loops

    async def run(self) -> None:
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._every(lambda: 1.0 / self._rate(), self._look))
                group.create_task(self._every(lambda: COMMANDS, self._poll_commands))
                group.create_task(self._every(lambda: TARGETS, self._targets))
                group.create_task(self._every(lambda: DISCOVER, self._discover))
                group.create_task(self.dispatcher.run())
        finally:
            await self.state.recordings.close()
            self.lease_service.close()
            for board in self.state.boards.values():
                board.close()

    async def _every(self, period: Callable[[], float], look: Callable[[], Any]) -> None:
        """Call periodically; errors of a board are reported and end nothing."""
        due = time.monotonic()
        while True:
            try:
                await look()
            except Exception as error:  # noqa: BLE001  (messages may be invalid)
                self._complain(f"{type(error).__name__}: {error}")
            due = max(due + period(), time.monotonic())
            await asyncio.sleep(due - time.monotonic())

    @contextlib.contextmanager
    def _reported(self, board: Board) -> Iterator[None]:
        """Report errors of a board, whose messages may be invalid; they end nothing."""
        try:
            yield
        except (BoardError, RequestError) as error:
            self._complain(f"{board.name}: {error}")
        except Exception as error:  # noqa: BLE001  (messages may be invalid)
            self._complain(f"{board.name}: {type(error).__name__}: {error}")

    def _complain(self, text: str) -> None:
        """Report a problem once."""
        if text not in self._complaints:
            if len(self._complaints) >= COMPLAINTS:
                self._complaints.clear()
            self._complaints.add(text)
            self._report(clean(text))

    def _watched(self) -> set[str]:
        return {name for browser in self.state.browsers.values() for name in browser.watched}

    def _watch(self) -> None:
        """Subscribe to the states of watched boards only."""
        watched = self._watched()
        for board in self.state.boards.values():
            board.watch(on=board.name in watched)

    def _rate(self) -> float:
        watched = self._watched()
        if not watched:
            return 1.0 / POLL
        joints = sum(
            len(self.state.boards[name].names) for name in watched if name in self.state.boards
        )
        return FAST if joints <= MANY else SLOW

    async def _look(self) -> None:
        """Send frames, and other news every few frames: one timer for both."""
        self._frames()
        if time.monotonic() - self._polled >= POLL:
            self._polled = time.monotonic()
            self._poll()

    def _frames(self) -> None:
        """Send the newest state of each watched board: number, length, message."""
        for board in self.state.boards.values():
            raw = None if board.state is None else board.state.take()
            if raw is not None:
                frame = b"".join(
                    (board.number.to_bytes(4, "little"), len(raw).to_bytes(4, "little"), raw)
                )
                for browser in self.state.browsers.values():
                    if board.name in browser.watched:
                        browser.show(board.number, frame)

    def _poll(self) -> None:
        """Forward modes, faults, descriptions, and the operator."""
        for board in list(self.state.boards.values()):
            with self._reported(board):
                self._forward(board, board.poll())
        self.lease_service.look()

    def _forward(self, board: Board, news: dict[str, Any]) -> None:
        for what in ("modes", "faults"):
            if what in news:
                self.state.send_all(what, board=board.name, **news[what])
        if "elsewhere" in news and not any(map(board.repeats, self.state.boards.values())):
            self.state.log("", f"{board.name}: {news['elsewhere']}")
        if "robot" in news:
            self._info_requested.pop(board.name, None)

    async def _poll_commands(self) -> None:
        for board in list(self.state.boards.values()):
            with self._reported(board):
                for words in board.poll_commands():
                    self.state.log("another program", f"{board.name} {words}", board=board.name)

    async def _targets(self) -> None:
        """Request the targets of watched boards, and less often their limits."""
        await asyncio.gather(*(self._ask(board) for board in list(self.state.boards.values())))

    async def _ask(self, board: Board) -> None:
        now = time.monotonic()
        with self._reported(board):
            if board.names and now - self._info_requested.get(board.name, -INFO) >= INFO:
                self._info_requested[board.name] = now
                before = board.info
                await board.ask_info()
                if board.info != before:
                    self.state.send_all("info", board=board.name, **board.info)
            if board.name in self._watched() and await board.ask_targets():
                self.state.send_targets(board)

    async def _discover(self) -> None:
        names = set(boards_on(self._node))
        for name in names - set(self.state.boards):
            self.state.boards[name] = Board(
                self._node, name, next(self._board_numbers), self._answer_timeout
            )
        for name in set(self.state.boards) - names:
            board = self.state.boards.pop(name)
            self._info_requested.pop(name, None)
            await asyncio.to_thread(board.close)
            self.state.log("", f"{name} is gone")
        self._watch()
        if names != self._known:
            self._known = names
            self.state.send_boards()

# SPDX-License-Identifier: Apache-2.0
"""Operation: requests to boards, held controls, STOP."""

from __future__ import annotations

import asyncio
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

from control_board_ros.client import BoardError
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.core.terms.modes import MOVES, NOT_HOLDING, STOPPABLE, UNPOWERED
from control_board_ros.core.terms.vocabs import HAND_TIMEOUT
from control_board_ros.text import clean

from . import handlers
from .boards import Board
from .browser import MAX_RUNNING, Browser
from .command_lines import CommandLines, command_lines
from .handlers import Hold, Holds
from .hub_state import HubState
from .protocol import KINDS, Request

#: s between repetitions of a held reference.
REPEAT = 0.04
#: Requests that move joints: STOP cancels active ones.
MOTION_REQUESTS = ("position", "direct", "move", "calibrate", "pose", "step", "chirp")
#: Modes without an effect of the board's stop: STOP makes these joints hold their position.
FREE_MODES = frozenset(mode.code for mode in NOT_HOLDING)
#: Modes with a position reference: the board's stop acts.
POSITION_MODES = frozenset(mode.code for mode in STOPPABLE)


class Dispatcher:
    """Runs requests of browsers."""

    def __init__(self, state: HubState) -> None:
        self._state = state
        self.holds = Holds()
        self._holding = asyncio.Event()
        self._releasing: set[asyncio.Task[None]] = set()
        #: Serialises the held references of a board: a release is the last one.
        self._in_order = defaultdict[str, asyncio.Lock](asyncio.Lock)

    def start(self, browser: Browser, request: Request) -> None:
        """Run a request; the answer goes to the browser, the line to all."""
        if request.id in browser.running or len(browser.running) >= MAX_RUNNING:
            text = "too many active requests, or two of one id; wait for answers"
            browser.send("answer", id=request.id, ok=False, message=text)
            return
        loop = asyncio.get_running_loop()
        task = loop.create_task(self._run(browser, request), name=request.do)
        browser.running[request.id] = task
        task.add_done_callback(lambda _: browser.running.pop(request.id, None))

    async def _run(self, browser: Browser, request: Request) -> None:
        try:
            answer = await self._do(browser, request)
        except asyncio.CancelledError:
            answer = {"ok": False, "message": "cancelled"}
        except (BoardError, RequestError) as error:
            gone = bool(request.board) and request.board not in self._state.boards
            text = f"{request.board} does not answer: it has ended" if gone else str(error)
            answer = {"ok": False, "message": text}
        except Exception as error:  # noqa: BLE001  (every request has an answer)
            text = clean(f"the panel has an error: {type(error).__name__}: {error}")
            answer = {"ok": False, "message": text}
        lines = asdict(self._lines(request))
        browser.send("answer", id=request.id, lines=lines, **answer)
        if KINDS[request.do].commands and not answer.pop("quiet", False):
            self._state.log(
                browser.name,
                request.do,
                by=browser.number,
                board=request.board,
                lines=lines,
                ok=answer["ok"],
                message=answer["message"],
                live=request.fields.get("live", False),
            )

    def _lines(self, request: Request) -> CommandLines:
        if request.board:
            return command_lines(request)
        if request.do not in ("stop", "estop"):
            return CommandLines()
        boards = list(self._state.boards.values())
        if request.do == "estop":
            boards = self._without_parts()
        each = [command_lines(replace(request, board=board.name)) for board in boards]
        return CommandLines(
            " && ".join(line.cbctl for line in each),
            " && ".join(line.ros2 for line in each),
            "\n".join(dict.fromkeys(line.python for line in each)),
        )

    async def _do(self, browser: Browser, request: Request) -> dict[str, Any]:
        if not request.board:
            return await self._do_for_all(browser, request)
        board = self._state.boards[request.board]
        for other in self._state.boards.values():  # a robot's board includes its parts
            if other.space == board.space and KINDS[request.do].commands:
                other.requesting()
        own_handlers = {"hold": self._hold, "release": self._release, "stop": self._stop_some}
        own_handlers |= {"step": self._measure, "chirp": self._measure}
        if request.do in own_handlers:
            return await own_handlers[request.do](browser, board, request)

        def progress(share: float, words: str) -> None:
            browser.send("progress", id=request.id, share=share, words=words)

        answer = await handlers.handle(board, request.do, request.fields, progress)
        if request.do in ("position", "direct", "move") and await board.ask_targets():
            self._state.send_targets(board)
        return answer

    async def _do_for_all(self, browser: Browser, request: Request) -> dict[str, Any]:
        """Requests to no board, or to several."""
        recordings, fields = self._state.recordings, request.fields
        if request.do == "stop":
            return await self._stop_everything()
        if request.do == "estop":
            return await self._emergency_stop(fields["on"])
        if request.do == "cancel":
            task = browser.running.get(int(fields["request"]))
            if task is not None:
                task.cancel()
            return {"ok": task is not None, "message": "" if task else "it has ended already"}
        if request.do == "note":
            return recordings.note(fields["text"], self._state.boards)
        if fields["on"]:
            return await recordings.begin(fields.get("boards", []), self._state.boards)
        return await recordings.end()

    async def _release(self, _: Browser, board: Board, request: Request) -> dict[str, Any]:
        hold = self.holds.release(board.name, request.fields["joint"])
        await self.release([hold] if hold else [])
        return {"ok": True, "message": "", "quiet": True}

    async def _stop_some(self, _: Browser, board: Board, request: Request) -> dict[str, Any]:
        return await self._stop(board, request.fields.get("joints") or board.names)

    async def _measure(self, _: Browser, board: Board, request: Request) -> dict[str, Any]:
        """A step or chirp by a separate program, whose commands are not reported as foreign."""
        fields, do = request.fields, request.do
        if fields["joint"] not in board.names or fields["joint"].startswith("-"):
            return {"ok": False, "message": f"{board.name} has no joint {fields['joint']}"}
        unit = JointKind.of(board.robot.kind(fields["joint"])).unit
        size = fields.get("size", fields.get("amplitude"))
        option = "--size" if do == "step" else "--amplitude"
        options = [] if size is None else [f"{option}={size:.6g}{unit}"]
        board.measured = True
        try:
            return await self._state.recordings.measure(board.name, do, fields["joint"], *options)
        finally:
            board.measured = False

    async def _hold(self, browser: Browser, board: Board, request: Request) -> dict[str, Any]:
        """Send the value of a held control at once; the loop repeats it."""
        joint, kind, value = (request.fields[key] for key in ("joint", "kind", "value"))
        held = self.holds.get(board.name, joint)
        fresh = held is None or held.kind != kind
        rest: float | None = 0.0
        if held is not None and not fresh:
            rest = held.rest
        elif kind == "torque":
            rest = self._torque_reference(board, joint)
        if rest is None:
            message = f"the torque that holds {joint} is not known yet; hold again"
            return {"ok": False, "message": message}
        hold = Hold(browser.number, board.name, joint, kind, value, rest, 0.0)
        self.holds.hold(hold, time.monotonic())
        self._holding.set()
        async with self._in_order[board.name]:
            reply = await handlers.send_held(board, kind, joint, value, valid_for=HAND_TIMEOUT)
        if not reply:
            self.holds.release(board.name, joint)
        return handlers.reply_fields(reply) | {"quiet": not fresh}

    def _torque_reference(self, board: Board, joint: str) -> float | None:
        """The torque in force, from the board's state or that of its robot."""
        for other in (board, *self._state.boards.values()):
            if other.space == board.space:
                torque = other.torque_reference(joint)
                if torque is not None:
                    return torque
        return None

    async def release(self, holds: list[Hold]) -> None:
        """Send the rest references of released controls."""
        for hold in holds:
            board = self._state.boards.get(hold.board)
            if board is not None:
                try:
                    async with self._in_order[board.name]:
                        await handlers.send_held(board, hold.kind, hold.joint, hold.rest)
                except (BoardError, RequestError) as error:
                    self._state.log("", f"{hold.board}: {error}")

    def dismiss(self, number: int) -> None:
        """Release a former operator's controls and cancel its requests."""
        holds = self.holds.of_browser(number)
        task = asyncio.get_running_loop().create_task(self.release(holds))
        self._releasing.add(task)  # keeps it from the garbage collector
        task.add_done_callback(self._releasing.discard)
        browser = self._state.browsers.get(number)
        for task in list(browser.running.values()) if browser is not None else ():
            task.cancel()

    async def run(self) -> None:
        """Repeat held references, release expired ones; at the end release all."""
        try:
            while True:
                if not self.holds:
                    self._holding.clear()
                    await self._holding.wait()
                await self.release(self.holds.expired(time.monotonic()))
                for hold in self.holds:
                    board = self._state.boards.get(hold.board)
                    if board is not None:
                        await self._repeat(board, hold)
                await asyncio.sleep(REPEAT)
        finally:
            await self.release(self.holds.everything())

    async def _repeat(self, board: Board, hold: Hold) -> None:
        try:
            async with self._in_order[board.name]:
                if self.holds.get(hold.board, hold.joint) is not hold:  # released in between
                    return
                reply = await handlers.send_held(
                    board, hold.kind, hold.joint, hold.value, valid_for=HAND_TIMEOUT
                )
        except (BoardError, RequestError):
            reply = None
        if not reply:  # the joint has left its mode, or the board is gone
            self.holds.release(hold.board, hold.joint)

    async def _emergency_stop(self, on: bool) -> dict[str, Any]:
        """Disable every joint of every board, or release the stop; once per robot."""
        if on:
            self.holds.everything()
            self._cancel_motions()
        boards = self._without_parts()
        for board in boards:
            board.requesting()
        return summed(
            boards,
            await asyncio.gather(
                *(board.client.aio.emergency_stop(on) for board in boards), return_exceptions=True
            ),
        )

    def _without_parts(self) -> list[Board]:
        """The boards without the parts of a robot's board, whose stop includes them."""
        boards = list(self._state.boards.values())
        return [
            board
            for board in boards
            if not any(robot_board.repeats(board) for robot_board in boards)
        ]

    def _cancel_motions(self) -> None:
        for browser in self._state.browsers.values():
            for task in list(browser.running.values()):
                if task.get_name() in MOTION_REQUESTS:
                    task.cancel()

    async def _stop_everything(self) -> dict[str, Any]:
        """STOP: release every control, cancel active requests, stop every joint of every board."""
        held = self.holds.everything()
        self._cancel_motions()
        boards = list(self._state.boards.values())
        answers = await asyncio.gather(
            *(self._stop(board, board.names) for board in boards), return_exceptions=True
        )
        await self._stop_late(held)
        return summed(boards, answers)

    async def _stop(self, board: Board, names: list[str]) -> dict[str, Any]:
        """Stop joints of a board; those in torque or output modes then hold their position."""
        board.requesting()
        dropped = [self.holds.release(board.name, name) for name in names]
        modes = dict(zip(board.names, board.modes.get("control", ()), strict=True))
        unheld = [name for name in names if modes.get(name) in FREE_MODES]
        moving = [name for name in names if modes.get(name) in POSITION_MODES]
        aio, answers = board.client.aio, []
        if moving:
            answers.append(handlers.reply_fields(await aio.stop(moving)))
        if unheld:
            held = [holding_mode(board, name) for name in unheld]
            answers.append(handlers.reply_fields(await aio.set_control_mode(unheld, held)))
        await self._stop_late([hold for hold in dropped if hold is not None])
        message = "; ".join(answer["message"] for answer in answers if answer["message"])
        return {"ok": all(answer["ok"] for answer in answers), "message": message}

    async def _stop_late(self, held: list[Hold]) -> None:
        """Stop velocities that were in transit when the board was stopped."""
        await self.release([hold for hold in held if hold.kind == "velocity"])


def holding_mode(board: Board, name: str) -> str:
    """The mode that holds a joint's position; IDLE if there is none."""
    available = dict(zip(board.names, board.info.get("control", ()), strict=False))
    moves = MOVES.code
    return moves if moves in available.get(name, (moves,)) else UNPOWERED.code


def summed(boards: Sequence[Board], answers: Sequence[Any]) -> dict[str, Any]:
    """Combine the answers of several boards: replies, answers for the page, or errors."""
    messages, ok = [], True
    for board, answer in zip(boards, answers, strict=True):
        if isinstance(answer, asyncio.CancelledError):
            raise answer
        fields: dict[str, Any] = {"ok": False, "message": str(answer)}
        if not isinstance(answer, BaseException):
            fields = answer if isinstance(answer, dict) else handlers.reply_fields(answer)
        ok = ok and bool(fields["ok"])
        if fields["message"]:
            messages.append(f"{board.name}: {fields['message']}")
    return {"ok": ok, "message": "; ".join(messages)}

# SPDX-License-Identifier: Apache-2.0
"""Recordings, reports and measurements of the panel: by ``cbctl`` in separate processes.

Files and reports do not delay the loops of held controls.
"""

from __future__ import annotations

import asyncio
import re
import signal
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

CBCTL = (sys.executable, "-m", "control_board_ros.cli")
#: s between checks that a recording receives its boards; s for its end.
LOOK, ENDS = 0.1, 60.0
#: Policy of a report: no origin, and thus no cookie of the panel.
REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)

Answer = dict[str, Any]


class Recordings:
    """The recordings of this panel.

    Args:
        folder: of the recordings' folders; created with the first.
        changed: called on changes.
        report: called with a line where a recording ends by itself.

    Attributes: reports (names of folders below, newest first), running (folder of the active
    recording, or None), boards (recorded), since (s since 1970), busy (label of the button while a
    recording starts, or its report is written).
    """

    def __init__(
        self, folder: Path, changed: Callable[[], None], report: Callable[[str], None]
    ) -> None:
        self._folder, self._changed, self._report = folder, changed, report
        self._process: asyncio.subprocess.Process | None = None
        self._watching: asyncio.Task[None] | None = None
        self.reports: list[str] = []
        self.running: Path | None = None
        self.boards: list[str] = []
        self.since = 0.0
        self.busy = ""

    def page_fields(self) -> Answer:
        return {
            "running": self.running.name if self.running else "",
            "boards": self.boards,
            "since": self.since,
            "busy": self.busy,
            "reports": self.reports,
            "folder": str(self._folder.absolute()),
        }

    def report(self, name: str) -> Path | None:
        """The file of a report; None if unknown."""
        return self._folder / name / "report.html" if name in self.reports else None

    def note(self, text: str, known: Mapping[str, Any]) -> Answer:
        """Publish a note to the active recording, for each of its boards."""
        noted = [board for name, board in known.items() if name in self.boards]
        noticed = [board.note(text) for board in noted]
        if self.running is None or not any(noticed):
            return refused("no recording is running; start one first")
        return {"ok": True, "message": "noted"}

    async def begin(self, boards: list[str], known: Mapping[str, Any]) -> Answer:
        """Start a recording of known boards; returns once all are received."""
        unknown = [name for name in boards if name not in known]
        if unknown or not boards:
            return refused(f"no board {', '.join(unknown) or 'was named'}")
        if self.running is not None or self.busy:
            return refused("a recording is running already; stop it first")
        folder, self.boards = self._new("recording"), boards
        self._show("Starting …")
        try:
            process = self._process = await start(*of_boards(boards), "record", "-o", str(folder))
            while process.returncode is None:
                if all(known[name].is_recorded() for name in boards if name in known):
                    self.running, self.since = folder, time.time()
                    self._watching = asyncio.create_task(self._watch(process))
                    return {"ok": True, "message": f"recording into {folder}"}
                await asyncio.sleep(LOOK)
            return refused(await last_line(process))
        except asyncio.CancelledError:
            await self.close()
            raise
        finally:
            self._show("")

    async def _watch(self, process: asyncio.subprocess.Process) -> None:
        """Report a recording that ends by itself, as where the disk is full."""
        await process.wait()
        if self.running is not None:
            self._report(f"the recording has ended: {(await self.end())['message']}")

    async def end(self) -> Answer:
        """End the recording and write its report."""
        folder, process = self.running, self._process
        if folder is None or process is None:
            return refused("no recording is running")
        self.running = None
        self._show("Drawing …")
        try:
            reason = await interrupted(process)
            report = await start("report", str(folder))
            words = await last_line(report)
        finally:
            self._show("")
        if report.returncode != 0:
            return refused(f"{reason}; no report: {words}" if reason else f"no report: {words}")
        self._keep(folder)
        return {"ok": not reason, "message": reason, "report": folder.name}

    async def measure(self, board: str, verb: str, joint: str, *options: str) -> Answer:
        """A step or chirp; cancelling it stops the joint at once."""
        folder = self._new(f"{verb}_{joint}")
        words = (*of_boards([board]), verb, joint, *options, "-o", str(folder))
        process = await start(*words)
        try:
            reason = await last_line(process)
        except asyncio.CancelledError:
            await interrupted(process)
            raise
        if process.returncode != 0 or not (folder / "report.html").is_file():
            return refused(reason)
        self._keep(folder)
        return {"ok": True, "message": "", "report": folder.name}

    async def close(self) -> None:
        """End; recordings are kept."""
        self.running = None
        if self._process is not None and self._process.returncode is None:
            await interrupted(self._process)

    def _show(self, busy: str) -> None:
        self.busy = busy
        self._changed()

    def _new(self, name: str) -> Path:
        stamp = time.strftime("%Y-%m-%d_%H-%M-%S")
        return self._folder / re.sub(r"[^\w.-]", "_", f"{stamp}_{name}")

    def _keep(self, folder: Path) -> None:
        self.reports = [folder.name, *self.reports]
        self._changed()


def refused(why: str) -> Answer:
    return {"ok": False, "message": why}


def of_boards(boards: list[str]) -> list[str]:
    """Option of cbctl for boards: one, or all of a robot."""
    if len(boards) == 1:
        return ["--board", boards[0]]
    spaces = {board.rpartition("/")[0] for board in boards}
    return ["--board", f"{spaces.pop()}/*" if len(spaces) == 1 else "*"]


async def start(*words: str) -> asyncio.subprocess.Process:
    pipe = asyncio.subprocess.PIPE
    return await asyncio.create_subprocess_exec(
        *CBCTL, *words, stdin=asyncio.subprocess.DEVNULL, stdout=pipe, stderr=pipe
    )


async def last_line(process: asyncio.subprocess.Process) -> str:
    """Wait for its end; returns its last line, of stderr if any."""
    out, err = await process.communicate()
    lines = (err.decode(errors="replace") or out.decode(errors="replace")).splitlines()
    return lines[-1] if lines else f"cbctl ended with code {process.returncode}"


async def interrupted(process: asyncio.subprocess.Process) -> str:
    """Interrupt it; returns its message on failure."""
    if process.returncode is None:
        process.send_signal(signal.SIGINT)
    try:
        async with asyncio.timeout(ENDS):
            reason = await last_line(process)
    except TimeoutError:
        process.kill()
        return f"the recording did not end within {ENDS:g} s"
    return "" if process.returncode == 0 else reason

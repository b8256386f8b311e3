# SPDX-License-Identifier: Apache-2.0
"""Recordings of the panel, without boards: programs stand in for cbctl."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import Any

import pytest

from control_board_ros.panel import recordings
from control_board_ros.panel.recordings import Recordings

#: Ends as cbctl record does on a full disk, once it is told to by the first line of its input.
ENDED = "import sys; sys.stdin.readline(); sys.exit('cbctl: the recording ended early: full')"


class Recorded:
    """A board whose recorder is there."""

    def is_recorded(self) -> bool:
        return True


@pytest.fixture
def programs(monkeypatch: pytest.MonkeyPatch) -> list[asyncio.subprocess.Process]:
    """The programs started: the first records, the others draw."""
    started: list[asyncio.subprocess.Process] = []

    async def start(*_: str) -> asyncio.subprocess.Process:
        pipe = asyncio.subprocess.PIPE
        text = "print('report')" if started else ENDED
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-c", text, stdin=pipe, stdout=pipe, stderr=pipe
        )
        started.append(process)
        return process

    monkeypatch.setattr(recordings, "start", start)
    return started


def test_a_recording_that_ends_by_itself_is_said(programs: Any, tmp_path: Path) -> None:
    """It is shown as running no longer, its report is drawn, and the log has the reason."""

    async def session() -> None:
        said = asyncio.Queue[str]()
        made = Recordings(tmp_path, lambda: None, said.put_nowait)
        answer = await made.begin(["/a"], {"/a": Recorded()})
        assert answer["ok"], answer
        assert made.running is not None
        programs[0].stdin.write(b"end\n")
        assert await said.get() == (
            "the recording has ended: cbctl: the recording ended early: full"
        )
        assert made.running is None
        assert not made.busy
        assert len(made.reports) == 1

    asyncio.run(session())


def test_an_early_end_is_the_answer_to_its_stop(programs: Any, tmp_path: Path) -> None:
    """A report of what there is does not make the recording whole."""

    async def session() -> None:
        made = Recordings(tmp_path, lambda: None, print)
        await made.begin(["/a"], {"/a": Recorded()})
        programs[0].stdin.write(b"end\n")
        answer = await made.end()
        assert not answer["ok"]
        assert answer["report"] in made.reports

    asyncio.run(session())


def test_a_program_that_does_not_start_blocks_no_later_one(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    async def start(*_: str) -> None:
        raise OSError("no more processes")

    async def session() -> None:
        made = Recordings(tmp_path, lambda: None, print)
        with pytest.raises(OSError, match="no more"):
            await made.begin(["/a"], {"/a": Recorded()})
        assert not made.busy

    monkeypatch.setattr(recordings, "start", start)
    asyncio.run(session())

# SPDX-License-Identifier: Apache-2.0
"""A progress bar on stderr; silent with --json."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from typing import Any

from ..line.words import Refused
from ..text.output import console
from .session import Session


class Bar:
    """``with Bar(session, "moving") as bar: bar.update(0.5, "1.2 s")``.

    It appears with the first update, so that a refused request draws none. Without a known end
    (``endless``), only the text is shown.
    """

    def __init__(self, session: Session, label: str, *, endless: bool = False) -> None:
        self._progress: Any = None
        if not session.options.json:
            from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

            share = () if endless else (BarColumn(), TaskProgressColumn())
            self._progress = Progress(
                TextColumn("{task.description}"),
                *share,
                TextColumn("{task.fields[text]}"),
                console=console(stderr=True),
            )
            self._task = self._progress.add_task(label, total=1.0, text="")

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._progress is None or not self._progress.live.is_started:
            return
        try:
            self._progress.stop()
        except IndexError:  # Ctrl-C while it appeared: rich has not begun what it ends here
            self._progress.console.show_cursor(True)

    def update(self, share: float, text: str = "") -> None:
        """Show a share from 0 to 1."""
        if self._progress is not None:
            self._progress.start()
            self._progress.update(self._task, completed=min(max(share, 0.0), 1.0), text=text)


class Way:
    """Progress of a move, as measured: of the joint that is furthest behind.

    Args:
        targets: by joint, rad or m.
        near: distances that count as zero, by joint.
    """

    def __init__(self, targets: Mapping[str, float], near: Mapping[str, float]) -> None:
        self._targets, self._near = targets, near
        self._starts: dict[str, float] = {}

    def share(self, positions: Mapping[str, float]) -> float:
        """From 0 to 1; the first positions are the start of the move."""
        if not self._starts:
            self._starts = dict(positions)
        made = [1.0]
        for name, target in self._targets.items():
            whole = target - self._starts[name]
            if abs(whole) > self._near[name]:
                made.append((positions[name] - self._starts[name]) / whole)
        return max(min(made), 0.0)


class Standstill:
    """Detects that the board's time has stopped, by a value that changes with it.

    Args:
        limit: s of standing still after which waiting ends; a terminal, whose user sees the hint
            and has Ctrl-C, waits on.
    """

    #: s for which the value must not change.
    PATIENCE = 1.0
    HINT = "; paused? resume with: cbctl resume"

    def __init__(self, limit: float = math.inf) -> None:
        self._limit = math.inf if sys.stderr.isatty() else limit
        self._value = math.nan
        self._since = 0.0

    def hint(self, value: float, now: float) -> str:
        """The hint to append to a text.

        Args:
            value: remaining time of a motion, or the stamp of a state, s; 0: it has ended.
            now: time of this process, s.

        Raises:
            Refused: it stands still for longer than the limit.
        """
        if value != self._value:
            self._value, self._since = value, now
        still = now - self._since if value else 0.0
        if still >= self._limit:
            raise Refused(f"the board's time stands still for {still:.0f} s{self.HINT}")
        return self.HINT if still >= self.PATIENCE else ""

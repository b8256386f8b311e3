# SPDX-License-Identifier: Apache-2.0
"""The start-up of a robot, level after level (SPEC R4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from .board import Board
from .checks import ConfigError
from .events import Events
from .modes import CALIBRATES, CONFIGURED, Stage

Level = tuple[str, ...]


def complete_levels(levels: Sequence[Sequence[str]], parts: Sequence[str]) -> tuple[Level, ...]:
    """All parts in levels: those that no level names form the last one.

    Raises:
        ConfigError: a level names what is no part, or a part is there twice.
    """
    named = [name for level in levels for name in level]
    for name in named:
        if name not in parts or named.count(name) > 1:
            raise ConfigError("startup_levels", name, f"parts, each once: {', '.join(parts)}")
    rest = tuple(name for name in parts if name not in named)
    return (*(tuple(level) for level in levels if level), *([rest] if rest else []))


class BringUp:
    """Configures parts level after level; parts of one level calibrate side by side.

    Args:
        boards: of the parts, by name.
        levels: names of parts; see :func:`complete_levels`.
        events: takes why it stopped.

    Attributes: running.
    """

    def __init__(
        self, boards: Mapping[str, Board], levels: Sequence[Level], events: Events
    ) -> None:
        self._boards, self._levels, self._events = boards, levels, events
        self._level = 0
        self.running = False

    def begin(self) -> None:
        """Start with the first level; parts that are configured already stay as they are."""
        self.running = True
        self._enter(0)

    def cancel(self) -> None:
        """Do not go on."""
        self.running = False

    def step(self) -> None:
        """After every cycle: go on when the level is done, stop when a part of it failed."""
        if not self.running:
            return
        boards = {name: self._boards[name] for name in self._levels[self._level]}
        if any(is_under_way(board) for board in boards.values()):
            return
        failures = {name: text for name, board in boards.items() if (text := failure(board))}
        waiting = [name for level in self._levels[self._level + 1 :] for name in level]
        if failures and waiting:
            self._tell(failures, waiting)
        if failures or not waiting:
            self.running = False
        else:
            self._enter(self._level + 1)

    def _enter(self, level: int) -> None:
        self._level = level
        for name in self._levels[level]:
            board = self._boards[name]
            if board.state.stage is Stage.INACTIVE:  # managed: configured already
                board.set_stage(Stage.ACTIVE)
            else:
                board.configure()

    def _tell(self, failures: Mapping[str, str], waiting: Sequence[str]) -> None:
        why = "; ".join(f"{name}: {text}" for name, text in failures.items())
        self._events.add(
            "error",
            "start-up",
            "",
            f"start-up stopped, {why}; not started: {', '.join(waiting)}; remove the cause "
            "(FORCE_IDLE, then calibrate), and call configure of the robot to go on",
        )


def is_under_way(board: Board) -> bool:
    """Whether a joint is to be configured with the next reading, or calibrates."""
    return any(m in CALIBRATES or m not in CONFIGURED for m in board.state.control_modes)


def failure(board: Board) -> str:
    """Why the start-up of a part failed; empty where it did not."""
    for joint, calibrated, fault in zip(
        board.config.joints, board.state.calibrated, board.state.faults, strict=True
    ):
        if fault.active:
            return f"{joint.name} is in HW_FAULT, {fault.text}"
        if joint.calibration is not None and joint.calibration.required and not calibrated:
            return f"{joint.name} is not calibrated"
    return ""

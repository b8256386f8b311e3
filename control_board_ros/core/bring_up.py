# SPDX-License-Identifier: Apache-2.0
"""The start-up of a robot, level after level (SPEC R4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from .config.checks import ConfigError
from .group import JointGroup
from .terms.events import Events
from .terms.modes import CALIBRATES, CONFIGURED, Stage

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
        groups: of the parts, by name.
        levels: names of parts; see :func:`complete_levels`.
        events: receives the reason for a stop.

    Attributes: groups, running.
    """

    def __init__(
        self, groups: Mapping[str, JointGroup], levels: Sequence[Level], events: Events
    ) -> None:
        self.groups, self._levels, self._events = groups, levels, events
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
        groups = {name: self.groups[name] for name in self._levels[self._level]}
        if any(is_under_way(group) for group in groups.values()):
            return
        failures = {name: text for name, group in groups.items() if (text := failure(group))}
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
            group = self.groups[name]
            if group.stage is Stage.ACTIVE:
                group.configure()
            else:  # of a managed board
                group.set_stage(Stage.ACTIVE)

    def _tell(self, failures: Mapping[str, str], waiting: Sequence[str]) -> None:
        why = "; ".join(f"{name}: {text}" for name, text in failures.items())
        self._events.add(
            "error",
            "start-up",
            "",
            f"start-up stopped, {why}; not started: {', '.join(waiting)}; remove the cause "
            "(FORCE_IDLE, then calibrate), and call configure of the robot to go on",
        )


def is_under_way(group: JointGroup) -> bool:
    """Whether a joint is to be configured with the next reading, or calibrates."""
    return any(m in CALIBRATES or m not in CONFIGURED for m in group.get_control_mode())


def failure(group: JointGroup) -> str:
    """Why the start-up of a part failed; empty where it did not."""
    for joint, status, fault in zip(
        group.get_config(), group.get_calibration(), group.get_faults(), strict=True
    ):
        if fault.active:
            return f"{joint.name} is in HW_FAULT, {fault.text}"
        if joint.calibration is not None and joint.calibration.required and not status.calibrated:
            return f"{joint.name} is not calibrated"
    return ""

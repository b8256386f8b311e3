# SPDX-License-Identifier: Apache-2.0
"""The control board: the one object with state (SPEC A offered in process).

The owner drives the board: ``actuation = board.tick(measurement)`` is one control
cycle, the set methods take effect for all their joints between two cycles. It has no clock,
thread or lock; callers from several threads bring their own. Nothing that a user or a robot
does raises: set methods answer with a Reply, joints fault. Only get methods raise, a
RequestError, when they are asked for a joint that does not exist.

A board is the group of all its joints, with the methods of ``JointGroup``; a robot of several
parts has a group for each part, too (SPEC R). ``Engine`` has the cycle, ``BringUp`` starts a robot
level after level (R4).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from .config.config import BoardConfig, Zone
from .config.parameter import ConfigError
from .engine import Engine
from .group import JointGroup
from .terms.faults import BoardEvent
from .terms.measurement import Actuation, Measurement
from .terms.modes import CALIBRATES, CONFIGURED, Stage
from .terms.vocabs import CommandKind

__all__ = ["Board", "BoardEvent", "CommandKind"]

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
    """Starts parts level after level; parts of one level calibrate side by side.

    Args:
        groups: of the parts, by name.
        levels: names of parts; see :func:`complete_levels`.
        engine: of all; its events receive the reason for a stop.

    Attributes: groups, level (the one that starts; None: none).
    """

    def __init__(
        self, groups: Mapping[str, JointGroup], levels: Sequence[Level], engine: Engine
    ) -> None:
        self.groups, self._levels, self._engine = groups, levels, engine
        self.level: int | None = None
        self._waiting: Collection[str] = ()

    def begin(self, waiting: Collection[str] = ()) -> None:
        """Start with the first level; parts that are configured already stay as they are.

        Its level waits for a part that is named as ``waiting`` until that is configured by itself.
        """
        self._waiting = waiting
        self._enter(0)

    def cancel(self) -> None:
        """Do not go on."""
        self.level = None

    def step(self) -> None:
        """After every cycle: go on when the level is done, stop when a part of it failed."""
        if self.level is None:
            return
        groups = {name: self.groups[name] for name in self._levels[self.level]}
        if any(is_under_way(group) for group in groups.values()):
            return
        failures = {name: text for name, group in groups.items() if (text := failure(group))}
        waiting = [name for level in self._levels[self.level + 1 :] for name in level]
        if failures and waiting:
            self._tell(failures, waiting)
        if failures or not waiting:
            self.cancel()
        else:
            self._enter(self.level + 1)

    def _enter(self, level: int) -> None:
        self.level = level
        later = [self.groups[name] for names in self._levels[level + 1 :] for name in names]
        self._engine.start_up.held = {j for group in later for j in group.joints}
        for name in self._levels[level]:
            group = self.groups[name]
            if name in self._waiting:
                continue
            if group.stage is Stage.ACTIVE:
                group.configure()
            else:  # of a managed board
                group.set_stage(Stage.ACTIVE)

    def _tell(self, failures: Mapping[str, str], waiting: Sequence[str]) -> None:
        why = "; ".join(f"{name}: {text}" for name, text in failures.items())
        self._engine.events.add(
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
        if joint.requires_calibration and not status.calibrated:
            return f"{joint.name} is not calibrated"
    return ""


class Board(JointGroup):
    """The control board of some joints; see the module for how it is used.

    Args:
        config: of its joints; ``layout.joined`` makes that of a robot of several parts.
        levels: names of the parts that start up together, level after level (R4).

    Attributes: parts (the groups of a robot's parts, by name), bring_up.

    Raises:
        ConfigError: levels that do not fit the parts.
    """

    def __init__(self, config: BoardConfig, levels: Sequence[Sequence[str]] = ()) -> None:
        zones = config.zones()
        engine = Engine(config, zones)
        super().__init__(engine, Zone("", slice(0, engine.state.n), config))
        groups = {zone.name: JointGroup(engine, zone) for zone in zones}
        self.parts = {name: group for name, group in groups.items() if name}
        self.bring_up = BringUp(groups, complete_levels(levels, tuple(groups)), engine)
        self._start_up()

    def tick(
        self,
        measurement: Measurement,
        now: float | None = None,
        clock: Callable[[], float] | None = None,
    ) -> Actuation:
        """One control cycle: from what was measured to what the motors get.

        Args:
            measurement: values of shape (ROWS, n), read before this cycle acts.
            now: time on the clock of the heartbeat, s; None: that of the measurement.
            clock: read into ``engine.checked`` when the reading is checked, before the laws.

        Returns:
            The PWM and the bridges; the arrays are the board's own, valid until the next tick.
        """
        actuation = self.engine.tick(measurement, now, clock)
        self.bring_up.step()
        return actuation

    def group(self, name: str | None = None) -> JointGroup:
        """The joints of a part by its name; without one, all of them.

        Raises:
            KeyError: there is no such part.
        """
        return self if name is None else self.parts[name]

    @property
    def unknown_commands(self) -> int:
        """Commands so far that named no joint of the board, or of the part addressed (P13)."""
        return self._unknown + sum(part.unknown_commands for part in self.parts.values())

    def _begin(self) -> None:
        """Start up level after level, or go on where a part failed (N2, R4)."""
        if self.stage is Stage.ACTIVE:
            self.bring_up.begin()
        else:
            super()._begin()

    def set_stage(self, stage: Stage) -> None:
        """As of a group; on ACTIVE, parts start level after level (R4)."""
        self.bring_up.cancel()
        if stage is Stage.ACTIVE:
            self.bring_up.begin()
        else:
            for group in self.bring_up.groups.values():
                group.set_stage(stage)

    def power_cycle(self) -> None:
        """Back to power-on, every part; configured again with autoconfigure (N1, R4)."""
        self.bring_up.cancel()
        for group in self.bring_up.groups.values():
            group.power_cycle()
        self._start_up()

    def power_off(self) -> None:
        """Disable all joints; a calibration is aborted (K2), a fault stays shown."""
        self.bring_up.cancel()
        super().power_off()

    def _start_up(self) -> None:
        groups = self.bring_up.groups
        waiting = [name for name, group in groups.items() if not group.config.autoconfigure]
        if self.stage is Stage.ACTIVE and len(waiting) < len(groups):
            self.engine.start_up.due.clear()
            self.bring_up.begin(waiting)

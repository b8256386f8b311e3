# SPDX-License-Identifier: Apache-2.0
"""The control board: the one object with state (SPEC A offered in process).

A board is driven by whoever holds it: ``actuation = board.tick(measurement)`` is one control
cycle, the set methods take effect for all their joints between two cycles. It has no clock,
thread or lock; callers from several threads bring their own. Nothing that a user or a robot
does raises: set methods answer with a Reply, joints fault. Only get methods raise, a
RequestError, when they are asked for a joint that does not exist.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..interfaces import ModeShortcuts
from .commands import Commands
from .config import BoardConfig, ConfigError
from .faults import FaultCode
from .machine import BoardEvent
from .measurement import Actuation, Measurement, Row
from .requests import Requests
from .state import Snapshot
from .vocabs import CommandKind


class Board(Requests, Commands, ModeShortcuts):
    """The control board of some joints; see the module for how it is used.

    Attributes: config, names, count, period (s), cycle, time (s, of the last reading),
    modes_version and faults_version (they grow when a mode or a fault record changes).
    """

    def __init__(self, config: BoardConfig) -> None:
        super().__init__(config)
        self._last = self.state.measured.copy()
        self._torque_sensor = np.array([joint.torque_sensor for joint in config.joints])
        self._actuation = Actuation(pwm=self.state.output, powered=self.state.powered)

    def tick(self, measurement: Measurement) -> Actuation:
        """One control cycle: from what was measured to what the motors get.

        Args:
            measurement: values of shape (ROWS, n), read before this cycle acts.

        Returns:
            The PWM and the bridges; the arrays are the board's own, valid until the next tick.
        """
        self._read(measurement)
        if self.configure_next:
            self.watch.mend(self._last)
            self.complete_configuration()
        if not self.watch.healthy(measurement.values):
            self._raise_faults(self._last)
        if self.watch.monitor.news:
            self._warn_of_heat()
        if self._calibrators:
            self._calibrate()
        self._expire()
        self.controller.step()
        on_limit = [joint.on_limit for joint in self.controller.joints]
        if on_limit != self._on_limit:
            self._tell_limits(on_limit)
        self.cycle += 1
        return self._actuation

    def snapshot(self) -> Snapshot:
        """All that the board shows, frozen; a new object, never changed afterwards."""
        return Snapshot(
            self.time,
            self.cycle,
            self.state.block.copy(),
            self.state.done.copy(),
            self.state.rejected.copy(),
            self.state.calibrated.copy(),
            self.watch.used.copy(),
            self._torque_sensor,
        )

    @property
    def rejected_commands(self) -> NDArray[np.uint64]:
        """How many commands of each joint were ignored so far (M4), shape (n,)."""
        return self.state.rejected.copy()

    def take_events(self) -> list[BoardEvent]:
        """What happened since the last call, oldest first."""
        events = list(self.events)
        self.events.clear()
        return events

    def power_cycle(self) -> None:
        """Back to power-on: NOT_CONFIGURED, no power, configured anew with autoconfigure (N1)."""
        self.reset()

    def reconfigure(self, config: BoardConfig) -> None:
        """Take new gains, limits and timeouts while running, without a jump.

        Raises:
            ConfigError: the joints, the rate or the kind of output differ.
        """
        for key in ("names", "control_rate", "output"):
            old, new = getattr(self.config, key), getattr(config, key)
            if old != new:
                raise ConfigError(key, new, f"fixed at {old!r} while the board runs")
        self.config = config
        self.controller.reconfigure(config)
        self.watch.reconfigure(config)
        self.references.reconfigure(config)
        for j in range(self.count):
            joint = slice(j, j + 1)
            self.watch.arm(joint, on=self.is_configured(j), calibrated=self.state.calibrated)
            if self.faults[j].active:
                self.watch.let_cool(j, FaultCode(self.faults[j].code))
            if j not in self._calibrators and self.state.powered[j]:
                self.references.bound(joint)

    def _read(self, measurement: Measurement) -> None:
        state = self.state
        self.time = measurement.time
        self._last[:] = state.measured
        state.measured[:] = measurement.values
        self.blind = False
        if self._shifted:
            state.position -= state.offset

    def _tell_limits(self, on_limit: list[bool]) -> None:
        for j, (now, before) in enumerate(zip(on_limit, self._on_limit, strict=True)):
            if now and not before:
                position = float(self.state.measured[Row.POSITION, j])
                limits = self.config.joints[j].limits
                self.tell(
                    "warning",
                    "limit",
                    j,
                    f"{self.names[j]}: at {position:.4g}, beyond its software limits "
                    f"{limits.lower:.4g} to {limits.upper:.4g}; the protection pushes it back",
                )
        self._on_limit = on_limit


__all__ = ["Board", "BoardEvent", "CommandKind"]

# SPDX-License-Identifier: Apache-2.0
"""From power-on to the first mode: configured, calibrated where required, started (SPEC N)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..terms.modes import UNPOWERED, Event, Stage
from .machine import Machine


class StartUp:
    """Takes joints out of NOT_CONFIGURED, once per power-on.

    Args:
        machine: whose joints they are.

    Attributes: due (the joints whose configuration completes with the next reading).
    """

    def __init__(self, machine: Machine) -> None:
        self._machine, self._state = machine, machine.state
        self._power_on_cycles = [0] * machine.state.n
        self.due: set[int] = set()

    def power_on(self, joints: Sequence[int], *, autoconfigure: bool) -> None:
        """Restart joints; without ``autoconfigure`` they wait for :meth:`begin`."""
        for j in joints:
            self._power_on_cycles[j] = self._state.cycle
            self.due.discard(j)
            if autoconfigure and self._state.stages[j] is not Stage.UNCONFIGURED:
                self.due.add(j)

    def begin(self, joints: Iterable[int]) -> None:
        """Configure joints; without a reading since their power-on, at the next one.

        A joint holds where it is, not where it was.
        """
        for j in joints:
            if self._state.cycle == self._power_on_cycles[j]:
                self.due.add(j)
            else:
                self._configure(j)

    def complete(self) -> None:
        """The joints that are due leave NOT_CONFIGURED, there is a reading (N2, N3)."""
        due, self.due = sorted(self.due), set()
        for j in due:
            self._configure(j)

    def _configure(self, j: int) -> None:
        machine = self._machine
        if machine.is_configured(j):
            return
        calibration = machine.config.joints[j].calibration
        if calibration is None or not calibration.required:
            machine.calibrations.set_offset(j, calibration.zero if calibration else 0.0)
            machine.calibrations.know_angle(j)
        elif self._state.stages[j] is Stage.ACTIVE:
            machine.calibrations.start(j)
            return
        machine.go(j, Event.CONFIGURED)

    def activate(self, joints: Iterable[int]) -> None:
        """Power is allowed: each joint that has none calibrates or starts, as at N3."""
        machine, state = self._machine, self._state
        for j in joints:
            joint = machine.config.joints[j]
            calibration = joint.calibration
            if state.control_modes[j] is not UNPOWERED:
                continue  # in fault (F2), or not configured yet
            if machine.brakes.is_kept_closed(j):
                continue  # by hand (Y4)
            if calibration is None or not calibration.required:
                machine.go(j, joint.startup_mode)
            elif state.calibrated[j]:
                machine.go(j, calibration.control_mode)
            else:
                machine.calibrations.start(j)

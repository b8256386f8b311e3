# SPDX-License-Identifier: Apache-2.0
"""From power-on to the first mode: configured, calibrated where required, started (SPEC N)."""

from __future__ import annotations

from .machine import Machine
from .modes import CONFIGURED, UNPOWERED, Event, Stage
from .reply import Reply, accepted, refused


class StartUp:
    """Takes the joints of a board out of NOT_CONFIGURED, once per power-on.

    Args:
        machine: whose joints they are.

    Attributes: due (the configuration completes with the next reading).
    """

    def __init__(self, machine: Machine) -> None:
        self._machine, self._state = machine, machine.state
        self._power_on_cycle = machine.state.cycle
        self.due = machine.config.autoconfigure and self._state.stage is not Stage.UNCONFIGURED

    def configure(self) -> Reply:
        """The whole configuration is in: at its reading a joint leaves NOT_CONFIGURED (N2)."""
        names, state = self._machine.config.names, self._state
        if state.stage is Stage.UNCONFIGURED:
            text = "the node is unconfigured; use the transition configure of its lifecycle"
            return refused(text, names)
        if all(mode in CONFIGURED for mode in state.control_modes):
            text = "the board is configured already; power_cycle takes it back"
            return refused(text, names)
        self.begin()
        return accepted(names)

    def await_configure(self) -> None:
        """Stay NOT_CONFIGURED until :meth:`configure`, also with autoconfigure (R4)."""
        self.due = False

    def begin(self) -> None:
        """Configure the joints; without a reading since power-on, at the next one.

        A joint holds where it is, not where it was.
        """
        if self._state.cycle == self._power_on_cycle:
            self.due = True
        else:
            self.complete()

    def complete(self) -> None:
        """Every joint leaves NOT_CONFIGURED, there is a reading (N2, N3)."""
        self.due = False
        machine = self._machine
        for j, joint in enumerate(machine.config.joints):
            if machine.is_configured(j):
                continue
            calibration = joint.calibration
            if calibration is None or not calibration.required:
                machine.calibrations.set_offset(j, calibration.zero if calibration else 0.0)
                machine.calibrations.know_angle(j)
            elif self._state.stage is Stage.ACTIVE:
                machine.calibrations.start(j)
                continue
            machine.go(j, Event.CONFIGURED)

    def activate(self) -> None:
        """Power is allowed: each joint that has none calibrates or starts, as at N3."""
        machine, state = self._machine, self._state
        for j, joint in enumerate(machine.config.joints):
            calibration = joint.calibration
            if state.control_modes[j] is not UNPOWERED:
                continue  # in fault (F2), or not configured yet
            if calibration is None or not calibration.required:
                machine.go(j, joint.startup_mode)
            elif state.calibrated[j]:
                machine.go(j, calibration.control_mode)
            else:
                machine.calibrations.start(j)

# SPDX-License-Identifier: Apache-2.0
"""The control board: the one object with state (SPEC A offered in process).

The owner drives the board: ``actuation = board.tick(measurement)`` is one control
cycle, the set methods take effect for all their joints between two cycles. It has no clock,
thread or lock; callers from several threads bring their own. Nothing that a user or a robot
does raises: set methods answer with a Reply, joints fault. Only get methods raise, a
RequestError, when they are asked for a joint that does not exist.

It is the group of all its joints, with what users ask of joints (``group``); a robot of several
parts has a group for each of them, too (SPEC R). Below are ``machine`` (modes, faults,
calibrations), ``requests`` (for modes), ``start_up`` and ``bring_up``, ``commands`` (references of
users), ``references`` (what runs), ``controller`` (the laws), ``monitor`` (causes of faults),
``emergency`` (the stop of all), ``frames`` (what was around faults).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .config.config import BoardConfig
from .config.layout import Zone, joined, zones_of
from .config.limits import BoardLimits
from .group import JointGroup
from .laws.control import Controller
from .laws.references import References
from .laws.timeouts import ReferenceTimeouts
from .machine.bring_up import BringUp, complete_levels
from .machine.commands import Commands, timeout_cycles
from .machine.feedforward import Feedforward
from .machine.machine import Machine
from .machine.motors import MotorAccess
from .machine.requests import Requests
from .machine.start_up import StartUp
from .machine.stops import Stops
from .state import StateArrays
from .terms.drives import SetPoint
from .terms.events import BoardEvent, Events
from .terms.measurement import Actuation, Measurement
from .terms.modes import Stage
from .terms.vocabs import CommandKind
from .watch.emergency import EmergencyStop
from .watch.external_torque import ExternalTorques
from .watch.fault_monitor import FaultMonitor
from .watch.freeze_frame import FreezeFrames

__all__ = ["Board", "BoardEvent", "CommandKind"]


class Board(JointGroup):
    """The control board of some joints; see the module for how it is used.

    Args:
        config: of its joints; ``layout.joined`` makes that of a robot of several parts.
        levels: names of the parts that start up together, level after level (R4).

    Attributes: parts (the groups of a robot's parts, by name), limits, and its components.

    Raises:
        ConfigError: levels that do not fit the parts.
    """

    def __init__(self, config: BoardConfig, levels: Sequence[Sequence[str]] = ()) -> None:
        self._config = config
        self.limits = BoardLimits.of(config)
        self.state = state = StateArrays(config)
        zones = zones_of(config)
        super().__init__(self, Zone("", slice(0, state.n), config))
        groups = {zone.name: JointGroup(self, zone) for zone in zones}
        self.parts = {name: group for name, group in groups.items() if name}
        self.events = Events({j: zone.name for zone in zones for j in zone.config.names})
        self.torques = ExternalTorques(config, state)
        self.torque_sensor = self.torques.known
        self._before = state.measured.copy()
        self.controller = Controller(config, state)
        self.references = References(
            config, self.limits, state, self.controller.joints, self.controller.efforts
        )
        self.emergency = EmergencyStop(config.heartbeat_timeout)
        self.monitor = FaultMonitor(config, state, self.emergency)
        timeouts = ReferenceTimeouts(timeout_cycles(config))
        self.frames = FreezeFrames(state, config.period)
        self.machine = Machine(
            config, state, self.controller, self.references, timeouts, self.monitor, self.events
        )
        self.machine.on_fault = self.frames.fault
        self.brakes = brakes = self.machine.brakes
        self._actuation = Actuation(
            state.output, state.powered, state.kinds, state.set_points, brakes.orders
        )
        self.machine.joint = self.torques.joint
        self.start_up = StartUp(self.machine)
        self.requests = Requests(self.machine)
        self.commands = Commands(self.machine, self.limits)
        self.feedforward = Feedforward(self.machine)
        self.motors = MotorAccess(self.machine, self.limits)
        self.stops = Stops(self.machine)
        self.bring_up = BringUp(groups, complete_levels(levels, tuple(groups)), self.events)
        self._stage = Stage.ACTIVE
        for zone in zones:
            self._start(zone)
        self._start_up()

    # --- the cycle --------------------------------------------------------------------------

    def tick(self, measurement: Measurement) -> Actuation:
        """One control cycle: from what was measured to what the motors get.

        Args:
            measurement: values of shape (ROWS, n), read before this cycle acts.

        Returns:
            The PWM and the bridges; the arrays are the board's own, valid until the next tick.
        """
        machine, monitor = self.machine, self.monitor
        if self.torques.joints:
            measurement = self.torques.fill(measurement)
        self._read(measurement)
        if self.start_up.due:
            monitor.replace_broken(self._before)
            self.start_up.complete()
        monitor.reasons = measurement.reasons
        self.emergency.watch(measurement.time)
        if not monitor.healthy(measurement.values):
            machine.check_faults(self._before)
        if monitor.has_news():
            machine.warn_of_heat()
        if self.brakes.there:
            self.brakes.switches = measurement.brakes
            self.brakes.step()
        if machine.calibrations:
            machine.calibrations.step()
        machine.expire()
        if self.controller.step():
            machine.raise_divergence()
            machine.warn_of_limits()
        self.state.cycle += 1
        self.frames.note()
        if self.bring_up.running:
            self.bring_up.step()
        return self._actuation

    def _read(self, measurement: Measurement) -> None:
        state = self.state
        state.time = measurement.time
        self._before[:] = state.measured
        state.measured[:] = measurement.values
        if measurement.applied is not None:  # where a drive chooses it
            np.copyto(state.output, measurement.applied, where=state.kinds > SetPoint.PWM)
        if measurement.motors is not None:
            state.motors[:] = measurement.motors
        if self.machine.calibrations.shifted:
            state.position -= state.offset

    # --- the whole board ----------------------------------------------------------------------

    def group(self, name: str | None = None) -> JointGroup:
        """The joints of a part by its name; without one, all of them.

        Raises:
            KeyError: there is no such part.
        """
        return self if name is None else self.parts[name]

    @property
    def config(self) -> BoardConfig:
        """Its configuration; that of a robot has those of its parts."""
        return self._config

    @property
    def stage(self) -> Stage:
        """How far its joints may go; a part that waits for its level is not there yet."""
        return self._stage

    @property
    def modes_version(self) -> int:
        """Grows when a mode changes."""
        return self.state.modes_version

    @property
    def faults_version(self) -> int:
        """Grows when a fault record changes."""
        return self.state.faults_version

    @property
    def unknown_commands(self) -> int:
        """How many commands named no joint of the board, or of the part asked, so far (P13)."""
        return self._unknown + sum(part.unknown_commands for part in self.parts.values())

    def _begin(self) -> None:
        """Start up level after level, or go on where a part failed (N2, R4)."""
        if self._stage is Stage.ACTIVE:
            self.bring_up.begin()
        else:
            self.start_up.begin(self.joints)

    def set_stage(self, stage: Stage) -> None:
        """As of a group; on ACTIVE, parts start level after level (R4)."""
        self._stage = stage
        self.bring_up.cancel()
        if stage is Stage.ACTIVE:
            self.bring_up.begin()
        else:
            for group in self.bring_up.groups.values():
                group.set_stage(stage)

    def power_cycle(self) -> None:
        """Back to power-on, every part; configured anew with autoconfigure (N1, R4)."""
        for group in self.bring_up.groups.values():
            group.power_cycle()
        self._start_up()

    def power_off(self) -> None:
        """Take the power of every joint; a calibration is aborted (K2), a fault stays shown."""
        self.bring_up.cancel()
        super().power_off()

    def power_on(self, zone: Zone) -> None:
        """Make the joints of a part begin anew (N1)."""
        self.state.power_on(zone.joints)
        self.controller.power_on(zone)
        self.references.power_on(zone.joints, self._config)
        self.monitor.power_on(zone.joints)
        self._start(zone)

    def _start(self, zone: Zone) -> None:
        self.machine.power_on(zone.joints)
        self.start_up.power_on(zone.joints, autoconfigure=zone.config.autoconfigure)

    def _start_up(self) -> None:
        self.bring_up.cancel()
        if self._stage is Stage.ACTIVE and self._config.autoconfigure:
            self.start_up.due.clear()
            self.bring_up.begin()

    def take_config(self, part: str, config: BoardConfig) -> None:
        """Take a new configuration of a part, or of all; see :meth:`reconfigure`."""
        if part:
            config = joined({**self._config.parts, part: config})
        self._config, self.limits = config, BoardLimits.of(config)
        self.controller.reconfigure(config)
        self.monitor.reconfigure(config)
        self.references.reconfigure(self.limits)
        self.commands.reconfigure(self.limits)
        self.motors.limits = self.limits
        self.torques.reconfigure(config)
        self.machine.reconfigure(config, timeout_cycles(config))

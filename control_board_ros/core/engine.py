# SPDX-License-Identifier: Apache-2.0
"""The control cycle and its components (SPEC A).

Components: ``machine`` (modes, faults, calibrations, brakes), ``requests`` (for modes and brakes,
and stops), ``start_up``, ``commands`` (references of users), ``references`` (those that run),
``controller`` (the laws), ``monitor`` (causes of faults), ``timeouts`` (of references),
``emergency`` (the stop of all), ``frames`` (freeze frames of faults), ``motors`` and
``feedforward``, ``mix`` (of coupled motors).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .config.config import BoardConfig, BoardLimits, ConfigError, Zone, joined
from .laws.control import Controller
from .laws.references import References, ReferenceTimeouts
from .machine.commands import Commands, timeout_cycles
from .machine.machine import Machine
from .machine.motors import Feedforward, MotorAccess, mix_of
from .machine.requests import Contacts, Requests, StartUp
from .state import StateArrays
from .terms.drives import DriveReport
from .terms.faults import Events
from .terms.measurement import UNREAD, Actuation, Measurement
from .watch.external_torque import ExternalTorques
from .watch.fault_monitor import EmergencyStop, FaultMonitor
from .watch.freeze_frame import FreezeFrames


class Engine:
    """State and control cycle of a board's joints.

    Args:
        config: of the joints, of all parts where there are several.
        zones: the parts, each with events of its own.

    Attributes: config, limits, state, torque_sensor (where a torque is known, shape (n,)), drives
    (what each reports of itself; empty: nothing), checked (when the last reading was, s of the
    clock handed to ``tick``), and the components that the module names.
    """

    def __init__(self, config: BoardConfig, zones: Sequence[Zone]) -> None:
        self.config, self.limits = config, BoardLimits.of(config)
        self._asked, self.checked = config, 0.0
        self.drives: Sequence[DriveReport] = ()
        self._narrowed: Callable[[BoardConfig], BoardConfig] = lambda config: config
        self.state = state = StateArrays(config.names)
        state.measured[UNREAD] = np.nan  # until the first reading (B7)
        self.events = Events({j: zone.name for zone in zones for j in zone.config.names})
        self.torques = ExternalTorques(config, state)
        self.torque_sensor = self.torques.known
        self.controller = Controller(config, state)
        self.references = References(
            config, state, self.controller.joints, self.controller.efforts
        )
        self.emergency = EmergencyStop(config.heartbeat_timeout)
        self.monitor = FaultMonitor(config, state, self.emergency)
        self.timeouts = timeouts = ReferenceTimeouts(timeout_cycles(config))
        self.frames = FreezeFrames(state, config.period)
        self.machine = Machine(
            config,
            state,
            self.controller,
            self.references,
            timeouts,
            self.monitor,
            self.events,
            joint=self.torques.joint,
            on_fault=self.frames.fault,
        )
        self.brakes = brakes = self.machine.brakes
        self.mix = mix_of(config, self.controller.joints)
        output, powered = state.output, state.powered
        if self.mix is not None:
            output, powered = self.mix.pwm, self.mix.powered
        self._actuation = Actuation(output, powered, state.kinds, state.set_points, brakes.orders)
        self.start_up = StartUp(self.machine)
        self.requests = Requests(self.machine)
        self.contacts = Contacts(self.machine, self.requests, zones)
        self.commands = Commands(self.machine, self.limits)
        self.feedforward = Feedforward(self.machine)
        self.motors = MotorAccess(self.machine, self.limits, self.mix)
        for zone in zones:
            self._start(zone)

    def tick(
        self,
        measurement: Measurement,
        now: float | None = None,
        clock: Callable[[], float] | None = None,
    ) -> Actuation:
        """One control cycle; see :meth:`Board.tick`."""
        machine, monitor = self.machine, self.monitor
        if self.torques.joints:
            measurement = self.torques.fill(measurement)
        self._read(measurement)
        if self.start_up.due:
            monitor.replace_broken()
            self.start_up.complete()
        monitor.reasons = measurement.reasons
        for j in measurement.lost:
            machine.calibrations.lose(j)
        self.emergency.watch(measurement.time if now is None else now)
        if not monitor.healthy():
            machine.check_faults()
        if monitor.has_news():
            machine.warn_of_heat()
        if self.brakes.there:
            self.brakes.switches = measurement.brakes
            self.brakes.step()
        if machine.calibrations.running:
            machine.calibrations.step()
        if (late := self.timeouts.expired(self.state.clock)) is not None:
            machine.expire(late)
        if clock is not None:
            self.checked = clock()
        if self.controller.step(measurement.elapsed or 0.0):
            machine.raise_divergence()
            machine.warn_of_limits()
            self.contacts.react()
        self.state.cycle += 1
        self.frames.note()
        if self.mix is not None:
            state, caps = self.state, self.controller.caps[1]
            self.mix.drive(state.output, state.velocity, state.powered, caps)
            monitor.set_supplied(self.mix.powered)
        return self._actuation

    def _read(self, measurement: Measurement) -> None:
        state = self.state
        state.time, elapsed = measurement.time, measurement.elapsed
        state.periods = 1.0 if elapsed is None else elapsed / self.config.period
        state.clock += state.periods
        self.monitor.take(measurement.values, measurement.motors)
        self.drives = measurement.drives or self.drives
        if self.mix is not None:
            self.mix.axis_currents(state.current)
        if measurement.applied is not None:
            np.copyto(state.applied, measurement.applied)
        if self.machine.calibrations.shifted:
            state.position -= state.offset

    def power_on(self, zone: Zone) -> None:
        """Restart the joints of a part (N1)."""
        self.state.power_on(zone.joints)
        self.controller.power_on(zone)
        self.motors.retune()
        self.references.power_on(zone.joints, self.config)
        self.monitor.power_on(zone.joints)
        self._start(zone)

    def _start(self, zone: Zone) -> None:
        self.machine.power_on(zone.joints)
        self.start_up.power_on(zone.joints, autoconfigure=zone.config.autoconfigure)

    def take_config(self, part: str, config: BoardConfig) -> None:
        """Use a new configuration of a part, or of all; see :meth:`JointGroup.reconfigure`."""
        if part:
            config = joined({**self._asked.parts, part: config})
        asked, config = config, self._narrowed(config)
        self.controller.check_payloads(config)
        self._asked = asked
        self.config, self.limits = config, BoardLimits.of(config)
        self.controller.reconfigure(config)
        self.monitor.reconfigure(config)
        self.commands.reconfigure(self.limits)
        self.motors.limits = self.limits
        self.torques.reconfigure(config)
        self.machine.reconfigure(config, timeout_cycles(config))

    def narrow(self, narrowed: Callable[[BoardConfig], BoardConfig]) -> None:
        """Apply ``narrowed`` to the configuration, now and after each change of it (S4).

        Raises:
            ConfigError: the result is not valid; nothing changes.
        """
        before, self._narrowed = self._narrowed, narrowed
        try:
            self.take_config("", self._asked)
        except ConfigError:
            self._narrowed = before
            raise

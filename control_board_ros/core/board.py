# SPDX-License-Identifier: Apache-2.0
"""The control board: the one object with state (SPEC A offered in process).

A board is driven by whoever holds it: ``actuation = board.tick(measurement)`` is one control
cycle, the set methods take effect for all their joints between two cycles. It has no clock,
thread or lock; callers from several threads bring their own. Nothing that a user or a robot
does raises: set methods answer with a Reply, joints fault. Only get methods raise, a
RequestError, when they are asked for a joint that does not exist.

The parts: ``machine`` (modes, faults, calibrations), ``requests`` (for modes), ``start_up``,
``commands`` (references of users), ``references`` (what runs), ``controller`` (the laws),
``monitor`` (causes of faults).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..protocols import Floats, Joints, ModeShortcuts, Values
from .commands import Commands, timeout_cycles
from .config import BoardConfig, ConfigError
from .control import Controller
from .events import BoardEvent, Events
from .fault_monitor import FaultMonitor
from .feedforward import Feedforward
from .get_methods import GetMethods
from .limits import BoardLimits
from .machine import Machine
from .measurement import Actuation, Measurement
from .mode_methods import ModeMethods
from .modes import POWER_OFF, Stage
from .offered import offered
from .reference_methods import ReferenceMethods
from .references import References
from .reply import Reply, accepted
from .requests import Requests
from .selection import Selection, Selector
from .setting_methods import SettingMethods
from .start_up import StartUp
from .state import Snapshot, StateArrays
from .stops import Stops
from .timeouts import ReferenceTimeouts
from .vocabs import CommandKind

__all__ = ["Board", "BoardEvent", "CommandKind"]


class Board(ModeShortcuts):
    """The control board of some joints; see the module for how it is used.

    In every method ``joints`` is an index, a name, a sequence of them, or None for all; values
    have shape (k,), one per joint, or are one number for all. Units: rad, rad/s, rad/s², N·m,
    percent; m, N where a joint slides.

    Attributes: config, names, count, period (s), selector, limits, state, and the parts.
    """

    def __init__(self, config: BoardConfig) -> None:
        self.config = config
        self.names, self.count, self.period = config.names, len(config.joints), config.period
        self.selector = Selector(config.names)
        self.state = StateArrays(config)
        self.events = Events()
        self._last = self.state.measured.copy()
        self._torque_sensor = np.array([joint.torque_sensor for joint in config.joints])
        self._actuation = Actuation(pwm=self.state.output, powered=self.state.powered)
        self._setting_methods = SettingMethods(self)
        self._power_on()

    def _power_on(self) -> None:
        """Make everything that a power-on makes anew (N1)."""
        config, state = self.config, self.state
        self.limits = BoardLimits.of(config)
        self.controller = Controller(config, state)
        self.references = References(config, self.limits, state, self.controller.joints)
        self.monitor = FaultMonitor(config, state)
        self.machine = Machine(
            config,
            state,
            self.controller,
            self.references,
            ReferenceTimeouts(timeout_cycles(config)),
            self.monitor,
            self.events,
        )
        self.start_up = StartUp(self.machine)
        self.requests = Requests(self.machine)
        self.commands = Commands(self.machine, self.selector, self.limits)
        self.feedforward = Feedforward(self.machine, self.selector, self.commands.reject)
        self.stops = Stops(self.machine, self.selector)
        self._mode_methods = ModeMethods(self.selector, self.requests.request)
        self._reference_methods = ReferenceMethods(self.commands)
        self._get_methods = GetMethods(self.machine, self.selector)

    # --- the cycle --------------------------------------------------------------------------

    def tick(self, measurement: Measurement) -> Actuation:
        """One control cycle: from what was measured to what the motors get.

        Args:
            measurement: values of shape (ROWS, n), read before this cycle acts.

        Returns:
            The PWM and the bridges; the arrays are the board's own, valid until the next tick.
        """
        machine, monitor = self.machine, self.monitor
        self._read(measurement)
        if self.start_up.due:
            monitor.replace_broken(self._last)
            self.start_up.complete()
        monitor.reasons = measurement.reasons
        if not monitor.healthy(measurement.values):
            machine.check_faults(self._last)
        if monitor.has_news():
            machine.warn_of_heat()
        if machine.calibrations:
            machine.calibrations.step()
        machine.expire()
        if self.controller.step():
            machine.warn_of_limits()
        self.state.cycle += 1
        return self._actuation

    def _read(self, measurement: Measurement) -> None:
        state = self.state
        state.time = measurement.time
        self._last[:] = state.measured
        state.measured[:] = measurement.values
        if self.machine.calibrations.shifted:
            state.position -= state.offset

    # --- the whole board ----------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time of the last reading, s."""
        return self.state.time

    @property
    def cycle(self) -> int:
        """Control cycles so far."""
        return self.state.cycle

    @property
    def modes_version(self) -> int:
        """Grows when a mode changes."""
        return self.state.modes_version

    @property
    def faults_version(self) -> int:
        """Grows when a fault record changes."""
        return self.state.faults_version

    @property
    def accepts(self) -> NDArray[np.bool_]:
        """Whether each joint takes references of a kind now (M3), shape (kinds, n)."""
        return self.state.accepts

    @property
    def rejected_commands(self) -> NDArray[np.uint64]:
        """How many commands of each joint were ignored so far (M4), shape (n,)."""
        return self.state.rejected.copy()

    def snapshot(self) -> Snapshot:
        """All that the board shows, frozen; a new object, never changed afterwards."""
        state = self.state
        return Snapshot(
            state.time,
            state.cycle,
            state.block.copy(),
            state.done.copy(),
            state.rejected.copy(),
            state.calibrated.copy(),
            self.monitor.used.copy(),
            self._torque_sensor,
        )

    def take_events(self) -> list[BoardEvent]:
        """What happened since the last call, oldest first."""
        return self.events.take()

    configure = offered("start_up", StartUp.configure)
    await_configure = offered("start_up", StartUp.await_configure)

    def set_stage(self, stage: Stage) -> None:
        """Let the joints of a managed board go so far, and no further.

        UNCONFIGURED is a power-on that waits; on INACTIVE they are configured (N2) or lose their
        power; on ACTIVE they calibrate or start, as at N3. A fault stays, except at UNCONFIGURED.
        """
        before, self.state.stage = self.state.stage, stage
        if stage is Stage.UNCONFIGURED:
            self.power_cycle()
        elif before is Stage.UNCONFIGURED:
            self.start_up.begin()
        elif stage is Stage.INACTIVE:
            self.power_off()
        elif before is Stage.INACTIVE:
            self.start_up.activate()

    def power_cycle(self) -> None:
        """Back to power-on: NOT_CONFIGURED, no power, configured anew with autoconfigure (N1)."""
        self.state.power_on()
        self._power_on()

    def power_off(self) -> None:
        """Take the power of every joint; a calibration is aborted (K2), a fault stays shown."""
        for name, mode in zip(self.names, self.get_control_mode(), strict=True):
            self.set_control_mode(name, POWER_OFF[mode])

    def reconfigure(self, config: BoardConfig) -> None:
        """Take new gains, limits and timeouts while running, without a jump.

        Raises:
            ConfigError: the joints, the rate or the kind of output differ.
        """
        for key in ("names", "control_rate", "output"):
            old, new = getattr(self.config, key), getattr(config, key)
            if old != new:
                raise ConfigError(key, new, f"fixed at {old!r} while the board runs")
        self.config, self.limits = config, BoardLimits.of(config)
        self.controller.reconfigure(config)
        self.monitor.reconfigure(config)
        self.references.reconfigure(self.limits)
        self.commands.reconfigure(self.limits)
        self.machine.reconfigure(config, timeout_cycles(config))

    # --- what users ask for, and read -----------------------------------------------------------

    set_control_mode = offered("_mode_methods", ModeMethods.set_control_mode)
    set_interaction_mode = offered("_mode_methods", ModeMethods.set_interaction_mode)
    calibrate = offered("_mode_methods", ModeMethods.calibrate)

    def command(
        self, kind: CommandKind, joints: Joints, values: Values, along: Values | None = None
    ) -> Reply:
        """Send references of one kind; ``commands.COMMANDS`` says what may come along."""
        return self.commands.command(kind, joints, values, along)

    position_move = offered("_reference_methods", ReferenceMethods.position_move)
    set_position = offered("_reference_methods", ReferenceMethods.set_position)
    velocity_move = offered("_reference_methods", ReferenceMethods.velocity_move)
    set_ref_torque = offered("_reference_methods", ReferenceMethods.set_ref_torque)
    set_output = offered("_reference_methods", ReferenceMethods.set_output)

    set_feedforward = offered("feedforward", Feedforward.set_feedforward)
    position_move_within = offered("commands", Commands.position_move_within)
    get_move_time = offered("commands", Commands.get_move_time)
    stop = offered("stops", Stops.stop)
    reject = offered("commands", Commands.reject)

    set_impedance = offered("_setting_methods", SettingMethods.set_impedance)
    get_max_impedance = offered("_setting_methods", SettingMethods.get_max_impedance)
    set_ref_speed = offered("_setting_methods", SettingMethods.set_ref_speed)
    set_ref_acceleration = offered("_setting_methods", SettingMethods.set_ref_acceleration)
    set_reference_speed = offered("_setting_methods", SettingMethods.set_reference_speed)

    get_control_mode = offered("_get_methods", GetMethods.get_control_mode)
    get_available_modes = offered("_get_methods", GetMethods.get_available_modes)
    get_interaction_mode = offered("_get_methods", GetMethods.get_interaction_mode)
    get_faults = offered("_get_methods", GetMethods.get_faults)
    get_calibration = offered("_get_methods", GetMethods.get_calibration)
    get_encoder = offered("_get_methods", GetMethods.get_encoder)
    get_encoder_speed = offered("_get_methods", GetMethods.get_encoder_speed)
    get_torque = offered("_get_methods", GetMethods.get_torque)
    get_target_position = offered("_get_methods", GetMethods.get_target_position)
    get_ref_position = offered("_get_methods", GetMethods.get_ref_position)
    get_ref_velocity = offered("_get_methods", GetMethods.get_ref_velocity)
    get_ref_torque = offered("_get_methods", GetMethods.get_ref_torque)
    get_output = offered("_get_methods", GetMethods.get_output)
    check_motion_done = offered("_get_methods", GetMethods.check_motion_done)
    get_remaining_time = offered("_get_methods", GetMethods.get_remaining_time)
    get_impedance = offered("_get_methods", GetMethods.get_impedance)
    get_torque_offset = offered("_get_methods", GetMethods.get_torque_offset)
    get_ref_speed = offered("_get_methods", GetMethods.get_ref_speed)
    get_ref_acceleration = offered("_get_methods", GetMethods.get_ref_acceleration)

    # --- what is checked, taken ------------------------------------------------------------------

    def take_impedance(
        self, chosen: Selection, stiffness: Floats, damping: Floats | None
    ) -> Reply:
        """Take springs and dampers that are checked, shape (k,); see SettingMethods."""
        self.controller.set_impedance(chosen.joints, stiffness, damping)
        return accepted(chosen.names)

    def take_reference_speed(
        self, chosen: Selection, speeds: Floats | None, accelerations: Floats | None
    ) -> Reply:
        """Take reference speeds and accelerations that are checked, shape (k,); likewise."""
        if speeds is not None:
            self.references.speed[chosen.joints] = speeds
        if accelerations is not None:
            self.references.acceleration[chosen.joints] = accelerations
        return accepted(chosen.names)

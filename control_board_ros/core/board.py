# SPDX-License-Identifier: Apache-2.0
"""The control board: the one object with state (SPEC A offered in process).

A board is driven by whoever holds it: ``actuation = board.tick(measurement)`` is one control
cycle, the set methods take effect for all their joints between two cycles. It has no clock,
thread or lock; callers from several threads bring their own. Nothing that a user or a robot
does raises: set methods answer with a Reply, joints fault. Only get methods raise, a
RequestError, when they are asked for a joint that does not exist.

The parts: ``machine`` (modes, faults, calibrations), ``commands`` (references of users),
``references`` (what runs), ``controller`` (the laws), ``monitor`` (causes of faults).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..protocols import Floats, Interaction, Joints, Mode, ModeShortcuts, Values
from .calibration import CalibrationStatus
from .commands import Commands, timeout_cycles
from .config import BoardConfig, ConfigError
from .control import Controller
from .events import BoardEvent, Events
from .explanations import explain_limit
from .fault_monitor import FaultMonitor
from .faults import FaultRecord
from .limits import BoardLimits
from .machine import Machine
from .measurement import Actuation, Measurement, Row
from .modes import CONFIGURED, POWER_OFF, Event, Stage
from .references import References
from .reply import Reply, accepted, refused
from .selection import RequestError, Selector, all_within, control_modes, interaction_modes
from .state import Snapshot, State
from .timeouts import ReferenceTimeouts
from .vocabs import CommandKind, ControlMode, InteractionMode

__all__ = ["Board", "BoardEvent", "CommandKind"]

K = CommandKind
T = TypeVar("T")


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
        self.state = State(config)
        self.events = Events()
        self._last = self.state.measured.copy()
        self._torque_sensor = np.array([joint.torque_sensor for joint in config.joints])
        self._actuation = Actuation(pwm=self.state.output, powered=self.state.powered)
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
        self.commands = Commands(self.machine, self.selector, self.limits)
        self._blind = True  # no reading since power-on
        self._on_limit = [False] * self.count

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
        if machine.configure_next:
            monitor.replace_broken(self._last)
            machine.complete_configuration(blind=False)
        monitor.reasons = measurement.reasons
        if not monitor.healthy(measurement.values):
            machine.check_faults(self._last)
        if monitor.has_news():
            machine.warn_of_heat()
        if machine.calibrations:
            machine.calibrations.step()
        machine.expire()
        if self.controller.step():
            self._warn_of_limits()
        self.state.cycle += 1
        return self._actuation

    def _read(self, measurement: Measurement) -> None:
        state = self.state
        state.time = measurement.time
        self._last[:] = state.measured
        state.measured[:] = measurement.values
        self._blind = False
        if self.machine.calibrations.shifted:
            state.position -= state.offset

    def _warn_of_limits(self) -> None:
        """Tell which joints are beyond their software limits that were not before (P9)."""
        on_limit = [joint.on_limit for joint in self.controller.joints]
        for j, (now, before) in enumerate(zip(on_limit, self._on_limit, strict=True)):
            if now and not before:
                position = float(self.state.measured[Row.POSITION, j])
                text = explain_limit(self.config.joints[j], position)
                self.machine.tell("warning", "limit", j, text)
        self._on_limit = on_limit

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

    def configure(self) -> Reply:
        """The whole configuration is in: at its reading a joint leaves NOT_CONFIGURED (N2)."""
        if self.state.stage is Stage.UNCONFIGURED:
            text = "the node is unconfigured; use the transition configure of its lifecycle"
            return refused(text, self.names)
        if all(mode in CONFIGURED for mode in self.state.control_modes):
            text = "the board is configured already; power_cycle takes it back"
            return refused(text, self.names)
        self.machine.complete_configuration(blind=self._blind)
        return accepted(self.names)

    def await_configure(self) -> None:
        """Stay NOT_CONFIGURED until :meth:`configure`, also with autoconfigure (R4)."""
        self.machine.configure_next = False

    def set_stage(self, stage: Stage) -> None:
        """Let the joints of a managed board go so far, and no further.

        UNCONFIGURED is a power-on that waits; on INACTIVE they are configured (N2) or lose their
        power; on ACTIVE they calibrate or start, as at N3. A fault stays, except at UNCONFIGURED.
        """
        before, self.state.stage = self.state.stage, stage
        if stage is Stage.UNCONFIGURED:
            self.power_cycle()
        elif before is Stage.UNCONFIGURED:
            self.machine.complete_configuration(blind=self._blind)
        elif stage is Stage.INACTIVE:
            self.power_off()
        elif before is Stage.INACTIVE:
            self.machine.activate()

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

    # --- modes --------------------------------------------------------------------------------

    def set_control_mode(self, joints: Joints, modes: Mode | Sequence[Mode]) -> Reply:
        """Ask for control modes: enumeration, code, name or vocab (M1, M5 to M8, F2, F4)."""
        try:
            chosen = self.selector.select(joints)
            wanted = control_modes(modes, len(chosen.names))
        except ValueError as error:
            return self._refuse(joints, error)
        return self.machine.request(chosen, wanted)

    def get_control_mode(self, joints: Joints = None) -> list[ControlMode]:
        """The modes that joints are in, also the statuses HW_FAULT, CALIBRATING, …"""
        return self._pick(joints, self.state.control_modes)

    def get_available_modes(
        self, joints: Joints = None
    ) -> list[tuple[tuple[ControlMode, ...], tuple[InteractionMode, ...]]]:
        """What each joint implements: control modes, and interaction modes."""
        chosen = self._pick(joints, self.config.joints)
        return [(joint.control_modes, joint.interaction_modes) for joint in chosen]

    def set_interaction_mode(
        self, joints: Joints, modes: Interaction | Sequence[Interaction]
    ) -> Reply:
        """Ask for interaction modes; in an active mode a change stops the joint (I1 to I7)."""
        try:
            chosen = self.selector.select(joints)
            wanted = interaction_modes(modes, len(chosen.names))
        except ValueError as error:
            return self._refuse(joints, error)
        return self.machine.request(chosen, wanted)

    def get_interaction_mode(self, joints: Joints = None) -> list[InteractionMode]:
        """The interaction modes as stored, also where they do not act (I2)."""
        return self._pick(joints, self.state.interaction_modes)

    def get_faults(self, joints: Joints = None) -> list[FaultRecord]:
        """The last fault of each joint, active or not (F5)."""
        return self._pick(joints, self.state.faults)

    def calibrate(self, joints: Joints = None) -> Reply:
        """Start the calibration of joints, group after group (K1)."""
        try:
            chosen = self.selector.select(joints)
        except RequestError as error:
            return self._refuse(joints, error)
        return self.machine.request(chosen, [Event.CALIBRATE] * len(chosen.names))

    def get_calibration(self, joints: Joints = None) -> list[CalibrationStatus]:
        """How the last calibration of each joint stands, and whether it is calibrated (K7)."""
        return [self.machine.calibrations.status(j) for j in self._numbers(joints)]

    # --- references ---------------------------------------------------------------------------

    def command(
        self, kind: CommandKind, joints: Joints, values: Values, along: Values | None = None
    ) -> Reply:
        """Send references of one kind; ``commands.COMMANDS`` says what may come along."""
        return self.commands.command(kind, joints, values, along)

    def position_move(
        self, joints: Joints, positions: Values, speeds: Values | None = None
    ) -> Reply:
        """Start minimum-jerk moves at the set reference speeds, or at the speeds given (P1)."""
        return self.commands.command(K.POSITION, joints, positions, speeds)

    def get_move_time(self, joints: Joints, positions: Floats, speeds: Floats) -> Floats:
        """How long position moves would take from now on, s; arrays of shape (k,)."""
        return self.commands.move_times(joints, positions, speeds)

    def position_move_within(self, joints: Joints, positions: Floats, time: float) -> Reply:
        """Start position moves that all arrive after so many s, or none of them (R5)."""
        return self.commands.move_within(joints, positions, time)

    def set_position(
        self, joints: Joints, positions: Values, velocities: Values | None = None
    ) -> Reply:
        """Step the position reference (P4).

        Args:
            joints: whose reference it is.
            positions: rad.
            velocities: the references' own velocities, rad/s; None: the board takes the mean of
                those that follow each other closely, and 0 for a single step.
        """
        return self.commands.command(K.POSITION_DIRECT, joints, positions, velocities)

    def velocity_move(
        self, joints: Joints, velocities: Values, accelerations: Values | None = None
    ) -> Reply:
        """Set the reference velocity, reached with the reference acceleration (P5)."""
        return self.commands.command(K.VELOCITY, joints, velocities, accelerations)

    def set_ref_torque(self, joints: Joints, torques: Values) -> Reply:
        """Set the reference torque (P7)."""
        return self.commands.command(K.TORQUE, joints, torques)

    def set_output(self, joints: Joints, outputs: Values) -> Reply:
        """Set the PWM in percent (P8)."""
        return self.commands.command(K.OUTPUT, joints, outputs)

    def set_feedforward(
        self, joints: Joints, outputs: Values | None = None, torques: Values | None = None
    ) -> Reply:
        """Set u_ff (percent) and τ_ff (N·m), either or both; they act as P11."""
        return self.commands.feedforward(joints, outputs, torques)

    def stop(self, joints: Joints = None) -> Reply:
        """Set the position reference to the measured position; the mode stays (P3)."""
        return self.commands.stop(joints)

    def reject(self, joints: Joints, message: str) -> Reply:
        """Refuse and count a command that was found wrong before it came here (P13)."""
        return self.commands.reject(joints, message)

    def get_target_position(self, joints: Joints = None) -> Floats:
        """The last accepted target of a position move (M11)."""
        return self._last_of(K.POSITION, joints)

    def get_ref_position(self, joints: Joints = None) -> Floats:
        """The last accepted direct position (M11)."""
        return self._last_of(K.POSITION_DIRECT, joints)

    def get_ref_velocity(self, joints: Joints = None) -> Floats:
        """The last accepted velocity (M11)."""
        return self._last_of(K.VELOCITY, joints)

    def get_ref_torque(self, joints: Joints = None) -> Floats:
        """The last accepted torque (M11)."""
        return self._last_of(K.TORQUE, joints)

    def get_output(self, joints: Joints = None) -> Floats:
        """The last accepted output (M11)."""
        return self._last_of(K.OUTPUT, joints)

    def check_motion_done(self, joints: Joints = None) -> list[bool]:
        """False from the cycle that accepts a move until its profile ends (P3)."""
        return [bool(self.state.done[j]) for j in self._numbers(joints)]

    def get_remaining_time(self, joints: Joints = None) -> Floats:
        """Time until the position moves end, s."""
        return self.references.remaining(self.selector.select(joints).joints)

    # --- what is measured -----------------------------------------------------------------------

    def get_encoder(self, joints: Joints = None) -> Floats:
        """Measured positions."""
        return self.state.position[self.selector.select(joints).joints]

    def get_encoder_speed(self, joints: Joints = None) -> Floats:
        """Measured velocities."""
        return self.state.velocity[self.selector.select(joints).joints]

    def get_torque(self, joints: Joints = None) -> Floats:
        """Measured torques; NaN without a torque sensor."""
        chosen = self.selector.select(joints).joints
        return np.where(self._torque_sensor[chosen], self.state.torque[chosen], np.nan)

    # --- settings -------------------------------------------------------------------------------

    def set_impedance(
        self, joints: Joints, stiffness: Values, damping: Values | None = None
    ) -> Reply:
        """Set spring and damper, at any time; they act in the next cycle (I6).

        Args:
            joints: whose they are.
            stiffness: N·m/rad.
            damping: N·m·s/rad; None: what goes with the stiffness (``damping_for``).
        """
        limits = self.limits
        try:
            chosen = self.selector.select(joints)
            spring = all_within(chosen, "stiffness", stiffness, limits.stiffness, zero=True)
            damper = None
            if damping is not None:
                damper = all_within(chosen, "damping", damping, limits.damping, zero=True)
        except RequestError as error:
            return self._refuse(joints, error)
        self.controller.set_impedance(chosen.joints, spring, damper)
        return accepted(chosen.names)

    def get_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """Stiffness and damping, two arrays."""
        own = self._pick(joints, self.controller.joints)
        return np.array([j.stiffness for j in own]), np.array([j.damping for j in own])

    def get_max_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """The largest stiffness and damping that a joint takes, two arrays."""
        chosen = self.selector.select(joints).joints
        return self.limits.stiffness[chosen], self.limits.damping[chosen]

    def get_torque_offset(self, joints: Joints = None) -> Floats:
        """τ_ff of the impedance law: as a user set it, else the load on entering COMPLIANT."""
        own = self._pick(joints, self.controller.joints)
        return np.array([j.torque_offset if j.offset_given else j.load_taken for j in own])

    def set_ref_speed(self, joints: Joints, speeds: Values) -> Reply:
        """Set the mean speed of later position moves (P2)."""
        return self.set_reference_speed(joints, speeds=speeds)

    def set_ref_acceleration(self, joints: Joints, accelerations: Values) -> Reply:
        """Set the acceleration of later velocity references (P5)."""
        return self.set_reference_speed(joints, accelerations=accelerations)

    def set_reference_speed(
        self, joints: Joints, speeds: Values | None = None, accelerations: Values | None = None
    ) -> Reply:
        """Set reference speeds, accelerations or both, checked together (P2)."""
        given = [
            (what, values, most, target)
            for what, values, most, target in (
                ("speed", speeds, self.limits.velocity, self.references.speed),
                (
                    "acceleration",
                    accelerations,
                    self.limits.acceleration,
                    self.references.acceleration,
                ),
            )
            if values is not None
        ]
        try:
            if not given:
                raise RequestError("neither speeds nor accelerations given; send one or both")
            chosen = self.selector.select(joints)
            taken = [all_within(chosen, what, values, most) for what, values, most, _ in given]
        except RequestError as error:
            return self._refuse(joints, error)
        for (*_, target), values in zip(given, taken, strict=True):
            target[chosen.joints] = values
        return accepted(chosen.names)

    def get_ref_speed(self, joints: Joints = None) -> Floats:
        """Mean speeds of position moves."""
        return self.references.speed[self.selector.select(joints).joints]

    def get_ref_acceleration(self, joints: Joints = None) -> Floats:
        """Accelerations of velocity references."""
        return self.references.acceleration[self.selector.select(joints).joints]

    # --- helpers --------------------------------------------------------------------------------

    def _refuse(self, joints: Joints, error: ValueError) -> Reply:
        """Refuse a whole request; the reply names its joints where they exist (M6, M7)."""
        try:
            names = self.selector.select(joints).names
        except RequestError:
            names = ()
        return refused(str(error), names)

    def _numbers(self, joints: Joints) -> list[int]:
        numbers: list[int] = self.selector.select(joints).joints.tolist()
        return numbers

    def _pick(self, joints: Joints, values: Sequence[T]) -> list[T]:
        return [values[j] for j in self._numbers(joints)]

    def _last_of(self, kind: CommandKind, joints: Joints) -> Floats:
        values: Floats = self.references.last[kind, self.selector.select(joints).joints]
        return values

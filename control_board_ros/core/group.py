# SPDX-License-Identifier: Apache-2.0
"""The interfaces of SPEC A, for all joints of a board or for those of a part (M, P, R3).

A request is checked whole, then decided joint by joint (M7). In every method ``joints`` is an
index in the group, a name, a sequence of them, or None for all; values have shape (k,), one per
joint, or are one number for all. Units: rad, rad/s, rad/s², N·m, percent; m, N where a joint
slides. Set methods answer with a Reply. Get methods return one entry per joint in the order asked,
and raise a RequestError for a joint that does not exist.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from .calibration.calibrations import CalibrationStatus
from .config.config import BoardConfig, ConfigError, JointConfig, Zone
from .engine import Engine
from .machine.decisions import Requested
from .machine.explanations import LEAST_RATE
from .machine.motors import shaft_readings
from .model.coupling import Coupling
from .old_names import ModeShortcuts
from .selection import (
    RequestError,
    Selection,
    Selector,
    all_within,
    automatic,
    brake_modes,
    by_hand,
    control_modes,
    finite,
    interaction_modes,
    loop_of,
    spread,
)
from .state import Snapshot, StateArrays
from .terms.arguments import Array, Flags, Joints, Values, releases
from .terms.drives import DriveReport, DriveUse
from .terms.faults import BoardEvent, FaultRecord
from .terms.modes import CONFIGURED, DIRECT_VELOCITY, POWER_OFF, Event, Stage
from .terms.motors import Motors, Pids
from .terms.reply import Answer, JointAnswer, MotionDone, Reason, Reply, accepted, decided, refused
from .terms.vocabs import (
    BrakeMode,
    CommandKind,
    ControlMode,
    Interaction,
    InteractionMode,
    Mode,
    Vocab,
)
from .watch.freeze_frame import FreezeFrame

K = CommandKind


class JointGroup(ModeShortcuts):
    """Joints of a board that follow each other there: a part of a robot, or all of them.

    Args:
        engine: of the board whose joints they are.
        zone: which of them.

    Attributes: engine, name (of the part; empty: all joints), names, joints (the board's numbers
    of them), count, period (s), selector (its selections have the board's numbers, too), state
    (of the whole board).
    """

    def __init__(self, engine: Engine, zone: Zone) -> None:
        self.engine, self.name, self.joints = engine, zone.name, zone.joints
        self.names, self.period = zone.config.names, zone.config.period
        self.count = len(zone.joints)
        self.selector = Selector(self.names, zone.columns.start)
        self.state: StateArrays = engine.state
        self._columns, self._unknown = zone.columns, 0

    # --- modes --------------------------------------------------------------------------------

    def set_control_mode(self, joints: Joints, modes: Mode | Sequence[Mode]) -> Reply:
        """Set control modes: enumeration, code, name or vocab (M1, M5 to M8, F2, F4)."""
        return self._ask(joints, lambda count: control_modes(modes, count), self.get_control_mode)

    def set_interaction_mode(
        self, joints: Joints, modes: Interaction | Sequence[Interaction]
    ) -> Reply:
        """Set interaction modes; in an active mode a change stops the joint (I1 to I7)."""
        return self._ask(
            joints, lambda count: interaction_modes(modes, count), self.get_interaction_mode
        )

    def calibrate(self, joints: Joints = None) -> Reply:
        """Start the calibration of joints, group after group (K1); parts side by side."""
        return self._ask(joints, lambda count: [Event.CALIBRATE] * count)

    def recover(self, joints: Joints = None, *, partial: bool = False) -> Reply:
        """Leave HW_FAULT for the modes that the joints had before, where they are now (E1).

        Args:
            joints: which; None: all that are in fault.
            partial: whether those whose cause is gone do so where others must wait; else all of
                them or none.

        Returns:
            With ``waits`` and ``modes``; of all joints, unchanged, where none is in fault.
        """
        try:
            selection = self.selector.select(joints)
        except RequestError as error:
            return self.selector.refuse(joints, error)
        if selection is self.selector.everyone:
            faulted = [name for name in self.names if self.get_faults(name)[0].active]
            selection = self.selector.select(faulted)
        reply = self.engine.requests.recover(selection, partial=partial)
        return reply.with_modes(self.get_control_mode(reply.joints))

    def emergency_stop(self, stop: bool = True) -> None:
        """Put every joint of the whole board into HW_FAULT in the next cycle (E2).

        False releases the stop; whatever else is given stops, as None for all joints.
        Released, the joints stay there until FORCE_IDLE, or ``recover`` (F2).
        """
        self.engine.emergency.ask(not releases(stop))

    def beat(self, now: float | None = None) -> None:
        """Record a heartbeat (E2); now: as :meth:`Board.tick` has it."""
        self.engine.emergency.beat(self.time if now is None else now)

    def _checked(self, joints: Joints, answer: Callable[[Selection], Reply]) -> Reply:
        """The answer to a request; a RequestError of its checks refuses all of it (M7)."""
        try:
            return answer(self.selector.select(joints))
        except RequestError as error:
            return self.selector.refuse(joints, error)

    def _ask(
        self,
        joints: Joints,
        requests_of: Callable[[int], Sequence[Requested]],
        read: Callable[[Joints], Sequence[Vocab]] = lambda _: (),
    ) -> Reply:
        """Decide a request.

        Args:
            joints: of the request.
            requests_of: returns the request of each joint for a number of joints.
            read: the modes after it, of joints that exist.
        """
        try:
            selection = self.selector.select(joints)
        except RequestError as error:
            return self.selector.refuse(joints, error)
        try:
            requested = requests_of(len(selection.names))
        except ValueError as error:
            reply = self.selector.refuse(joints, error)
        else:
            reply = self.engine.requests.request(selection, requested)
        return reply.with_modes(read(selection.names))

    # --- references ---------------------------------------------------------------------------

    def command(
        self,
        kind: CommandKind,
        joints: Joints,
        values: Values,
        along: Values | None = None,
        *,
        together: bool = False,
        time: float | None = None,
        valid_for: float = 0.0,
        sampled: bool = False,
    ) -> Reply:
        """Send references of one kind, as :meth:`Commands.command`; see COMMANDS for ``along``."""
        try:
            selection = self.selector.select(joints)
            return self.engine.commands.command(
                *(kind, selection, values, along),
                together=together,
                time=time,
                valid_for=valid_for,
                sampled=sampled,
            )
        except RequestError as error:
            return self.reject(joints, f"{kind} reference ignored: {error}")

    def position_move(
        self, joints: Joints, positions: Values, speeds: Values | None = None
    ) -> Reply:
        """Start minimum-jerk moves at the set reference speeds, or at the speeds given (P1)."""
        return self.command(K.POSITION, joints, positions, speeds)

    def set_position(
        self, joints: Joints, positions: Values, velocities: Values | None = None
    ) -> Reply:
        """Step the position reference (P4).

        Args:
            joints: whose reference it is.
            positions: rad.
            velocities: the references' own velocities, rad/s; None: the board uses the mean of
                those that follow each other closely, and 0 for a single step.
        """
        return self.command(K.POSITION_DIRECT, joints, positions, velocities)

    def velocity_move(
        self, joints: Joints, velocities: Values, accelerations: Values | None = None
    ) -> Reply:
        """Set the reference velocity, reached with the reference acceleration (P5)."""
        return self.command(K.VELOCITY, joints, velocities, accelerations)

    def set_ref_velocity(self, joints: Joints, velocities: Values) -> Reply:
        """Set the velocity reference of VELOCITY_DIRECT, without a ramp, rad/s or m/s (Y1)."""
        return self.command(K.VELOCITY_DIRECT, joints, velocities)

    def set_ref_torque(self, joints: Joints, torques: Values) -> Reply:
        """Set the reference torque, N·m or N (P7)."""
        return self.command(K.TORQUE, joints, torques)

    def set_output(self, joints: Joints, outputs: Values) -> Reply:
        """Set the PWM in percent (P8)."""
        return self.command(K.OUTPUT, joints, outputs)

    def set_ref_current(self, joints: Joints, currents: Values) -> Reply:
        """Set the motor current, A, within ± peak current (Y2)."""
        return self.command(K.CURRENT, joints, currents)

    def set_feedforward(
        self,
        joints: Joints,
        outputs: Values | None = None,
        torques: Values | None = None,
        *,
        together: bool = False,
    ) -> Reply:
        """Set u_ff (percent) and τ_ff (N·m), either or both; they act as P11.

        With ``together`` all joints accept them or none does.
        """
        try:
            return self.engine.feedforward.set_feedforward(
                self.selector.select(joints), outputs, torques, together=together
            )
        except RequestError as error:
            return self.reject(joints, f"feedforward ignored: {error}")

    def stop(self, joints: Joints = None) -> Reply:
        """Set the position reference to the measured position; the mode stays (P3)."""
        return self._checked(joints, self.engine.requests.stop)

    def reject(self, joints: Joints, message: str, code: Reason = Reason.INVALID) -> Reply:
        """Refuse a command that is wrong as a whole; the joints that it names count it (P13)."""
        known = self.selector.known(joints)
        self.state.rejected[known] += np.uint64(1)
        self._unknown += not known
        return self.selector.refuse(joints, RequestError(message, code))

    def get_move_time(self, joints: Joints, positions: Array, speeds: Array) -> Array:
        """The duration of position moves that start now (P1), s, shape (k,).

        Args:
            joints: as in every request.
            positions: targets, shape (k,).
            speeds: mean speeds requested, above 0, shape (k,).
        """
        indices = self.selector.select(joints).joints
        return self.engine.commands.get_move_time(indices, positions, speeds)

    # --- brakes -------------------------------------------------------------------------------

    def set_brake(self, joints: Joints, modes: str | Sequence[str]) -> Reply:
        """Work brakes automatically, or keep them open or closed by hand (Y4).

        Args:
            joints: whose brakes; None: all that have one.
            modes: ``automatic``, ``open``, ``closed``: one for all, or one each.
        """
        try:
            selection = self._braked(joints)
            requested = brake_modes(modes, len(selection.names))
        except ValueError as error:
            return self.selector.refuse(joints, error)
        return self.engine.requests.set_brakes(selection, requested)

    def get_brake(self, joints: Joints = None) -> list[BrakeMode | None]:
        """Brake modes; None where a joint has no brake."""
        return [self.engine.brakes.mode(j) for j in self._numbers(joints)]

    def is_joint_braked(self, joints: Joints = None) -> list[bool]:
        """Whether brakes are closed; false where a joint has none."""
        closed: list[bool] = self.engine.brakes.closed[self._indices(joints)].tolist()
        return closed

    def set_manual_brake_active(self, joints: Joints, active: Flags) -> Reply:
        """Close (true) or open brakes by hand."""
        try:
            return self.set_brake(joints, by_hand(active))
        except RequestError as error:
            return self.selector.refuse(joints, error)

    def set_auto_brake_enabled(self, joints: Joints, enabled: Flags) -> Reply:
        """Switch brakes to automatic (true), or to manual in their present state."""
        try:
            names = self._braked(joints).names
            modes = automatic(enabled, self.is_joint_braked(names))
        except RequestError as error:
            return self.selector.refuse(joints, error)
        return self.set_brake(names, modes)

    def get_auto_brake_enabled(self, joints: Joints = None) -> list[bool]:
        """Whether brakes are automatic; false where a joint has none."""
        return [mode is BrakeMode.AUTOMATIC for mode in self.get_brake(joints)]

    def _braked(self, joints: Joints) -> Selection:
        """The selected joints; of all joints only those with a brake, if there are any."""
        selection, brakes = self.selector.select(joints), self.engine.brakes
        if selection is not self.selector.everyone or not brakes.there:
            return selection
        fitted = [k for k, j in enumerate(self.joints) if brakes.has(j)]
        return self.selector.select(fitted) if fitted else selection

    # --- settings -----------------------------------------------------------------------------

    def set_impedance(
        self, joints: Joints, stiffness: Values, damping: Values | None = None
    ) -> Reply:
        """Set spring and damper, at any time; they act in the next cycle (I6).

        Args:
            joints: whose they are.
            stiffness: N·m/rad.
            damping: N·m·s/rad; None: the damping of the stiffness (``damping_for``).
        """
        limits = self.engine.limits
        try:
            selection = self.selector.select(joints)
            units = ("N·m/rad", "N/m")
            spring = self._within(selection, "stiffness", stiffness, limits.stiffness, units)
            damper = None
            if damping is not None:
                units = ("N·m·s/rad", "N·s/m")
                damper = self._within(selection, "damping", damping, limits.damping, units)
        except RequestError as error:
            return self.selector.refuse(joints, error)
        self.engine.controller.set_impedance(selection.joints, spring, damper)
        return accepted(selection.names)

    def _within(
        self,
        selection: Selection,
        what: str,
        values: Values,
        highest: Array,
        units: tuple[str, str],
        lowest: float = 0.0,
    ) -> Array:
        """As ``all_within``; an error has the unit of the joint, which turns or slides."""
        kinds = self.engine.config.joints
        return all_within(
            *(selection, what, values, highest),
            lowest=np.full_like(highest, lowest),
            unit=lambda joint: kinds[joint].kind.choose(*units),
        )

    def get_max_impedance(self, joints: Joints = None) -> tuple[Array, Array]:
        """Maximum stiffness, N·m/rad, and damping, N·m·s/rad (or N/m, N·s/m); shape (k,) each."""
        limits, indices = self.engine.limits, self.selector.select(joints).joints
        return limits.stiffness[indices], limits.damping[indices]

    def set_ref_speed(self, joints: Joints, speeds: Values) -> Reply:
        """Set the mean speed of later position moves, rad/s or m/s (P2)."""
        return self.set_reference_speed(joints, speeds=speeds)

    def set_ref_acceleration(self, joints: Joints, accelerations: Values) -> Reply:
        """Set the acceleration of later velocity references, rad/s² or m/s² (P5)."""
        return self.set_reference_speed(joints, accelerations=accelerations)

    def set_reference_speed(
        self, joints: Joints, speeds: Values | None = None, accelerations: Values | None = None
    ) -> Reply:
        """Set reference speeds, accelerations or both, checked together (P2)."""
        limits, references = self.engine.limits, self.engine.references
        try:
            if speeds is None and accelerations is None:
                raise RequestError("neither speeds nor accelerations given; send one or both")
            selection = self.selector.select(joints)
            if speeds is not None:
                units, highest = ("rad/s", "m/s"), limits.velocity
                speeds = self._within(selection, "speed", speeds, highest, units, LEAST_RATE)
            if accelerations is not None:
                units, highest = ("rad/s²", "m/s²"), limits.acceleration
                accelerations = self._within(
                    selection, "acceleration", accelerations, highest, units, LEAST_RATE
                )
        except RequestError as error:
            return self.selector.refuse(joints, error)
        if speeds is not None:
            references.speed[selection.joints] = speeds
        if accelerations is not None:
            references.acceleration[selection.joints] = accelerations
        return accepted(selection.names)

    # --- motors and loops ---------------------------------------------------------------------

    def get_motors(self, joints: Joints = None) -> Motors:
        """Motors and amplifiers of joints as they are now (Y5)."""
        return self.engine.motors.motors(self._numbers(joints))

    def set_motors(
        self,
        joints: Joints,
        max_currents: Values | None = None,
        output_limits: Values | None = None,
        **terms: Values | None,
    ) -> Reply:
        """Set limits of amplifiers, and the motor constants of the laws (Y5); None: unchanged.

        A power-on forgets it. The new values act in the next cycle.

        Args:
            joints: whose they are.
            max_currents: the largest that the board requests, A, up to the peak current.
            output_limits: the largest PWM, percent, up to the configured.
            terms: constants and friction, by the names in ``terms.motors.TERMS``.
        """
        caps = {"max_currents": max_currents, "output_limits": output_limits}
        return self._checked(
            joints, lambda selection: self.engine.motors.set(selection, caps | terms)
        )

    def get_pids(self, loop: str, joints: Joints = None) -> Pids:
        """One control loop of joints: ``position``, ``velocity``, ``torque``, ``current`` (Y5)."""
        return self.engine.motors.pids(self._numbers(joints), loop_of(loop))

    def set_pids(
        self,
        loop: str,
        joints: Joints = None,
        *,
        reset: bool = False,
        offsets: Values | None = None,
    ) -> Reply:
        """Drop what a loop has integrated, set what is added to its output, or both (Y5).

        Args:
            loop: as of ``get_pids``.
            joints: whose it is.
            reset: whether its integral part restarts at zero.
            offsets: u_ff, PWM percent; None: as it is.
        """
        try:
            kind, selection = loop_of(loop), self.selector.select(joints)
            if not reset and offsets is None:
                raise RequestError("neither reset nor offsets given; send one or both")
            added = None
            if offsets is not None:
                added = finite(spread(offsets, len(selection.names), "offsets"), "offsets")
        except RequestError as error:
            return self.selector.refuse(joints, error)
        return self.engine.motors.set_pids(selection, kind, reset=reset, offsets=added)

    def set_encoders(
        self, joints: Joints = None, positions: Values = 0.0, *, motor: bool = False
    ) -> Reply:
        """Set the readings of encoders at their present position, rad (Y5).

        Args:
            joints: of these encoders.
            positions: one per joint, or one for all.
            motor: of the motors' shafts; else of the joints, which must have no power.
        """
        motors = self.engine.motors
        take = motors.set_motor_encoders if motor else motors.set_encoders

        def set_all(selection: Selection) -> Reply:
            angles = spread(positions, len(selection.names), "positions")
            return take(selection, finite(angles, "positions"))

        return self._checked(joints, set_all)

    def update_torque_sensor(self, joints: Joints, torques: Values) -> Reply:
        """Set the measured torques of joints with an external sensor, N·m (Y5)."""
        try:
            selection = self.selector.select(joints)
            values = spread(torques, len(selection.names), "torques")
        except RequestError as error:
            return self.reject(joints, f"external torque ignored: {error}")
        answers = []
        for name, j, torque in zip(
            selection.names, selection.numbers, values.tolist(), strict=True
        ):
            if j not in self.engine.torques.joints:
                why = Reason.UNSUPPORTED, "its torque_sensor is not external"
            elif not math.isfinite(torque):
                why = Reason.NOT_FINITE, f"{torque} is not a finite number"
            else:
                self.engine.torques.take(j, torque)
                answers.append(JointAnswer())
                continue
            self.state.rejected[j] += np.uint64(1)
            text = f"external torque for {name} ignored: {why[1]}"
            answers.append(JointAnswer(Answer.IGNORED, text, why[0]))
        return decided(selection.names, answers)

    # --- modes and faults, read ---------------------------------------------------------------

    def get_control_mode(self, joints: Joints = None) -> list[ControlMode]:
        """Present control modes, including the statuses HW_FAULT, CALIBRATING, …"""
        modes = self.state.control_modes
        return [modes[j] for j in self._numbers(joints)]

    def get_available_modes(
        self, joints: Joints = None
    ) -> list[tuple[tuple[ControlMode, ...], tuple[InteractionMode, ...]]]:
        """Control modes and interaction modes that each joint implements."""
        configs = [self.engine.machine.joint(j) for j in self._numbers(joints)]
        return [(config.control_modes, config.interaction_modes) for config in configs]

    def get_drives(self, joints: Joints = None) -> list[DriveUse]:
        """Which set-points the drives accept, which loop runs where (S1), and what they report."""
        numbers, reports = self._numbers(joints), self.engine.drives
        return [
            config.drive_use._replace(reported=reports[j] if reports else DriveReport())
            for j, config in zip(numbers, self.get_config(joints), strict=True)
        ]

    def get_interaction_mode(self, joints: Joints = None) -> list[InteractionMode]:
        """The interaction modes as stored, also where inactive (I2)."""
        modes = self.state.interaction_modes
        return [modes[j] for j in self._numbers(joints)]

    def get_faults(self, joints: Joints = None) -> list[FaultRecord]:
        """The last fault of each joint, active or not (F5)."""
        return [self.state.faults[j] for j in self._numbers(joints)]

    def get_freeze_frame(self, joint: int | str) -> FreezeFrame | None:
        """Readings and references around a joint's last fault; None: no fault yet (E3)."""
        return self.engine.frames.of(self._numbers(joint)[0])

    def get_calibration(self, joints: Joints = None) -> list[CalibrationStatus]:
        """Status of each joint's last calibration, and whether it is calibrated (K7)."""
        calibrations = self.engine.machine.calibrations
        return [calibrations.status(j) for j in self._numbers(joints)]

    # --- what is measured ---------------------------------------------------------------------

    def get_encoder(self, joints: Joints = None) -> Array:
        """Measured positions, rad or m, shape (k,)."""
        return self.state.position[self._indices(joints)]

    def get_encoder_speed(self, joints: Joints = None) -> Array:
        """Measured velocities, rad/s or m/s, shape (k,)."""
        return self.state.velocity[self._indices(joints)]

    def get_torque(self, joints: Joints = None) -> Array:
        """Measured torques, N·m or N, shape (k,); NaN without a torque sensor."""
        indices = self._indices(joints)
        return np.where(self.engine.torque_sensor[indices], self.state.torque[indices], np.nan)

    def get_current(self, joints: Joints = None) -> Array:
        """Measured motor currents, A, shape (k,)."""
        return self.state.current[self._indices(joints)]

    def get_current_range(self, joints: Joints = None) -> tuple[Array, Array]:
        """Minimum and maximum current reference, A, shape (k,) each (Y2)."""
        highest = self.engine.limits.current[self._indices(joints)]
        return -highest, highest.copy()

    # --- references, read ---------------------------------------------------------------------

    def get_target_position(self, joints: Joints = None) -> Array:
        """The last accepted target of a position move, rad or m, shape (k,) (M11)."""
        return self._last(K.POSITION, joints)

    def get_ref_position(self, joints: Joints = None) -> Array:
        """The last accepted direct position, rad or m, shape (k,) (M11)."""
        return self._last(K.POSITION_DIRECT, joints)

    def get_target_velocity(self, joints: Joints = None) -> Array:
        """The last accepted velocity of VELOCITY and MIXED, rad/s or m/s, shape (k,) (M11)."""
        return self._last(K.VELOCITY, joints)

    def get_ref_velocity(self, joints: Joints = None) -> Array:
        """The last accepted velocity, rad/s or m/s, shape (k,) (M11).

        In VELOCITY_DIRECT the velocity of that mode (Y1).
        """
        direct = [mode in DIRECT_VELOCITY for mode in self.get_control_mode(joints)]
        target = self.get_target_velocity(joints)
        return np.where(direct, self._last(K.VELOCITY_DIRECT, joints), target)

    def get_direct_velocity(self, joints: Joints = None) -> Array:
        """The last accepted velocity of VELOCITY_DIRECT in any mode, rad/s or m/s, shape (k,)."""
        return self._last(K.VELOCITY_DIRECT, joints)

    def get_ref_torque(self, joints: Joints = None) -> Array:
        """The last accepted torque, N·m or N, shape (k,) (M11)."""
        return self._last(K.TORQUE, joints)

    def get_output(self, joints: Joints = None) -> Array:
        """The last accepted output, percent, shape (k,) (M11)."""
        return self._last(K.OUTPUT, joints)

    def get_ref_current(self, joints: Joints = None) -> Array:
        """The last accepted motor current, A, shape (k,) (M11)."""
        return self._last(K.CURRENT, joints)

    def check_motion_done(self, joints: Joints = None) -> MotionDone:
        """False from the cycle that accepts a move until its profile ends (P3); see MotionDone."""
        return MotionDone(self.state.done[self._indices(joints)].tolist())

    def get_remaining_time(self, joints: Joints = None) -> Array:
        """Time until the position moves end, s, shape (k,)."""
        return self.engine.references.remaining(self._indices(joints))

    # --- settings, read -----------------------------------------------------------------------

    def get_impedance(self, joints: Joints = None) -> tuple[Array, Array]:
        """Stiffness, N·m/rad, and damping, N·m·s/rad (or N/m, N·s/m); shape (k,) each."""
        laws = [self.engine.controller.joints[j] for j in self._numbers(joints)]
        return np.array([j.stiffness for j in laws]), np.array([j.damping for j in laws])

    def get_torque_offset(self, joints: Joints = None) -> Array:
        """τ_ff of the impedance law, N·m or N, shape (k,): as set, else the load at COMPLIANT.

        Without one set it is 0 where a drive of positions bears the load.
        """
        laws = [self.engine.controller.joints[j] for j in self._numbers(joints)]
        return np.array([j.torque_offset if j.offset_given else j.load_taken for j in laws])

    def get_ref_speed(self, joints: Joints = None) -> Array:
        """Mean speeds of position moves, rad/s or m/s, shape (k,)."""
        return self.engine.references.speed[self._indices(joints)]

    def get_ref_acceleration(self, joints: Joints = None) -> Array:
        """Accelerations of velocity references, rad/s² or m/s², shape (k,)."""
        return self.engine.references.acceleration[self._indices(joints)]

    # YARP 4's names
    set_traj_speed, get_traj_speed = set_ref_speed, get_ref_speed
    set_traj_acceleration, get_traj_acceleration = set_ref_acceleration, get_ref_acceleration

    def get_config(self, joints: Joints = None) -> list[JointConfig]:
        return [self.engine.config.joints[j] for j in self._numbers(joints)]

    def get_coupling(self) -> Coupling:
        """The coupling of the group's joints, its axes, with the physical joints (Y3)."""
        return self.config.coupling or Coupling.plain(self.names)

    # --- the group as a whole -----------------------------------------------------------------

    @property
    def config(self) -> BoardConfig:
        """The configuration of the group, in the form of a board's."""
        return self.engine.config.parts.get(self.name, self.engine.config)

    @property
    def stage(self) -> Stage:
        """The stage of the joints; a part waiting for its level (R4) has not reached it yet."""
        return max(self.state.stages[self._columns])

    @property
    def time(self) -> float:
        """Time of the last reading, s."""
        return self.state.time

    @property
    def cycle(self) -> int:
        """Number of control cycles since the start."""
        return self.state.cycle

    @property
    def modes_version(self) -> int:
        """Counter, incremented with every change of a mode."""
        return max(self.state.modes_changed[self._columns])

    @property
    def faults_version(self) -> int:
        """Counter, incremented with every change of a fault record."""
        return max(self.state.faults_changed[self._columns])

    @property
    def rejected_commands(self) -> NDArray[np.uint64]:
        """Number of ignored commands of each joint (M4), shape (n,)."""
        return self.state.rejected[self._columns].copy()

    @property
    def unknown_commands(self) -> int:
        """Number of commands that named no joint of the group (P13)."""
        return self._unknown

    def snapshot(self) -> Snapshot:
        """The state of the group after the last cycle, frozen."""
        state, columns = self.state, self._columns
        return Snapshot(
            state.time,
            state.cycle,
            state.block[:, columns].copy(),
            state.done[columns].copy(),
            state.rejected[columns].copy(),
            state.calibrated[columns].copy(),
            self.engine.monitor.used[columns].copy(),
            self.engine.torque_sensor[columns].copy(),
            self.unknown_commands,
            self.engine.brakes.closed[columns].copy(),
            self.engine.brakes.slips[columns].copy(),
            shaft_readings(state)[:, columns],
            np.array([joint.acceleration for joint in self.engine.controller.joints[columns]]),
            self.engine.contacts.counts[columns].copy(),
        )

    def take_events(self) -> list[BoardEvent]:
        """The events since the last call, oldest first; a part has its own."""
        return self.engine.events.take(self.name)

    def configure(self) -> Reply:
        """Complete the configuration: joints leave NOT_CONFIGURED with their next reading (N2)."""
        state, stage = self.state, self.stage
        if stage is Stage.UNCONFIGURED:
            text = "the managed board is unconfigured; use its transition configure"
            return refused(text, self.names, Reason.NOT_CONFIGURED)
        if all(state.control_modes[j] in CONFIGURED for j in self.joints) and all(
            state.stages[j] is stage for j in self.joints
        ):
            text = "the board is configured already; power_cycle undoes it"
            return refused(text, self.names)
        self._begin()
        return accepted(self.names)

    def _begin(self) -> None:
        self.engine.start_up.begin(self.joints)

    def set_stage(self, stage: Stage) -> None:
        """Set the stage of the joints of a managed board.

        UNCONFIGURED is a power-on that waits; on INACTIVE they are configured (N2) or lose their
        power; on ACTIVE they calibrate or start, as at N3. A fault stays, except at UNCONFIGURED.
        """
        before = self.stage
        for j in self.joints:
            self.state.stages[j] = stage
        if stage is Stage.UNCONFIGURED:
            self.power_cycle()
        elif before is Stage.UNCONFIGURED:
            self.engine.start_up.begin(self.joints)
        elif stage is Stage.INACTIVE:
            self.power_off()
        elif before is Stage.INACTIVE:
            self.engine.start_up.activate(self.joints)

    def power_cycle(self) -> None:
        """Back to power-on: NOT_CONFIGURED, no power, configured again with autoconfigure (N1)."""
        self.engine.power_on(Zone(self.name, self._columns, self.config))

    def power_off(self) -> None:
        """Disable all joints; a calibration is aborted (K2), a fault stays shown."""
        self.set_control_mode(None, [POWER_OFF[mode] for mode in self.get_control_mode()])

    def reconfigure(self, config: BoardConfig) -> None:
        """Apply new gains, limits and timeouts while running, without a jump.

        Raises:
            ConfigError: the joints, the parts, the rate or the kind of output differ.
        """
        if config.parts.keys() != self.config.parts.keys():
            allowed = f"fixed at {list(self.config.parts)} while the board runs"
            raise ConfigError("parts", list(config.parts), allowed)
        for key in ("names", "control_rate", "output"):
            old, new = getattr(self.config, key), getattr(config, key)
            if old != new:
                raise ConfigError(key, new, f"fixed at {old!r} while the board runs")
        self.engine.take_config(self.name, config)

    # --- helpers --------------------------------------------------------------------------------

    def _indices(self, joints: Joints) -> NDArray[np.intp]:
        return self.selector.select(joints).joints

    def _numbers(self, joints: Joints) -> list[int]:
        return self.selector.select(joints).numbers

    def _last(self, kind: CommandKind, joints: Joints) -> Array:
        values: Array = self.engine.references.last[kind, self._indices(joints)]
        return values

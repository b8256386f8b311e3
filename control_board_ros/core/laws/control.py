# SPDX-License-Identifier: Apache-2.0
"""The joints' laws as the board holds them: constants in, one step for all joints.

The laws themselves are in ``core.laws``, one joint at a time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..config.config import BoardConfig, ConfigError, JointConfig, Pid, Zone, damping_for
from ..config.parts import DEGREE, Payload
from ..model.arm_model import Link, fill
from ..model.dynamics import Body
from ..state import Indices, StateArrays
from ..terms.drives import SetPoint
from ..terms.measurement import Array
from ..terms.modes import Law
from ..terms.motors import Term
from .joint import Joint
from .joint_constants import Limits, Motor
from .joint_contact import Admittance, ExternalTorque
from .laws import Laws
from .pid import Pid as Loop
from .trajectory import Effort

#: Inertia by which the protection makes speed, as a part of the least one; by which it reduces
#: speed, as a multiple of the mean, and of the former, at most.
LIGHT_FACTOR = 0.7
HEAVY_FACTOR = 2.0
WIDE_FACTOR = 4.0

#: A current reference stays below what would be an overcurrent, by this part of it.
PEAK_SHARE = 0.95

#: Velocity for each position error, 1/s, times how old it is when it acts: at most, rad.
PURSUIT_SHARE = 0.2

#: A winding that is slower than the control period by more than this is not made up for whole.
MAX_LEAD = 3.0

#: Hysteresis of the warning of a limit at most, rad or m.
EDGE_ANGLE, EDGE_DISTANCE = 1.0 * DEGREE, 1e-3

#: Dry friction is whole from this part of the speed limit on.
SLIP = 1e-2

#: A new payload acts whole after this time, s.
LOADING = 0.5

#: Laws after which the set-point of a drive is the place that it held.
HOLDS_PLACE = frozenset({Law.POSITION, Law.IMPEDANCE})

#: Time until the torque felt is taken over, in time constants of its low pass.
FELT_TIME_CONSTANTS = 3.0

#: Damping of a goal that gives way where the drive's stiffness is not configured, N·m·s/rad.
MIN_DAMPING = 1e-3

#: An integral part that is beyond a new limit gets there in this time, evenly, s.
UNLOADING = 0.5


class Controller:
    """From references and measurements to the output of every motor.

    The laws of a part's joints are stepped together: they share one arm, and settle as one.

    Attributes: joints (of ``laws.Joint``, in the board's order), caps (the largest current, A, and
    PWM, percent, that it asks for, shape (2, n)), terms (constants and friction of motors in place
    of the configured ones, rows of Term, shape (terms, n), NaN: as configured), efforts (of each
    joint, the
    torque that the moves of its part need; None: it is not known).
    """

    def __init__(self, config: BoardConfig, state: StateArrays) -> None:
        self._state = state
        self._current_loop = config.output == "current"
        self._config = config
        n = len(config.joints)
        self.joints = [Joint() for _ in config.joints]
        self.efforts: list[Effort | None] = [None] * n
        self._bodies: dict[int, tuple[Link, Body]] = {}  # of joints whose part has a model
        self._loads: dict[int, tuple[Payload, Payload, float]] = {}  # that change: share done
        self._armed = [(Law.OFF, False)] * n  # law, and whether with the direct gains
        self.caps: Array = np.zeros((2, n))
        self.terms: Array = np.full((len(Term), n), np.nan)
        self._position_pids: list[Pid | None] = [None] * n  # in force
        self._laws: dict[str, Laws] = {}
        self._steps: list[Callable[[float], bool]] = []
        self._laws_of = [zone.name for zone in config.zones() for _ in zone.joints]
        for zone in config.zones():
            self.power_on(zone)

    def power_on(self, zone: Zone) -> None:
        """Restart the joints of a part, with the gains of their configuration (N1)."""
        state, columns = self._state, zone.columns
        rows = (
            state.position,
            state.velocity,
            state.torque,
            state.current,
            state.position_reference,
            state.velocity_reference,
            state.torque_reference,
            state.output,
            state.age,
        )
        model = zone.config.model
        arm = None if model is None else model.arm()
        trusted = model is not None and model.trusted
        joints = [Joint() for _ in zone.joints]
        effort = Effort(arm, joints, columns.start) if arm is not None and trusted else None
        done = state.done[columns].view(np.uint8).data
        handed = [row[columns].data for row in state.set_points[1:]]
        self._laws[zone.name] = Laws(
            joints,
            [row[columns].data for row in rows],
            done,
            arm,
            trusted,
            handed,
            None if arm is None else state.external_torque[columns].data,
        )
        self._steps = [laws.step for laws in self._laws.values()]
        self.joints[columns] = joints
        for j, joint, config in zip(zone.joints, joints, zone.config.joints, strict=True):
            self.efforts[j] = effort
            if model is not None and arm is not None:
                k = j - columns.start
                self._bodies[j] = model.links[k], arm.bodies[k]
                fill(*self._bodies[j], config.payload.mass, config.payload.center)
            self._loads.pop(j, None)
            self._armed[j] = Law.OFF, False
            self.caps[:, j] = config.limits.peak_current, config.limits.output
            self.terms[:, j] = np.nan
            joint.stiffness, joint.damping = config.impedance.stiffness, config.impedance.damping
            self._configure(j)

    def step(self, elapsed: float = 0.0) -> bool:
        """One cycle of all laws; elapsed and result as :meth:`Laws.step`."""
        news = False
        if self._loads:
            self._advance_loads()
        for step in self._steps:
            if step(elapsed):
                news = True
        return news

    def reconfigure(self, config: BoardConfig) -> None:
        """Apply new constants and gains without a step of torque.

        Joints with an unchanged configuration are not touched.
        """
        before, self._config = self._config, config
        for j, (old, new) in enumerate(zip(before.joints, config.joints, strict=True)):
            if new != old:
                self._load(j, old.payload)
                self._configure(j)

    def _load(self, j: int, before: Payload) -> None:
        """Take a new payload of a joint, evenly within LOADING."""
        if self._config.joints[j].payload != before and j in self._bodies:
            carried = self._loads.pop(j, (before, before, 0.0))
            self._loads[j] = in_between(*carried), self._config.joints[j].payload, 0.0

    def _advance_loads(self) -> None:
        """One cycle of the payloads that change; joints that hold a position keep their torque."""
        for j, (before, after, done) in list(self._loads.items()):
            share = min(done + self._config.period / LOADING, 1.0)
            self._loads[j] = before, after, share
            if share == 1.0:
                del self._loads[j]
            load = in_between(before, after, share)
            self._laws[self._laws_of[j]].forget_arm()
            fill(*self._bodies[j], load.mass, load.center)

    def check_payloads(self, config: BoardConfig) -> None:
        """Check that arms can hold the payloads of a configuration where they are (G1).

        Raises:
            ConfigError: of a new payload that is too heavy, with the greatest mass.
        """
        for zone in config.zones():
            before, joints = self._config.joints[zone.columns], zone.config.joints
            new = [k for k, joint in enumerate(joints) if joint.payload != before[k].payload]
            model = zone.config.model
            if new and model is not None and self._state.calibrated[zone.columns].all():
                masses = [joint.payload.mass for joint in joints]
                kept = [0.0 if k in new else mass for k, mass in enumerate(masses)]
                empty = self._weights(zone, kept)
                loaded = self._weights(zone, masses)
                check_weights(joints, new, empty, loaded)

    def _weights(self, zone: Zone, masses: Sequence[float]) -> Array:
        """Torques that hold an arm with payloads of some masses where it is, N·m, shape (n,)."""
        model = zone.config.model
        assert model is not None
        arm = model.arm()
        for link, body, mass, config in zip(
            model.links, arm.bodies, masses, zone.config.joints, strict=True
        ):
            fill(link, body, mass, config.payload.center)
        position, velocity, acceleration, torque = (np.asarray(row) for row in arm.rows)
        position[:] = self._state.position[zone.columns]
        velocity[:] = acceleration[:] = 0.0
        arm.inverse(1.0)
        return torque.copy()

    def _configure(self, j: int) -> None:
        """Set the constants and gains of a joint from its configuration."""
        joint, config, period = self.joints[j], self._config.joints[j], self._config.period
        self._cap(j)
        set_gains(joint.torque_pid, config.torque_pid, period)
        set_gains(joint.current_pid, config.current_pid, period)
        self._position_pids[j] = None
        self._set_law(j, *self._armed[j])

    def set_caps(self, joints: Indices, currents: Array | None, outputs: Array | None) -> None:
        """Bound the requested current (A) and PWM (percent), shapes (k,) (Y5)."""
        for row, values in enumerate((currents, outputs)):
            if values is not None:
                self.caps[row, joints] = values
        for j in joints.tolist():
            self._cap(j)

    def set_terms(self, joints: Indices, terms: Mapping[Term, Array]) -> None:
        """Set constants and friction of motors, over the configured ones, shapes (k,) (Y5)."""
        for row, values in terms.items():
            self.terms[row, joints] = values
        for j in joints.tolist():
            self._cap(j)

    def terms_in_force(self, j: int) -> list[float]:
        """Constants and friction that the laws of a joint use, by Term."""
        usual = usual_terms(self._config.joints[j], *self._bodies.get(j, ())[:1])
        overrides: list[float] = self.terms[:, j].tolist()
        return [a if math.isnan(b) else b for a, b in zip(usual, overrides, strict=True)]

    def _cap(self, j: int) -> None:
        """Set the constants of a joint, within the caps of users."""
        joint, config = self.joints[j], self._config.joints[j]
        limits = config.limits
        current, output = np.minimum(
            self.caps[:, j], (limits.peak_current, limits.output)
        ).tolist()
        self.caps[:, j] = current, output
        set_constants(joint, config, self._config.period, self.terms_in_force(j))
        if current < limits.peak_current:
            joint.limits.torque = min(joint.limits.torque, current * joint.motor.torque_per_ampere)
        joint.limits.output = output
        self._set_drive(j, self._armed[j][0])

    def arm(self, joints: Sequence[int], law: Law, *, direct: bool, feeds: bool) -> None:
        """Start a law from the present torque of joints (M9).

        Args:
            joints: whose law it becomes.
            law: of source Fig. 2.
            direct: with the gains of POSITION_DIRECT.
            feeds: whether u_ff acts; in a calibration it does not (K6).
        """
        state = self._state
        resting = {part: self._laws[part].prepare() for part in {self._laws_of[j] for j in joints}}
        for j in joints:
            joint = self.joints[j]
            held = joint.law in HOLDS_PLACE and joint.drive.kind == SetPoint.POSITION
            held = held and joint.feeds == feeds
            joint.feeds = feeds
            joint.calibrated = bool(state.calibrated[j])
            joint.torque = joint_torque(joint, float(state.torque[j]), float(state.current[j]))
            if joint.braked and not joint.motor.has_torque_sensor:
                joint.torque = joint.load = joint.gravity  # what its brake has carried
            self._armed[j] = law, direct
            self._set_law(j, law, direct)
            held = held and joint.drive.kind == SetPoint.POSITION
            if not held:  # its drive did not hold this place
                set_point, place = joint.set_point, joint.track.position
                set_point.sag = set_point.trail = 0.0
                set_point.position = place if math.isfinite(place) else 0.0
            joint.start(int(law), resting[self._laws_of[j]], held)
            state.torque_reference[j] = joint.torque_reference
            state.powered[j] = float(law is not Law.OFF)
            if law is Law.OFF:
                state.output[j] = 0.0

    def set_impedance(self, joints: Indices, stiffness: Array, damping: Array | None) -> None:
        """Set spring and damper (I6), N·m/rad and N·m·s/rad, shapes (k,).

        Without damping it is what goes with the stiffness (``damping_for``).
        """
        for k, j in enumerate(joints.tolist()):
            joint = self.joints[j]
            joint.stiffness = float(stiffness[k])
            if damping is None:
                joint.damping = damping_for(joint.stiffness, self._config.joints[j])
            else:
                joint.damping = float(damping[k])

    def _set_law(self, j: int, law: Law, direct: bool) -> None:
        """Set the gains and the set-point of a law, where they differ."""
        joint, config = self.joints[j], self._config.joints[j]
        pid = (config.direct_pid if direct else None) or config.position_pid
        if pid is not self._position_pids[j]:
            set_gains(joint.position_pid, pid, self._config.period)
            self._position_pids[j] = pid
        self._set_drive(j, law)

    def _set_drive(self, j: int, law: Law) -> None:
        """The set-point by which a law reaches the joint's drive (S1)."""
        joint, config = self.joints[j], self._config.joints[j]
        kind = config.set_point_of(law)
        if kind is None and law is Law.OUTPUT:  # of a calibrator (K8)
            kind = config.set_point_of(Law.CURRENT)
        if kind is None or kind is SetPoint.OFF:  # what it would be
            kind = config.set_point_of(Law.POSITION)
        assert kind is not None
        self._state.kinds[j] = kind
        # P8: the PWM as given; Y2: amperes whatever the board's output is
        in_amps = law is Law.CURRENT or (self._current_loop and law is not Law.OUTPUT)
        set_drive(joint, config, kind, in_amps=in_amps)
        current, output = self.caps[:, j].tolist()
        if kind > SetPoint.CURRENT:
            cap = current * joint.motor.torque_per_ampere
        else:
            cap = current if joint.drive.in_amps else output
        if current < config.limits.peak_current or output < config.limits.output:
            joint.drive.max = min(joint.drive.max, cap)


def in_between(before: Payload, after: Payload, share: float) -> Payload:
    """A payload on its way from one to another: mass and first moment change evenly."""
    mass = before.mass + share * (after.mass - before.mass)
    if mass <= 0.0:
        return Payload(center=after.center)
    x, y, z = (
        (a * before.mass * (1.0 - share) + b * after.mass * share) / mass
        for a, b in zip(before.center, after.center, strict=True)
    )
    return Payload(mass=mass, center=(x, y, z))


def check_weights(
    joints: Sequence[JointConfig], new: Sequence[int], empty: Array, loaded: Array
) -> None:
    """Check the torques that hold new payloads, which grow evenly with their mass.

    Args:
        joints: of the arm.
        new: whose payload it is, of these joints.
        empty: torques without the new payloads, N·m, shape (n,).
        loaded: with them.
    """
    limits = np.array([joint.limits.torque for joint in joints])
    added = loaded - empty
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = (limits - np.sign(added) * empty) / np.abs(added)
    shares = np.where(added == 0.0, np.inf, shares)
    k = int(np.argmin(shares))
    if shares[k] >= 1.0:
        return
    heaviest = max(new, key=lambda k: joints[k].payload.mass)
    mass = joints[heaviest].payload.mass
    raise ConfigError(
        f"{joints[heaviest].name}.payload.mass",
        mass,
        f"here at most {max(shares[k], 0.0) * mass:.3g} kg: with more {joints[k].name} needs "
        f"{abs(loaded[k]):.3g} of its {limits[k]:.3g} {joints[k].kind.force_unit}",
    )


def joint_torque(joint: Joint, measured: float, current: float) -> float:
    """The measured torque; without a sensor that of the motor's current."""
    return measured if joint.motor.has_torque_sensor else current * joint.motor.torque_per_ampere


def usual_terms(config: JointConfig, link: Link | None = None) -> list[float]:
    """Constants and friction of a joint's motor as they are configured, by Term."""
    coulomb, viscous = (0.0, 0.0) if link is None else (link.coulomb, link.viscous)
    constant, slip = config.motor.torque_constant, SLIP * config.limits.velocity
    return [constant, constant, viscous, viscous, coulomb, coulomb, slip]


def set_constants(
    joint: Joint, config: JointConfig, period: float, terms: Sequence[float] | None = None
) -> None:
    """The constants of the laws from a joint's configuration, and by Term of its motor."""
    joint.clock.period = joint.clock.elapsed = joint.clock.span = period
    joint.drive.delay, joint.drive.compensation = config.drive_delay, config.back_emf_compensation
    joint.compensates = config.gravity_compensation
    set_limits(joint.limits, config)
    set_motor(joint.motor, config, terms or usual_terms(config))
    set_contact(joint.external, config, period)
    set_admittance(joint.admittance, config, period)


def set_limits(limits: Limits, config: JointConfig) -> None:
    """The limits of a joint's configuration."""
    own = config.limits
    limits.lower, limits.upper = own.lower, own.upper
    limits.edge = config.kind.choose(EDGE_ANGLE, EDGE_DISTANCE)
    limits.velocity, limits.acceleration, limits.jerk = own.velocity, own.acceleration, own.jerk
    limits.torque, limits.output = own.torque, own.output


def set_motor(model: Motor, config: JointConfig, terms: Sequence[float]) -> None:
    """The model of a joint's motor, by Term."""
    motor = replace(config.motor, torque_constant=terms[Term.TORQUE_CONSTANT])
    model.inertia_min, model.inertia = config.inertia_min, config.inertia_mean
    model.torque_per_ampere = motor.torque_per_ampere
    model.viscous, model.viscous_negative = terms[Term.VISCOUS_POSITIVE : Term.COULOMB_POSITIVE]
    model.coulomb, model.coulomb_negative, model.slip = terms[Term.COULOMB_POSITIVE :]
    model.has_torque_sensor = config.torque_sensor
    model.ohms, model.emf = motor.resistance, terms[Term.BACK_EMF] * motor.gear_ratio
    model.percent_per_volt = 100.0 / motor.supply_voltage


def set_contact(external: ExternalTorque, config: JointConfig, period: float) -> None:
    """How the torque from outside is observed, and what of it is a contact (X1)."""
    contact = config.contact
    external.share = -math.expm1(-2.0 * math.pi * contact.bandwidth * period)
    external.threshold, external.min_duration = contact.threshold, contact.time


def set_admittance(admittance: Admittance, config: JointConfig, period: float) -> None:
    """How a goal gives way in COMPLIANT (I5)."""
    own = config.admittance
    admittance.dead_band = own.dead_band if config.yields else 0.0
    admittance.load_share = own.load_share
    turning = 2.0 * math.pi * own.bandwidth
    admittance.share = -math.expm1(-turning * period)
    admittance.entry_time = FELT_TIME_CONSTANTS / turning
    admittance.min_damping = max(config.position_pid.kp / turning, MIN_DAMPING)


def set_drive(joint: Joint, config: JointConfig, kind: SetPoint, *, in_amps: bool) -> None:
    """Conversion of the laws' torque to the drive's set-point: N·m, A, or a PWM, percent.

    i = τ/(k_t N);  u = 100/V_s (R i + k_e N dq)

    Args:
        joint: whose laws run, with its constants.
        config: its configuration.
        kind: what its drive follows.
        in_amps: whether a PWM comes of a current loop of the board's own (P10).
    """
    motor, limits, drive = config.motor, config.limits, joint.drive
    torque_per_ampere = joint.motor.torque_per_ampere
    per_volt = 100.0 / motor.supply_voltage
    drive.kind = int(kind)
    drive.in_amps = in_amps or kind is not SetPoint.PWM
    drive.pursuit = PURSUIT_SHARE / (joint.clock.period + drive.delay)
    if config.position_pid.kd > 0.0:
        drive.pursuit = min(drive.pursuit, config.position_pid.kp / config.position_pid.kd)
    if kind > SetPoint.CURRENT:
        drive.per_torque, drive.per_speed = 1.0, 0.0
        drive.per_feed = 0.01 * limits.peak_current * torque_per_ampere
        drive.max = limits.torque
    elif drive.in_amps:
        drive.per_torque, drive.per_speed = 1.0 / torque_per_ampere, 0.0
        drive.per_feed = 0.01 * limits.peak_current
        drive.max = PEAK_SHARE * limits.peak_current
    else:
        drive.per_torque = per_volt * motor.resistance / torque_per_ampere
        drive.per_speed, drive.per_feed = per_volt * joint.motor.emf, 1.0
        drive.max = limits.output
    winding = motor.inductance / motor.resistance if kind is SetPoint.PWM else 0.0
    set_winding(joint.motor, winding, joint.clock.period)
    set_protection(joint.motor)


def set_winding(motor: Motor, time: float, period: float) -> None:
    """How late torque follows within a control period.

    Args:
        motor: Whose lead and lag are set.
        time: L/R of its winding, s; 0: the drive makes its current, within the period.
        period: Of control, s.
    """
    motor.lead = motor.lag = 0.0
    if time > 0.0:
        kept = math.exp(-period / time)
        motor.lead = min(kept / (1.0 - kept), MAX_LEAD)
        motor.lag = time / period - kept / (1.0 - kept)


def set_protection(motor: Motor) -> None:
    """The inertia by which the speed bound makes speed, and reduces it (P9, P14).

    A heavy joint needs a large one to slow down. A light one swings from J = ρ J_light on, its
    torque turned round by every cycle (``controlling.speed_bound``, z = −1)::

        ρ = (2 − 2 g l)/((1 − 2 l)(g + 1/6)),   g = 1 + l/3

    Args:
        motor: Whose inertia and lag, l in periods, are known.
    """
    gain = 1.0 + motor.lag / 3.0
    swinging = (2.0 - 2.0 * gain * motor.lag) / (gain + 1.0 / 6.0)
    swinging /= max(1.0 - 2.0 * motor.lag, 1e-6)
    light = LIGHT_FACTOR * motor.inertia_min
    motor.light_inertia = light
    motor.heavy_inertia = min(HEAVY_FACTOR * motor.inertia, min(swinging, WIDE_FACTOR) * light)


def set_gains(loop: Loop, pid: Pid, period: float) -> None:
    """Set the gains of a loop; the integral part compensates the change of its output.

    An integral beyond its limit returns to it within UNLOADING.
    """
    before = loop.feed()
    loop.kp, loop.ki_period, loop.kd, loop.kff = pid.kp, pid.ki * period, pid.kd, pid.kff
    loop.alpha = -math.expm1(-2.0 * math.pi * pid.derivative_cutoff * period)
    loop.limit = pid.integral_limit
    loop.integral += before - loop.feed()
    loop.room = max(abs(loop.integral) - loop.limit, 0.0)
    loop.fall = loop.room * period / UNLOADING

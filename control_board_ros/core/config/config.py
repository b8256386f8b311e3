# SPDX-License-Identifier: Apache-2.0
"""The configuration of a board: frozen, checked when made (SPEC N2).

If a :class:`BoardConfig` exists, it is valid. Every error names the key, the value and what
is allowed. Units: rad, rad/s, N·m, A, V, K, s, and percent for PWM; m and N for prismatic
joints. Several parts are joined to the board of a robot (SPEC R1, R2); BoardLimits are arrays.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...text import clean_name
from ..model.arm_model import ArmModel
from ..model.coupling import Coupling, side_by_side
from ..terms.arguments import Array
from ..terms.drives import KINDS, LAW_FIELDS, DriveUse, OnSilence, SetPoint
from ..terms.joint_kind import JointKind
from ..terms.modes import (
    INITIAL_INTERACTION,
    MOVES,
    SELECTABLE,
    SENSE_TORQUE,
    STANDARD,
    STARTUP_MODES,
    UNPOWERED,
    Law,
    reachable,
    set_point_of,
)
from ..terms.vocabs import ControlMode, InteractionMode
from .parameter import (
    ConfigError,
    amount,
    check_number,
    check_parameters,
    configuration,
    parameter,
    parameters_of,
    part,
    positive_amount,
)
from .parts import (
    DEGREE,
    Admittance,
    Brake,
    Constraints,
    Contact,
    Impedance,
    JointConstraints,
    Limits,
    Motor,
    Payload,
    Pid,
    Timeouts,
)

__all__ = [
    "STARTUP_MODES",
    "Admittance",
    "BoardConfig",
    "BoardLimits",
    "Brake",
    "Calibration",
    "ConfigError",
    "Impedance",
    "JointConfig",
    "Limits",
    "Motor",
    "Payload",
    "Pid",
    "Timeouts",
    "Zone",
    "check_number",
    "joined",
]

NAMES = "a joint name: up to 120 characters that can be shown"
OUTPUTS = ("pwm", "current")
BOUND, REFUSE = OUT_OF_RANGE = ("bound", "refuse")
#: The torque sensor is another program.
EXTERNAL = "external"
#: Of a joint with its spring, and the fastest decay that the torque loop follows, 1/s.
DAMPING_RATIO, MAX_DAMPING_RATE = 0.75, 400.0

#: Units of the loops' gains.
_POSITION = {"kp": "N·m/rad", "ki": "N·m/(rad·s)", "kd": "N·m·s/rad", "kff": "N·m/rad"}
_TORQUE = {"kp": "1", "ki": "1/s", "kd": "s", "kff": "1"}
_CURRENT = {"kp": "V/A", "ki": "V/(A·s)", "kd": "V·s/A", "kff": "V/A", "integral_limit": "V"}


#: Types of calibration and their names; core.calibration has the class of each.
CALIBRATION_TYPES = {3: "offset and move", 5: "move to a hard stop", 12: "absolute sensor"}

#: A hard stop is confirmed by a push that is harder by PUSH, and by MIN_PUSH at least; it stays
#: below the peak current by PUSH_CURRENT.
PUSH, MIN_PUSH, PUSH_CURRENT = 1.5, 1.2, 0.9


@configuration
class Calibration:
    """Calibration of a joint's zero (SPEC K5), with the iCub's type numbers."""

    type: int = parameter(
        ", ".join(["0 none", *(f"{n} {text}" for n, text in CALIBRATION_TYPES.items())]),
        default=0,
        low=0,
        high=12,
    )
    required: bool = parameter("Require a calibration to leave NOT_CONFIGURED", default=True)
    zero: float = parameter("Encoder reading at angle 0 (types 3 and 12)", "rad or m", default=0.0)
    start: float = parameter(
        "Target position after calibration", "rad or m", default=0.0, derived="home"
    )
    speed: float = positive_amount(
        "Speed of the move to calibration.start",
        "rad/s or m/s",
        default=10.0 * DEGREE,
        high="limits.velocity",
        derived="reference_speed",
    )
    output: float = parameter(
        "PWM towards the hard stop, within limits.output; the sign sets the direction (type 5)",
        "percent",
        default=0.0,
        low=-100.0,
        high=100.0,
    )
    stop: float = parameter("Position of the hard stop (type 5)", "rad or m", default=0.0)
    stall_time: float = positive_amount(
        "Time without motion that counts as a stall (type 5)", "s", default=0.1
    )
    timeout: float = positive_amount("Maximum duration of a calibration", "s", default=30.0)
    control_mode: ControlMode = parameter(
        "Control mode after calibration", default=MOVES, choices=SELECTABLE
    )
    interaction_mode: InteractionMode = parameter(
        "Interaction mode after calibration", default=INITIAL_INTERACTION, choices=InteractionMode
    )

    def push(self, limits: Limits, motor: Motor) -> float:
        """PWM that confirms a hard stop, percent: 1.5 times the output, within the joint's limits.

        The limits are those of output, torque and peak current; the sign is left out.
        """
        per_percent = motor.stall_current(1.0)
        current = min(limits.torque / motor.torque_per_ampere, PUSH_CURRENT * limits.peak_current)
        return min(PUSH * abs(self.output), limits.output, current / per_percent)

    def check(self, key: str, limits: Limits, motor: Motor) -> None:
        """Raise ConfigError unless the joint can be calibrated like this."""
        if self.type not in CALIBRATION_TYPES:
            known = (f"{number} ({text})" for number, text in sorted(CALIBRATION_TYPES.items()))
            raise ConfigError(f"{key}.type", self.type, ", ".join(known))
        if self.type != 12:
            check_number(f"{key}.start", self.start, limits.lower, limits.upper)
        check_number(f"{key}.output", self.output, -limits.output, limits.output)
        if self.type == 5:
            self._check_stop(key, limits, motor)

    def _check_stop(self, key: str, limits: Limits, motor: Motor) -> None:
        """The stop is where the joint can be, and its drive leaves room for a harder push."""
        if self.output == 0.0:
            raise ConfigError(
                f"{key}.output", self.output, "not zero: the PWM that finds the stop"
            )
        margin = limits.hard_margin
        check_number(
            f"{key}.stop", self.stop, limits.hard_lower - margin, limits.hard_upper + margin
        )
        push = self.push(limits, motor)
        if push < MIN_PUSH * abs(self.output):
            raise ConfigError(
                f"{key}.output",
                self.output,
                f"at most {push / MIN_PUSH:.4g} %, so that limits.output, limits.torque and "
                "limits.peak_current let a harder push confirm the stop",
            )


@configuration
class JointConfig:
    """The configuration of one joint.

    Attributes:
        name: Of the joint.
        kind: A prismatic joint has m for rad and N for N·m.
        external_torque: Its torques come from elsewhere: ``torque_sensor: external`` (Y5).
        position_pid: Of POSITION, MIXED and VELOCITY.
        direct_pid: Of POSITION_DIRECT; None: as position_pid.
        current_pid: Used where the board's output is ``current``.
        inertia_min: For protection and gains.
        inertia_mean: For feed-forward.
        inertia_max: For damping.
    """

    name: str
    kind: JointKind = JointKind.REVOLUTE
    limits: Limits = part()
    position_pid: Pid = part(
        "Position PID: ",
        units=_POSITION,
        derived={
            "kp": "inertia_min",
            "ki": "inertia_min",
            "kd": "inertia_min",
            "integral_limit": "limits.torque",
        },
    )
    direct_pid: Pid | None = part(
        "PID of POSITION_DIRECT: ",
        default=None,
        units=_POSITION,
        derived=dict.fromkeys((row.name for row in parameters_of(Pid)), "position_pid at start"),
    )
    torque_pid: Pid = part(
        "Torque PID: ",
        in_files=Pid(kp=0.0, ki=30.0, kff=1.0),
        units=_TORQUE,
        derived={"integral_limit": "limits.torque"},
    )
    current_pid: Pid = part(
        "Current PI: ",
        default=Pid(kp=0.5, ki=200.0),
        units=_CURRENT,
        derived={
            "kp": "motor and control_rate",
            "ki": "motor and control_rate",
            "integral_limit": "motor.supply_voltage",
        },
    )
    impedance: Impedance = part()
    motor: Motor = part(default=Motor())
    brake: Brake = part("Brake: ", default=Brake())
    back_emf_compensation: float = amount(
        "Fraction of the back-EMF that the output compensates", default=1.0, high=1.0
    )
    gravity_compensation: bool = parameter(
        "Add the gravity torque of URDF and payload in COMPLIANT and TORQUE",
        default=False,
        run_time=True,
    )
    payload: Payload = part("Payload: ", default=Payload())
    contact: Contact = part("Contact: ", default=Contact())
    admittance: Admittance = part("Admittance: ", default=Admittance())
    reference_speed: float = positive_amount(
        "Reference speed at start",
        "rad/s or m/s",
        default=10.0 * DEGREE,
        high="limits.velocity",
        derived="10 deg/s; 0.05 m/s",
    )
    reference_acceleration: float = positive_amount(
        "Reference acceleration at start",
        "rad/s² or m/s²",
        default=10.0 * DEGREE,
        high="limits.acceleration",
        derived="10 deg/s²; 0.05 m/s²",
    )
    timeouts: Timeouts = part(default=Timeouts())
    constraints: JointConstraints = part(default=JointConstraints())
    torque_sensor: bool = parameter(
        "Torque sensor present, as TORQUE and COMPLIANT require; external: torques are received "
        "on ~/external_torque_sensor",
        default=True,
        choices=(EXTERNAL,),
    )
    external_torque: bool = False
    control_modes: tuple[ControlMode, ...] = parameter(
        "Control modes that the joint implements", default=STANDARD, choices=SELECTABLE
    )
    interaction_modes: tuple[InteractionMode, ...] = parameter(
        "Interaction modes that the joint implements",
        default=tuple(InteractionMode),
        choices=InteractionMode,
    )
    startup_mode: ControlMode = parameter(
        "Control mode at start of a joint without calibration",
        default=MOVES,
        choices=STARTUP_MODES,
    )
    startup_interaction: InteractionMode = parameter(
        "Interaction mode at start of a joint without calibration",
        default=INITIAL_INTERACTION,
        choices=InteractionMode,
    )
    drive: tuple[SetPoint, ...] = parameter(
        "Set-points used with the drive; empty: all that it accepts (simulated drive: pwm)",
        default=(),
        choices=KINDS,
    )
    drive_delay: float = amount(
        "Delay from a set-point to the reading that shows its effect, in excess of one control "
        "cycle",
        "s",
        high=0.1,
    )
    on_silence: OnSilence = parameter(
        "State of the motor without commands from the board, where the drive supports it",
        default=OnSilence.FREE,
        choices=OnSilence,
    )
    calibration: Calibration | None = part(default=None)
    max_travel_error: float = positive_amount(
        "Difference between encoder and motor travel that is a fault",
        "rad or m",
        default=2.0 * DEGREE,
        high=math.inf,
        derived="2 deg; 5 mm",
    )
    inertia_min: float = positive_amount(
        "Minimum inertia moved by the motor, including the rotor; other joints free",
        "kg·m² or kg",
        default=1.0,
        derived="URDF and motor.inertia",
    )
    inertia_mean: float = parameter(
        "Mean inertia moved by the motor, including the rotor; other joints at rest",
        "kg·m² or kg",
        default=1.0,
        low="inertia_min",
        derived="URDF and motor.inertia",
    )
    inertia_max: float = parameter(
        "Maximum inertia moved by the motor in any pose, including the rotor",
        "kg·m² or kg",
        default=1.0,
        low="inertia_mean",
        derived="URDF and motor.inertia",
    )

    def __post_init__(self) -> None:
        if not self.name or clean_name(self.name) != self.name:
            raise ConfigError("joints", clean_name(self.name), NAMES)
        if {*".,"} & {*self.name}:  # they part parameters and lists
            allowed = "joint names without '.' and ','; rename the joint in its URDF"
            raise ConfigError("joints", self.name, allowed)
        if self.kind not in set(JointKind):
            raise ConfigError(f"{self.name}.kind", self.kind, _one_of(tuple(JointKind)))
        object.__setattr__(self, "kind", JointKind(self.kind))
        check_parameters(f"{self.name}.", self)
        self.limits.check(f"{self.name}.limits")
        self._keep_reachable()
        self._check_modes(self.name)
        if self.calibration is not None:
            key, final = f"{self.name}.calibration", self.calibration
            final.check(key, self.limits, self.motor)
            if final.type == 5 and set_point_of(Law.CURRENT, self.set_points) is None:  # K8
                served = ", ".join(f"{n}" for n in CALIBRATION_TYPES if n != 5)
                codes = ", ".join(kind.code for kind in self.set_points)
                raise ConfigError(
                    f"{key}.type",
                    5,
                    f"{served}: a hard stop needs pwm or current; its drive has {codes}",
                )
            self._check_final(f"{key}.control_mode", final.control_mode, SELECTABLE)
            self._check_interaction(f"{key}.interaction_mode", final.interaction_mode)

    @property
    def requires_calibration(self) -> bool:
        """Whether its angle is known after a calibration only (K7)."""
        return self.calibration is not None and self.calibration.required

    @property
    def set_points(self) -> tuple[SetPoint, ...]:
        """The set-points used with the drive (S1)."""
        return self.drive or (SetPoint.PWM,)

    @property
    def yields(self) -> bool:
        """Whether in COMPLIANT the position goal of its drive gives way to the external torque of
        its current, which is then its torque sensing (I7).
        """
        return (
            self.admittance.dead_band > 0.0
            and not self.torque_sensor
            and self.set_point_of(Law.POSITION) is SetPoint.POSITION
        )

    def set_point_of(self, law: Law) -> SetPoint | None:
        """The set-point by which a law reaches its drive; None: it does not (S1)."""
        if law is Law.IMPEDANCE and self.yields:
            return SetPoint.POSITION
        return set_point_of(law, self.set_points)

    @property
    def drive_use(self) -> DriveUse:
        """The set-point of each control law."""
        kinds = {law: self.set_point_of(Law[law.upper()]) for law in LAW_FIELDS}
        codes: dict[str, Any] = {law: kind and kind.code for law, kind in kinds.items()}
        set_points = tuple(kind.code for kind in self.set_points)
        return DriveUse(set_points, **codes, on_silence=str(self.on_silence))

    def _keep_reachable(self) -> None:
        """Leave out the modes that no set-point of its drive reaches (S1, B2)."""
        stiff, compliant = InteractionMode.STIFF, InteractionMode.COMPLIANT
        control = tuple(m for m in self.control_modes if reachable(m, stiff, self.set_points))
        object.__setattr__(self, "control_modes", control)
        if not (self.yields or reachable(MOVES, compliant, self.set_points)):
            only = tuple(m for m in self.interaction_modes if m is not compliant)
            object.__setattr__(self, "interaction_modes", only)

    def _check_modes(self, key: str) -> None:
        if UNPOWERED not in self.control_modes:
            allowed = f"a list that holds {UNPOWERED.code}"
            raise ConfigError(f"{key}.control_modes", self._codes(), allowed)
        for mode in self.control_modes:
            if mode not in SELECTABLE:
                allowed = ", ".join(m.code for m in SELECTABLE)
                raise ConfigError(f"{key}.control_modes", mode.code, f"one of {allowed}")
        if InteractionMode.STIFF not in self.interaction_modes:
            raise ConfigError(f"{key}.interaction_modes", "without stif", "a list that holds stif")
        sense = SENSE_TORQUE.intersection((*self.control_modes, *self.interaction_modes))
        if self.yields:
            sense -= {InteractionMode.COMPLIANT}
            if self.contact.bandwidth == 0.0:
                raise ConfigError(
                    f"{key}.contact.bandwidth",
                    0.0,
                    f"above 0: the external torque that {key}.admittance.dead_band acts on",
                )
        if sense and not self.torque_sensor:
            raise ConfigError(
                f"{key}.torque_sensor",
                False,
                "true, or leave torq out of control_modes and comp out of interaction_modes; comp "
                "stays with drive [position] and an admittance.dead_band",
            )
        self._check_final(f"{key}.startup_mode", self.startup_mode, STARTUP_MODES)
        self._check_interaction(f"{key}.startup_interaction", self.startup_interaction)

    def _check_final(self, key: str, mode: ControlMode, choices: tuple[ControlMode, ...]) -> None:
        if mode not in choices or mode not in self.control_modes:
            allowed = ", ".join(m.code for m in choices if m in self.control_modes)
            raise ConfigError(key, mode.code, f"one of {allowed}")

    def _check_interaction(self, key: str, mode: InteractionMode) -> None:
        if mode not in self.interaction_modes:
            allowed = ", ".join(m.code for m in self.interaction_modes)
            raise ConfigError(key, mode.code, f"one of {allowed}")

    def _codes(self) -> list[str]:
        return [m.code for m in self.control_modes]


#: Why an axis cannot have what belongs to one motor.
SHARED = "its motors are coupled with those of other axes"


def spring_damping(stiffness: float, inertia: float) -> float:
    """Damping of a spring: d = 2 ζ √(k J), N·m·s/rad; ζ = DAMPING_RATIO."""
    return 2.0 * DAMPING_RATIO * math.sqrt(stiffness * inertia)


def damping_for(stiffness: float, joint: JointConfig) -> float:
    """The damping that goes with a stiffness, N·m·s/rad.

    That of J = inertia_max: released, the joint overshoots by at most a tenth in any pose. At most
    max_damping, and the stable limit of the torque loop at inertia_min.
    """
    best = spring_damping(stiffness, joint.inertia_max)
    return min(best, MAX_DAMPING_RATE * joint.inertia_min, joint.impedance.max_damping)


class Zone(NamedTuple):
    """A part on its board: its name (empty: the board has no parts), its joints, its own
    configuration.
    """

    name: str
    columns: slice
    config: BoardConfig

    @property
    def joints(self) -> range:
        """The board's numbers of its joints."""
        return range(self.columns.start, self.columns.stop)


@configuration
class BoardConfig:
    """A whole board.

    Attributes:
        joints: In the board's order.
        calibration_groups: Names of joints that calibrate together, group after group; joints in
            no group form the last one.
        model: The masses of the arm; None: unknown, each joint is modelled alone.
        coupling: Of its joints with physical ones; None: they are the physical joints.
        motor_coupling: Of its joints with the motors; None: each has its own.
        parts: The parts of a robot by name, each with a configuration of its own, and with it its
            model, calibration groups and constraints; made by ``layout.joined``.
    """

    joints: tuple[JointConfig, ...]
    model: ArmModel | None = None
    coupling: Coupling | None = None
    motor_coupling: Coupling | None = None
    parts: Mapping[str, BoardConfig] = field(default_factory=dict)
    control_rate: float = parameter(
        "Rate of control cycles; gains are designed for 200 to 4000 Hz, lower rates log a warning",
        "Hz",
        default=1000.0,
        low=10.0,
        high=20000.0,
    )
    output: str = parameter(
        "Output of the control laws: pwm, or current for an inner current loop",
        default="pwm",
        choices=OUTPUTS,
    )
    out_of_range: str = parameter(
        "References beyond the limits: bound them, or refuse them (degrees sent as radians)",
        default=BOUND,
        choices=OUT_OF_RANGE,
        run_time=True,
    )
    heartbeat_timeout: float = amount(
        "Time without ~/heartbeat that triggers an emergency stop; 0: disabled", "s", high=1e6
    )
    autoconfigure: bool = parameter(
        "Leave NOT_CONFIGURED at start; false: on ~/configure", default=True
    )
    calibration_groups: tuple[tuple[str, ...], ...] = parameter(
        'Groups of joints that calibrate together, in order; each "joint,joint,…"', default=()
    )
    allow_partial_joints_goal: bool = parameter(
        "Accept trajectory goals for a subset of the joints", default=True, run_time=True
    )
    constraints: Constraints = part(default=Constraints())

    def __post_init__(self) -> None:
        if not self.joints:
            raise ConfigError("joints", [], "at least one joint")
        names = [joint.name for joint in self.joints]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise ConfigError("joints", twice, "each joint once")
        if self.model is not None and len(self.model.links) != len(self.joints):
            raise ConfigError("model", len(self.model.links), f"{len(self.joints)} links")
        check_parameters("", self)
        self._check_couplings()
        for joint in () if self.model is not None or self.parts else self.joints:
            if joint.yields:
                raise ConfigError(
                    f"{joint.name}.admittance.dead_band",
                    joint.admittance.dead_band,
                    "0 without the masses of the arm (physics: ideal, base_fixed: false): no "
                    "external torque is known",
                )
        if self.output not in OUTPUTS:
            raise ConfigError("output", self.output, _one_of(OUTPUTS))
        if self.out_of_range not in OUT_OF_RANGE:
            raise ConfigError("out_of_range", self.out_of_range, _one_of(OUT_OF_RANGE))
        grouped = [name for group in self.calibration_groups for name in group]
        for name in grouped:
            if name not in names or grouped.count(name) > 1:
                raise ConfigError("calibration_groups", name, "joints of the board, each once")

    def _check_couplings(self) -> None:
        """What belongs to a motor of its own is not for axes that share motors."""
        if self.motor_coupling is None:
            return
        shared = np.count_nonzero(self.motor_coupling.matrix - np.eye(len(self.joints)), axis=0)
        shared += np.count_nonzero(self.motor_coupling.matrix - np.eye(len(self.joints)), axis=1)
        for joint, count in zip(self.joints, shared.tolist(), strict=True):
            if count and joint.brake.present:
                raise ConfigError(f"{joint.name}.brake.present", True, f"false: {SHARED}")
            if count and joint.set_points != (SetPoint.PWM,):
                codes = [kind.code for kind in joint.set_points]
                raise ConfigError(f"{joint.name}.drive", codes, f"[pwm], or empty: {SHARED}")

    @property
    def names(self) -> tuple[str, ...]:
        """Joint names in the board's order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def period(self) -> float:
        """The control period, s."""
        return 1.0 / self.control_rate

    def zones(self) -> list[Zone]:
        """The parts of the board in its order; the board itself where it has none."""
        zones, start = [], 0
        for name, config in (self.parts or {"": self}).items():
            end = start + len(config.joints)
            zones.append(Zone(name, slice(start, end), config))
            start = end
        return zones


def _one_of(choices: tuple[str, ...]) -> str:
    *others, last = choices
    return f"{', '.join(others)} or {last}"


def joined(parts: Mapping[str, BoardConfig]) -> BoardConfig:
    """The configuration of a robot of several parts, by name and in the robot's order.

    Raises:
        ConfigError: no part, a joint in two parts, or parts of unlike rates or outputs.
    """
    if not parts:
        raise ConfigError("parts", [], "at least one part")
    owner: dict[str, str] = {}
    first = next(iter(parts.values()))
    for name, config in parts.items():
        for joint in config.names:
            if joint in owner:
                raise ConfigError(
                    f"parts.{name}", joint, f"each joint in one part; {owner[joint]} has it"
                )
            owner[joint] = name
        for key in ("control_rate", "output"):
            if getattr(config, key) != getattr(first, key):
                raise ConfigError(
                    f"parts.{name}.{key}", getattr(config, key), "the same for all parts"
                )
    motors = None
    if any(config.motor_coupling for config in parts.values()):
        motors = side_by_side(
            [config.motor_coupling or Coupling.plain(config.names) for config in parts.values()]
        )
    return BoardConfig(
        heartbeat_timeout=min(
            (
                config.heartbeat_timeout
                for config in parts.values()
                if config.heartbeat_timeout > 0.0
            ),
            default=0.0,
        ),
        joints=tuple(joint for config in parts.values() for joint in config.joints),
        control_rate=first.control_rate,
        output=first.output,
        autoconfigure=all(config.autoconfigure for config in parts.values()),
        parts=dict(parts),
        coupling=side_by_side(
            [config.coupling or Coupling.plain(config.names) for config in parts.values()]
        ),
        motor_coupling=motors,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoardLimits:
    """The limits of n joints, arrays of shape (n,) that cannot be written to.

    Attributes: lower and upper (software limits of the position, rad), velocity (rad/s),
    acceleration (rad/s²), torque (N·m), output (PWM, percent), current (peak, A),
    stiffness (the greatest permitted in set_impedance, N·m/rad), damping (likewise, N·m·s/rad),
    refused (whether references beyond them are, and not bounded).
    Metres and N where a joint slides.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    torque: Array
    output: Array
    current: Array
    stiffness: Array
    damping: Array
    refused: NDArray[np.bool_]

    @classmethod
    def of(cls, config: BoardConfig) -> BoardLimits:
        """The limits of a configuration."""
        limits = [joint.limits for joint in config.joints]
        impedances = [joint.impedance for joint in config.joints]
        refused = [
            zone.config.out_of_range == REFUSE for zone in config.zones() for _ in zone.joints
        ]
        return cls(
            lower=frozen(row.lower for row in limits),
            upper=frozen(row.upper for row in limits),
            velocity=frozen(row.velocity for row in limits),
            acceleration=frozen(row.acceleration for row in limits),
            torque=frozen(row.torque for row in limits),
            output=frozen(row.output for row in limits),
            current=frozen(row.peak_current for row in limits),
            stiffness=frozen(row.max_stiffness for row in impedances),
            damping=frozen(row.max_damping for row in impedances),
            refused=frozen(refused).astype(np.bool_),
        )


def frozen(values: Iterable[float]) -> Array:
    """The values as an array that cannot be written to."""
    array = np.array(list(values), dtype=np.float64)
    array.flags.writeable = False
    return array

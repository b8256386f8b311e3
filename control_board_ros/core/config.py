# SPDX-License-Identifier: Apache-2.0
"""The configuration of a board: frozen, checked when made (SPEC N2).

If a :class:`BoardConfig` exists, it is valid. Every error names the key, the value and what
is allowed. Units: rad, rad/s, N·m, A, V, K, s, and percent for PWM; m and N for prismatic
joints.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from .checks import HUGE, ConfigError, check_number
from .parts import DEGREE, Calibration, Impedance, Limits, Motor, Pid, Timeouts
from .vocabs import ControlMode, InteractionMode

__all__ = [
    "CONTROL_MODES",
    "STARTUP_MODES",
    "BoardConfig",
    "Calibration",
    "ConfigError",
    "Impedance",
    "JointConfig",
    "Limits",
    "Motor",
    "Pid",
    "Timeouts",
]

CONTROL_MODES = (
    ControlMode.POSITION,
    ControlMode.POSITION_DIRECT,
    ControlMode.VELOCITY,
    ControlMode.MIXED,
    ControlMode.TORQUE,
    ControlMode.OPENLOOP,
    ControlMode.IDLE,
)
#: Of a joint with its spring, and the fastest decay that the torque loop follows, 1/s.
DAMPING_RATIO, FASTEST_DAMPING = 0.75, 400.0
STARTUP_MODES = (ControlMode.IDLE, ControlMode.POSITION)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointConfig:
    """Everything the board must know of one joint.

    Attributes not named elsewhere: kind (``revolute``, ``continuous`` or ``prismatic``),
    position_pid (POSITION, MIXED, VELOCITY), direct_pid (POSITION_DIRECT; None: as
    position_pid), torque_pid, current_pid (V per A; used where the board's output is
    ``current``), back_emf_compensation (0..1), torque_sensor (without one neither TORQUE nor
    COMPLIANT is offered), startup_mode and startup_interaction (N3), max_travel_error
    (rad by which encoder and motor may disagree before the encoder is at fault), inertia_min,
    inertia_mean and inertia_max (what the motor moves over all poses, rotor included, kg·m²; kg
    where it slides: the least with the other joints free to give way, for protection and gains;
    mean and greatest with the other joints standing, for feed-forward and damping).
    """

    name: str
    limits: Limits
    position_pid: Pid
    torque_pid: Pid
    impedance: Impedance
    kind: str = "revolute"
    direct_pid: Pid | None = None
    current_pid: Pid = field(default_factory=lambda: Pid(kp=0.5, ki=200.0))
    motor: Motor = field(default_factory=Motor)
    back_emf_compensation: float = 1.0
    reference_speed: float = 10.0 * DEGREE
    reference_acceleration: float = 10.0 * DEGREE
    timeouts: Timeouts = field(default_factory=Timeouts)
    torque_sensor: bool = True
    control_modes: tuple[ControlMode, ...] = CONTROL_MODES
    interaction_modes: tuple[InteractionMode, ...] = tuple(InteractionMode)
    startup_mode: ControlMode = ControlMode.POSITION
    startup_interaction: InteractionMode = InteractionMode.STIFF
    calibration: Calibration | None = None
    max_travel_error: float = 2.0 * DEGREE
    inertia_min: float = 1.0
    inertia_mean: float = 1.0
    inertia_max: float = 1.0

    def __post_init__(self) -> None:
        if not self.name or not isinstance(self.name, str):
            raise ConfigError("joints", self.name, "a joint name")
        key = self.name
        if self.kind not in ("revolute", "continuous", "prismatic"):
            raise ConfigError(f"{key}.kind", self.kind, "revolute, continuous or prismatic")
        self.limits.check(f"{key}.limits")
        for name in ("position_pid", "torque_pid", "current_pid", "direct_pid"):
            if (pid := getattr(self, name)) is not None:
                pid.check(f"{key}.{name}")
        self.motor.check(f"{key}.motor")
        self.impedance.check(f"{key}.impedance")
        self.timeouts.check(f"{key}.timeouts")
        check_number(f"{key}.back_emf_compensation", self.back_emf_compensation, 0.0, 1.0)
        check_number(
            f"{key}.reference_speed", self.reference_speed, above=0.0, high=self.limits.velocity
        )
        check_number(
            f"{key}.reference_acceleration",
            self.reference_acceleration,
            above=0.0,
            high=self.limits.acceleration,
        )
        check_number(f"{key}.max_travel_error", self.max_travel_error, above=0.0)
        check_number(f"{key}.inertia_min", self.inertia_min, above=0.0, high=HUGE)
        check_number(f"{key}.inertia_mean", self.inertia_mean, self.inertia_min, HUGE)
        check_number(f"{key}.inertia_max", self.inertia_max, self.inertia_mean, HUGE)
        self._check_modes(key)
        if self.calibration is not None:
            self.calibration.check(f"{key}.calibration", self.limits, self.motor)
            key, final = f"{key}.calibration", self.calibration
            self._check_final(f"{key}.control_mode", final.control_mode, CONTROL_MODES)
            self._check_interaction(f"{key}.interaction_mode", final.interaction_mode)

    def _check_modes(self, key: str) -> None:
        if ControlMode.IDLE not in self.control_modes:
            raise ConfigError(f"{key}.control_modes", self._codes(), "a list that holds idl")
        for mode in self.control_modes:
            if mode not in CONTROL_MODES:
                allowed = ", ".join(m.code for m in CONTROL_MODES)
                raise ConfigError(f"{key}.control_modes", mode.code, f"one of {allowed}")
        if InteractionMode.STIFF not in self.interaction_modes:
            raise ConfigError(f"{key}.interaction_modes", "without stif", "a list that holds stif")
        if not self.torque_sensor and (
            ControlMode.TORQUE in self.control_modes
            or InteractionMode.COMPLIANT in self.interaction_modes
        ):
            raise ConfigError(
                f"{key}.torque_sensor",
                False,
                "true, or leave torq out of control_modes and comp out of interaction_modes (I7)",
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


def spring_damping(stiffness: float, inertia: float) -> float:
    """Damping of a spring: d = 2 ζ √(k J), N·m·s/rad; ζ = DAMPING_RATIO."""
    return 2.0 * DAMPING_RATIO * math.sqrt(stiffness * inertia)


def damping_for(stiffness: float, joint: JointConfig) -> float:
    """The damping that goes with a stiffness, N·m·s/rad.

    That of J = inertia_max: released, the joint passes its place by no more than a tenth in any
    pose. At most max_damping, and what the torque loop bears at inertia_min.
    """
    best = spring_damping(stiffness, joint.inertia_max)
    return min(best, FASTEST_DAMPING * joint.inertia_min, joint.impedance.max_damping)


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardConfig:
    """A whole board.

    Attributes: joints in the board's order; control_rate (Hz); output (``pwm``: the laws give
    the PWM, ``current``: they give a current reference to an inner loop, P10);
    autoconfigure (leave NOT_CONFIGURED at the first cycle, N2); calibration_groups (names of
    joints that calibrate together, group after group; joints in no group form the last one).
    """

    joints: tuple[JointConfig, ...]
    control_rate: float = 1000.0
    output: str = "pwm"
    autoconfigure: bool = True
    calibration_groups: tuple[tuple[str, ...], ...] = ()

    def __post_init__(self) -> None:
        if not self.joints:
            raise ConfigError("joints", [], "at least one joint")
        names = [joint.name for joint in self.joints]
        for name in names:
            if names.count(name) > 1:
                raise ConfigError("joints", name, "each joint once")
        check_number("control_rate", self.control_rate, 10.0, 20000.0)
        if self.output not in ("pwm", "current"):
            raise ConfigError("output", self.output, "pwm or current")
        grouped = [name for group in self.calibration_groups for name in group]
        for name in grouped:
            if name not in names or grouped.count(name) > 1:
                raise ConfigError("calibration_groups", name, "joints of the board, each once")

    @property
    def names(self) -> tuple[str, ...]:
        """Joint names in the board's order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def period(self) -> float:
        """The control period, s."""
        return 1.0 / self.control_rate

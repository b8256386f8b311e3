# SPDX-License-Identifier: Apache-2.0
"""The configuration of a board: frozen, checked when made (SPEC N2).

If a :class:`BoardConfig` exists, it is valid. Every error names the key, the value and what
is allowed. Units: rad, rad/s, N·m, A, V, K, s, and percent for PWM; m and N for prismatic
joints.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from .vocabs import ControlMode, InteractionMode

DEGREE = math.pi / 180.0

CONTROL_MODES = (
    ControlMode.POSITION,
    ControlMode.POSITION_DIRECT,
    ControlMode.VELOCITY,
    ControlMode.MIXED,
    ControlMode.TORQUE,
    ControlMode.OPENLOOP,
    ControlMode.IDLE,
)
STARTUP_MODES = (ControlMode.IDLE, ControlMode.POSITION)


class ConfigError(ValueError):
    """A configuration value that is not allowed; one line: key, value, what is allowed."""

    def __init__(self, key: str, value: Any, allowed: str) -> None:
        super().__init__(f"{key}: {value!r} is not allowed; {allowed}")
        self.key, self.value, self.allowed = key, value, allowed


def check_number(
    key: str,
    value: Any,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: float | None = None,
) -> None:
    """Raise ConfigError unless ``low <= value <= high`` (and ``value > above``, if given).

    NaN and values that are not numbers fail; infinity passes only where the range holds it.
    """
    good = isinstance(value, (int, float)) and not isinstance(value, bool)
    if good and low <= value <= high and (above is None or value > above):
        return
    if above is not None:
        allowed = f"a number above {above:g}" + (f" and up to {high:g}" if high < math.inf else "")
    elif math.isinf(low) and math.isinf(high):
        allowed = "a number"
    elif math.isinf(high):
        allowed = f"a number of at least {low:g}"
    else:
        allowed = f"a number from {low:g} to {high:g}"
    raise ConfigError(key, value, allowed)


#: The largest finite number a configuration takes; keeps products of two of them finite.
HUGE = 1e12


@dataclass(frozen=True, slots=True, kw_only=True)
class Pid:
    """Gains of a PID loop whose output is a torque (N·m), or for the current loop a voltage.

    u = kff·reference + kp·e + ki·∫e dt + kd·d, d being the rate of e through a first-order
    low pass. Attributes: kp (N·m/rad, or 1 in the torque loop), ki (per second of kp),
    kd (N·m·s/rad), kff (1), integral_limit (N·m: bound of the integral part),
    derivative_cutoff (Hz, low pass of the rate).
    """

    kp: float
    ki: float = 0.0
    kd: float = 0.0
    kff: float = 0.0
    integral_limit: float = math.inf
    derivative_cutoff: float = 100.0

    def check(self, key: str) -> None:
        for name in ("kp", "ki", "kd", "kff"):
            check_number(f"{key}.{name}", getattr(self, name), 0.0, HUGE)
        check_number(f"{key}.integral_limit", self.integral_limit, 0.0)
        check_number(f"{key}.derivative_cutoff", self.derivative_cutoff, above=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a joint may do.

    Attributes: lower, upper (software limits, rad), hard_lower, hard_upper (the hard stops),
    hard_margin (overrun beyond the hard stops that is a fault, rad), velocity (rad/s),
    acceleration (rad/s²), torque (N·m), output (PWM percent), nominal_current and
    peak_current (A), overload_time (s at peak current until I²t trips), temperature
    (°C of the winding) and temperature_hysteresis (K below it before the fault can clear).
    """

    lower: float
    upper: float
    hard_lower: float
    hard_upper: float
    velocity: float
    acceleration: float
    torque: float
    nominal_current: float
    peak_current: float
    output: float = 100.0
    hard_margin: float = 2.0 * DEGREE
    overload_time: float = 2.0
    temperature: float = 120.0
    temperature_hysteresis: float = 10.0

    def check(self, key: str) -> None:
        check_number(f"{key}.lower", self.lower)
        check_number(f"{key}.hard_lower", self.hard_lower)
        check_number(f"{key}.upper", self.upper, above=self.lower)
        check_number(f"{key}.hard_upper", self.hard_upper, above=self.hard_lower)
        if self.lower < self.hard_lower:
            raise ConfigError(
                f"{key}.lower", self.lower, f"at least the hard stop, {self.hard_lower:g}"
            )
        if self.upper > self.hard_upper:
            raise ConfigError(
                f"{key}.upper", self.upper, f"at most the hard stop, {self.hard_upper:g}"
            )
        for name in ("velocity", "acceleration", "torque", "nominal_current", "peak_current"):
            check_number(f"{key}.{name}", getattr(self, name), above=0.0, high=HUGE)
        check_number(f"{key}.peak_current", self.peak_current, above=self.nominal_current)
        check_number(f"{key}.output", self.output, above=0.0, high=100.0)
        for name in ("hard_margin", "overload_time"):
            check_number(f"{key}.{name}", getattr(self, name), above=0.0)
        check_number(f"{key}.temperature", self.temperature, above=0.0)
        check_number(f"{key}.temperature_hysteresis", self.temperature_hysteresis, 0.0, HUGE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Motor:
    """The DC motor and gearbox of a joint, as on its name plate.

    Attributes: resistance (ohm), inductance (H), torque_constant (N·m/A, equal to the
    back-EMF constant in V·s/rad), gear_ratio (motor rad per joint rad), efficiency (of the
    gearbox, 0..1), supply_voltage (V).
    """

    resistance: float = 1.0
    inductance: float = 1e-3
    torque_constant: float = 0.1
    gear_ratio: float = 100.0
    efficiency: float = 1.0
    supply_voltage: float = 48.0

    @property
    def torque_per_ampere(self) -> float:
        """Joint torque per ampere, N·m/A."""
        return self.torque_constant * self.gear_ratio * self.efficiency

    @property
    def back_emf(self) -> float:
        """Back-EMF per joint speed, V·s/rad."""
        return self.torque_constant * self.gear_ratio

    def check(self, key: str) -> None:
        for name in (
            "resistance",
            "inductance",
            "torque_constant",
            "gear_ratio",
            "supply_voltage",
        ):
            check_number(f"{key}.{name}", getattr(self, name), above=0.0, high=HUGE)
        check_number(f"{key}.efficiency", self.efficiency, above=0.0, high=1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Impedance:
    """Virtual spring and damper at start-up and their bounds (SPEC I6); N·m/rad, N·m·s/rad."""

    stiffness: float
    damping: float
    max_stiffness: float
    max_damping: float

    def check(self, key: str) -> None:
        for name in ("max_stiffness", "max_damping"):
            check_number(f"{key}.{name}", getattr(self, name), 0.0, HUGE)
        check_number(f"{key}.stiffness", self.stiffness, 0.0, self.max_stiffness)
        check_number(f"{key}.damping", self.damping, 0.0, self.max_damping)


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeouts:
    """Reference timeouts in s, 0 = never (SPEC P12), and sensor silence that is a fault."""

    velocity: float = 0.2
    torque: float = 0.0
    output: float = 0.0
    encoder: float = 0.02
    torque_sensor: float = 0.02

    def check(self, key: str) -> None:
        for name in ("velocity", "torque", "output"):
            check_number(f"{key}.{name}", getattr(self, name), 0.0, 1e6)
        for name in ("encoder", "torque_sensor"):
            check_number(f"{key}.{name}", getattr(self, name), above=0.0, high=1e6)


#: Types of calibration and what they are; core.calibration has the class of each.
CALIBRATION_TYPES = {3: "offset and move", 5: "move to a hard stop", 12: "absolute sensor"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """How a joint finds its zero (SPEC K5), with the iCub's type numbers.

    Attributes: type (of CALIBRATION_TYPES), required (the joint leaves NOT_CONFIGURED only through
    calibration), zero (encoder reading at joint angle 0, rad; types 3 and 12), start (position
    to go to, rad; types 3 and 5), speed (rad/s on the way there), output (PWM percent that
    drives towards the stop; type 5, its sign is the direction), stop (joint angle of that hard
    stop, rad; type 5), stall_time (s without motion that make a stop), timeout (s),
    control_mode and interaction_mode (K3: what the joint is in when done).
    """

    type: int
    required: bool = True
    zero: float = 0.0
    start: float = 0.0
    speed: float = 10.0 * DEGREE
    output: float = 0.0
    stop: float = 0.0
    stall_time: float = 0.1
    timeout: float = 30.0
    control_mode: ControlMode = ControlMode.POSITION
    interaction_mode: InteractionMode = InteractionMode.STIFF

    def check(self, key: str, limits: Limits) -> None:
        if self.type not in CALIBRATION_TYPES:
            known = (f"{number} ({text})" for number, text in sorted(CALIBRATION_TYPES.items()))
            raise ConfigError(f"{key}.type", self.type, ", ".join(known))
        for name in ("zero", "start", "stop"):
            check_number(f"{key}.{name}", getattr(self, name), -HUGE, HUGE)
        if self.type != 12:
            check_number(f"{key}.start", self.start, limits.lower, limits.upper)
        check_number(f"{key}.speed", self.speed, above=0.0, high=limits.velocity)
        check_number(f"{key}.output", self.output, -limits.output, limits.output)
        if self.type == 5 and self.output == 0.0:
            raise ConfigError(
                f"{key}.output", self.output, "not zero: the PWM that finds the stop"
            )
        check_number(f"{key}.stall_time", self.stall_time, above=0.0, high=HUGE)
        check_number(f"{key}.timeout", self.timeout, above=0.0, high=HUGE)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointConfig:
    """Everything the board must know of one joint.

    Attributes not named elsewhere: kind (``revolute``, ``continuous`` or ``prismatic``),
    position_pid (POSITION, MIXED, VELOCITY), direct_pid (POSITION_DIRECT; None: as
    position_pid), torque_pid, current_pid (V per A; used where the board's output is
    ``current``), back_emf_compensation (0..1), torque_sensor (without one neither TORQUE nor
    COMPLIANT is offered), startup_mode and startup_interaction (N3), max_travel_error
    (rad by which encoder and motor may disagree before the encoder is at fault),
    guard_stiffness and guard_damping (the push-back of P9, N·m/rad and N·m·s/rad).
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
    guard_stiffness: float = 500.0
    guard_damping: float = 20.0

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
        for name in ("max_travel_error", "guard_stiffness", "guard_damping"):
            check_number(f"{key}.{name}", getattr(self, name), above=0.0)
        self._check_modes(key)
        if self.calibration is not None:
            self.calibration.check(f"{key}.calibration", self.limits)
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

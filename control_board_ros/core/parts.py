# SPDX-License-Identifier: Apache-2.0
"""The parts of a joint's configuration; units as in config.py."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .checks import HUGE, ConfigError, check_number
from .vocabs import ControlMode, InteractionMode

DEGREE = math.pi / 180.0


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
    gearbox, 0..1), supply_voltage (V), thermal_time (time constant of the winding's cooling, s; 0:
    not known) and ambient (°C around it): they tell how long an overheated winding must wait.
    """

    resistance: float = 1.0
    inductance: float = 1e-3
    torque_constant: float = 0.1
    gear_ratio: float = 100.0
    efficiency: float = 1.0
    supply_voltage: float = 48.0
    thermal_time: float = 0.0
    ambient: float = 25.0

    @property
    def torque_per_ampere(self) -> float:
        """Joint torque per ampere, N·m/A."""
        return self.torque_constant * self.gear_ratio * self.efficiency

    @property
    def back_emf(self) -> float:
        """Back-EMF per joint speed, V·s/rad."""
        return self.torque_constant * self.gear_ratio

    def stall_current(self, output: float) -> float:
        """Current at standstill, I = V/R, A; output in percent."""
        return 0.01 * output * self.supply_voltage / self.resistance

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
        check_number(f"{key}.thermal_time", self.thermal_time, 0.0, HUGE)
        check_number(f"{key}.ambient", self.ambient, -273.15, 1000.0)


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


#: A hard stop is confirmed by a push that is harder by PUSH, and by LEAST_PUSH at least; it stays
#: below the peak current by PUSH_CURRENT.
PUSH, LEAST_PUSH, PUSH_CURRENT = 1.5, 1.2, 0.9


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

    def push(self, limits: Limits, motor: Motor) -> float:
        """PWM that confirms a hard stop, percent: 1.5 times the output, within the joint's limits.

        The limits are those of output, torque and peak current; the sign is left out.
        """
        per_percent = motor.stall_current(1.0)
        current = min(limits.torque / motor.torque_per_ampere, PUSH_CURRENT * limits.peak_current)
        return min(PUSH * abs(self.output), limits.output, current / per_percent)

    def check(self, key: str, limits: Limits, motor: Motor) -> None:
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
        if self.type == 5:
            self._check_stop(key, limits, motor)
        check_number(f"{key}.stall_time", self.stall_time, above=0.0, high=HUGE)
        check_number(f"{key}.timeout", self.timeout, above=0.0, high=HUGE)

    def _check_stop(self, key: str, limits: Limits, motor: Motor) -> None:
        """The stop lies where the joint can be, and its drive leaves room for a harder push."""
        margin = limits.hard_margin
        check_number(
            f"{key}.stop", self.stop, limits.hard_lower - margin, limits.hard_upper + margin
        )
        push = self.push(limits, motor)
        if push < LEAST_PUSH * abs(self.output):
            raise ConfigError(
                f"{key}.output",
                self.output,
                f"at most {push / LEAST_PUSH:.4g} %, so that limits.output, limits.torque and "
                "limits.peak_current let a harder push confirm the stop",
            )

# SPDX-License-Identifier: Apache-2.0
"""The parts of a joint's configuration; units as in config.py.

Names and meaning of the tolerances of trajectories are ros2_controllers' (SPEC T1).
"""

from __future__ import annotations

import math
from enum import StrEnum
from functools import partial

from .parameter import ConfigError, amount, configuration, parameter, positive_amount

#: A number from 0 on that can change while the board runs.
live = partial(amount, run_time=True)


@configuration
class JointConstraints:
    """Tolerances of one joint; a goal of ~/follow_joint_trajectory can have its own."""

    trajectory: float = live("Position tolerance during a trajectory; 0: not checked", "rad or m")
    goal: float = live("Position tolerance at the end of a trajectory; 0: not checked", "rad or m")


@configuration
class Constraints:
    """Of the board: when a trajectory has arrived."""

    stopped_velocity_tolerance: float = live(
        "Speed up to which a joint at the end of a trajectory is stopped; 0: not checked",
        "rad/s or m/s",
        default=0.01,
    )
    goal_time: float = live(
        "Time to reach the goal after the end of a trajectory; 0: unlimited", "s"
    )


DERIVATIVE_CUTOFF = 400.0  # Hz, unless configured otherwise
DEGREE = math.pi / 180.0

_INSIDE = "hard stop, 2 deg or 2 % of the range inside"


@configuration
class Pid:
    """Gains of a PID loop whose output is a torque (N·m), or for the current loop a voltage.

    u = kff·reference + kp·e + ki·∫e dt + kd·d, d being the rate of e through a first-order
    low pass. The units of gain and output are the loop's.
    """

    kp: float = parameter("proportional gain", low=0.0, run_time=True)
    ki: float = live("integral gain")
    kd: float = live("derivative gain")
    kff: float = live("feed-forward of the reference")
    integral_limit: float = live(
        "limit of the integral term", "N·m", default=math.inf, high=math.inf
    )
    derivative_cutoff: float = positive_amount(
        "cutoff of the low-pass filter of the derivative",
        "Hz",
        default=DERIVATIVE_CUTOFF,
        run_time=True,
    )


@configuration
class Limits:
    """Limits of a joint. The software limits lie within the hard stops."""

    lower: float = parameter(
        "Lower software limit", "rad or m", low=-math.inf, run_time=True, derived=_INSIDE
    )
    upper: float = parameter(
        "Upper software limit",
        "rad or m",
        above="lower",
        high=math.inf,
        run_time=True,
        derived=_INSIDE,
    )
    hard_lower: float = parameter("Lower hard stop", "rad or m", low=-math.inf, derived="URDF")
    hard_upper: float = parameter(
        "Upper hard stop", "rad or m", above="hard_lower", high=math.inf, derived="URDF"
    )
    velocity: float = positive_amount("Speed limit", "rad/s or m/s", derived="URDF")
    acceleration: float = positive_amount(
        "Acceleration limit",
        "rad/s² or m/s²",
        derived="10 × limits.velocity per s, at most what torque and inertia_max allow",
    )
    jerk: float = live(
        "Jerk limit of position moves and of stops, not of braking ahead of a limit or for want of"
        " torque; 0: none",
        "rad/s³ or m/s³",
    )
    torque: float = positive_amount("Torque limit", "N·m or N", derived="URDF (effort)")
    output: float = positive_amount("Maximum PWM", "percent", default=100.0, high=100.0)
    nominal_current: float = positive_amount(
        "Continuous current", "A", derived="0.6 × torque limit, gravity"
    )
    peak_current: float = parameter(
        "Overcurrent threshold",
        "A",
        above="nominal_current",
        derived="motor reversed at full speed",
    )
    hard_margin: float = positive_amount(
        "Overrun of a hard stop that is a fault",
        "rad or m",
        default=2.0 * DEGREE,
        derived="2 deg; 5 mm",
    )
    overload_time: float = positive_amount(
        "Time at peak current until I²t trips", "s", default=2.0
    )
    temperature: float = positive_amount("Maximum winding temperature", "°C", default=120.0)
    temperature_hysteresis: float = amount(
        "Hysteresis below limits.temperature for clearing the fault", "K", default=10.0
    )

    def check(self, key: str) -> None:
        """Raise ConfigError unless the software limits lie within the hard stops."""
        if self.lower < self.hard_lower:
            raise ConfigError(
                f"{key}.lower", self.lower, f"at least the hard stop, {self.hard_lower:g}"
            )
        if self.upper > self.hard_upper:
            raise ConfigError(
                f"{key}.upper", self.upper, f"at most the hard stop, {self.hard_upper:g}"
            )


@configuration
class Motor:
    """The DC motor and gearbox of a joint, as on its name plate."""

    resistance: float = positive_amount("Winding resistance", "ohm", default=1.0, derived="limits")
    inductance: float = positive_amount(
        "Winding inductance", "H", default=1e-3, derived="1.5 ms × motor.resistance"
    )
    torque_constant: float = positive_amount(
        "Torque constant, and back-EMF constant in V·s/rad", "N·m/A", default=0.1, derived="limits"
    )
    gear_ratio: float = positive_amount("Motor turns per joint turn", default=100.0)
    efficiency: float = positive_amount("Gearbox efficiency", default=1.0, high=1.0)
    supply_voltage: float = positive_amount("Supply voltage", "V", default=48.0)
    thermal_time: float = amount(
        "Thermal time constant of the winding; 0: unknown",
        "s",
        derived="thermal_resistance × thermal_capacitance",
    )
    ambient: float = parameter("Ambient temperature", "°C", default=25.0, low=-273.15, high=1000.0)

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


@configuration
class Brake:
    """The brake of a joint, which holds the joint without power (SPEC Y4)."""

    present: bool = parameter("present", default=False)
    release_time: float = amount("release time", "s", default=0.03, high=5.0)
    engage_time: float = amount("engage time", "s", default=0.02, high=5.0)
    slip_torque: float = positive_amount(
        "holding torque", "N·m or N", default=100.0, derived="limits.torque"
    )


@configuration
class Impedance:
    """Virtual spring and damper at start-up and their bounds (SPEC I6)."""

    stiffness: float = parameter(
        "Stiffness at start", "N·m/rad", low=0.0, high="max_stiffness", derived="position_pid"
    )
    damping: float = parameter(
        "Damping at start", "N·m·s/rad", low=0.0, high="max_damping", derived="position_pid"
    )
    max_stiffness: float = parameter(
        "Maximum stiffness", "N·m/rad", low=0.0, derived="position_pid"
    )
    max_damping: float = parameter("Maximum damping", "N·m·s/rad", low=0.0, derived="position_pid")


@configuration
class Payload:
    """Payload of a joint's link in addition to the URDF: a point mass (SPEC G1)."""

    mass: float = live("mass", "kg", high=1e4)
    center: tuple[float, float, float] = parameter(
        "position in the frame of the joint's link: x, y, z",
        "m",
        default=(0.0, 0.0, 0.0),
        low=-100.0,
        high=100.0,
        run_time=True,
    )


class Reaction(StrEnum):
    """What a joint does at a contact (SPEC X2)."""

    NONE = "none"
    REPORT = "report"
    STOP = "stop"
    COMPLIANT = "compliant"
    FAULT = "fault"


@configuration
class Contact:
    """When a torque from outside is a contact, and what follows (SPEC X)."""

    bandwidth: float = live(
        "Bandwidth of the external torque; 0: not observed", "Hz", default=30.0, high=1e4
    )
    threshold: float = live("External torque that is a contact; 0: none", "N·m or N")
    time: float = live("Time beyond the threshold", "s", default=0.01, high=10.0)
    reaction: Reaction = parameter(
        "Reaction to a contact", default=Reaction.NONE, choices=Reaction, run_time=True
    )


@configuration
class Admittance:
    """COMPLIANT of a joint without torque sensor whose drive takes positions only (SPEC I5, I7):
    its goal gives way to the external torque that its current shows.
    """

    dead_band: float = amount(
        "external torque below which the joint is stiff in COMPLIANT, whatever its stiffness, at "
        "no load; above the dry friction; 0: no COMPLIANT",
        "N·m or N",
    )
    load_share: float = live("share of the load that adds to the dead band", default=0.1, high=1.0)
    bandwidth: float = positive_amount(
        "bandwidth of the external torque that the goal gives way to; the damping is at least "
        "position_pid.kp, which is the servo's own, over 2π times it",
        "Hz",
        default=5.0,
        high=1e4,
        run_time=True,
    )


@configuration
class Timeouts:
    """Reference timeouts (SPEC P12), and sensor silence that is a fault."""

    velocity: float = live(
        "Age of a velocity reference that stops the joint; 0: never", "s", default=0.2, high=1e6
    )
    torque: float = live("Age of a torque reference that is a fault; 0: never", "s", high=1e6)
    output: float = live("Age of an open-loop reference that is a fault; 0: never", "s", high=1e6)
    current: float = live("Age of a current reference that is a fault; 0: never", "s", high=1e6)
    encoder: float = positive_amount(
        "Time without encoder readings that is a fault; default of drives: plant_timeout",
        "s",
        default=0.02,
        high=1e6,
        run_time=True,
    )
    torque_sensor: float = positive_amount(
        "Time without torque readings that is a fault; default of drives: plant_timeout",
        "s",
        default=0.02,
        high=1e6,
        run_time=True,
    )

# SPDX-License-Identifier: Apache-2.0
"""The parameters of a joint, in one table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from ..core.checks import HUGE
from ..core.config import (
    CONTROL_MODES,
    STARTUP_MODES,
    Calibration,
    JointConfig,
    Limits,
    Motor,
    Timeouts,
)
from ..core.vocabs import InteractionMode
from ..sim.config import Encoder, MotorModel
from .parameter import Kind, Parameter, default_of, flag, number, string, strings


def _pid(
    prefix: str, what: str, unit: str, derived: str, defaults: Mapping[str, float]
) -> Iterator[Parameter]:
    output = "V" if prefix == "current_pid" else "N·m"
    rows = (
        ("kp", f"{what}: proportional gain, {unit}."),
        ("ki", f"{what}: integral gain, {unit} per s."),
        ("kd", f"{what}: derivative gain, {unit} · s."),
        ("kff", f"{what}: feed-forward of the reference, {unit}."),
        ("integral_limit", f"{what}: bound of the integral part, {output}."),
        ("derivative_cutoff", f"{what}: low pass of the rate, Hz."),
    )
    for name, text in rows:
        low = 1e-3 if name == "derivative_cutoff" else 0.0
        high = math.inf if name == "integral_limit" else HUGE
        default = defaults.get(name)
        bound = "limits.torque" if name == "integral_limit" and prefix != "direct_pid" else derived
        bound = "motor.supply_voltage" if bound != derived and output == "V" else bound
        yield number(
            f"{prefix}.{name}",
            default,
            text,
            low,
            high=high,
            derived="" if default is not None else bound,
            run_time=True,
        )


_CUTOFF = {"derivative_cutoff": 400.0}
_PLAIN = {"kd": 0.0, "kff": 0.0, **_CUTOFF}

_LIMITS = (
    number(
        "limits.lower",
        None,
        "Software limit, rad or m.",
        -HUGE,
        derived="hard stop, 2 deg or 2 % of the range inside",
        run_time=True,
    ),
    number(
        "limits.upper",
        None,
        "Software limit, rad or m.",
        -HUGE,
        derived="hard stop, 2 deg or 2 % of the range inside",
        run_time=True,
    ),
    number("limits.hard_lower", None, "Hard stop, rad or m.", -HUGE, derived="URDF"),
    number("limits.hard_upper", None, "Hard stop, rad or m.", -HUGE, derived="URDF"),
    number("limits.velocity", None, "Speed limit, rad/s or m/s.", 1e-9, derived="URDF"),
    number(
        "limits.acceleration",
        None,
        "Acceleration limit, rad/s² or m/s².",
        1e-9,
        derived="10 × limits.velocity per s, at most what torque and inertia_max allow",
    ),
    number("limits.torque", None, "Torque limit, N·m or N.", 1e-9, derived="URDF (effort)"),
    number(
        "limits.output", default_of(Limits, "output"), "Largest PWM, percent.", 1e-3, high=100.0
    ),
    number(
        "limits.nominal_current",
        None,
        "Continuous current, A.",
        1e-9,
        derived="0.6 × torque limit, gravity",
    ),
    number(
        "limits.peak_current",
        None,
        "Overcurrent threshold, A.",
        1e-9,
        derived="motor reversed at full speed",
    ),
    number(
        "limits.hard_margin",
        None,
        "Overrun of a hard stop that is a fault, rad or m.",
        1e-9,
        derived="2 deg; 5 mm",
    ),
    number(
        "limits.overload_time",
        default_of(Limits, "overload_time"),
        "Time at peak current until I²t trips, s.",
        1e-3,
    ),
    number(
        "limits.temperature",
        default_of(Limits, "temperature"),
        "Hottest winding allowed, °C.",
        1e-3,
    ),
    number(
        "limits.temperature_hysteresis",
        default_of(Limits, "temperature_hysteresis"),
        "How far below it the fault can clear, K.",
    ),
)

_MOTOR = (
    number("motor.resistance", None, "Winding resistance, ohm.", 1e-9, derived="limits"),
    number(
        "motor.inductance",
        None,
        "Winding inductance, H.",
        1e-12,
        derived="1.5 ms × motor.resistance",
    ),
    number("motor.torque_constant", None, "Torque constant, N·m/A.", 1e-9, derived="limits"),
    number(
        "motor.gear_ratio", default_of(Motor, "gear_ratio"), "Motor turns per joint turn.", 1e-9
    ),
    number("motor.efficiency", default_of(Motor, "efficiency"), "Of the gearbox.", 1e-3, high=1.0),
    number(
        "motor.thermal_time",
        None,
        "Time constant of the winding's cooling, s; 0: not known.",
        derived="thermal_resistance × thermal_capacitance",
    ),
    number("motor.supply_voltage", default_of(Motor, "supply_voltage"), "Supply, V.", 1e-3),
)

_SIMULATION = (
    number("home", None, "Pose at start and after ~/reset, rad or m.", -HUGE, derived="limits"),
    number("inertia", None, "What the joint moves, about, kg·m² or kg.", 1e-9, derived="URDF"),
    number("motor.inertia", None, "Of the rotor, kg·m² on its side.", derived="load, torque"),
    *(
        number(f"motor.{name}", None, text, derived=derived)
        for name, text, derived in (
            ("coulomb", "Dry friction at the joint, N·m.", "URDF, or 1 % of limits.torque"),
            ("viscous", "Viscous friction at the joint, N·m·s/rad.", "URDF, or limits"),
        )
    ),
    *(
        number(f"motor.{name}", None, text, 1e-9, derived=derived)
        for name, text, derived in (
            (
                "thermal_resistance",
                "Winding to ambient, K/W.",
                "nominal current 20 K below limits.temperature",
            ),
            ("thermal_capacitance", "Of the winding, J/K.", "120 s / thermal_resistance"),
        )
    ),
    number(
        "motor.ambient",
        default_of(MotorModel, "ambient"),
        "Temperature around the motor, °C.",
        -273.15,
    ),
    number(
        "encoder.resolution",
        default_of(Encoder, "resolution"),
        "Step of the reading, rad or m; 0: none.",
        high=1.0,
    ),
    number("encoder.zero", default_of(Encoder, "zero"), "Added to the reading, rad or m.", -HUGE),
)

_TIMEOUTS = tuple(
    number(
        f"timeouts.{name}",
        default_of(Timeouts, name),
        text,
        1e-6 if name in ("encoder", "torque_sensor") else 0.0,
        high=1e6,
        run_time=True,
    )
    for name, text in (
        ("velocity", "Age of a velocity reference that stops the joint, s; 0: never (P12)."),
        ("torque", "Age of a torque reference that is a fault, s; 0: never (P12)."),
        ("output", "Age of an open-loop reference that is a fault, s; 0: never (P12)."),
        ("encoder", "Silence of the encoder that is a fault, s."),
        ("torque_sensor", "Silence of the torque sensor that is a fault, s."),
    )
)

_MODES = tuple(mode.code for mode in CONTROL_MODES)
_STARTUP = tuple(mode.code for mode in STARTUP_MODES)
_INTERACTION = tuple(mode.code for mode in InteractionMode)

_CALIBRATION = (
    Parameter(
        name="calibration.type",
        kind=Kind.INTEGER,
        default=0,
        description="0 none, 3 offset and move, 5 move to a hard stop, 12 absolute sensor (K5).",
        low=0,
        high=12,
    ),
    flag("calibration.required", True, "Leave NOT_CONFIGURED only through calibration (N2)."),
    number("calibration.zero", 0.0, "Encoder reading at angle 0, rad or m.", -HUGE),
    number("calibration.start", None, "Where to go when done, rad or m.", -HUGE, derived="home"),
    number(
        "calibration.speed",
        None,
        "Speed on the way there, rad/s or m/s.",
        1e-9,
        derived="reference_speed",
    ),
    number("calibration.output", 0.0, "PWM towards the stop, percent (type 5).", -100, high=100),
    number("calibration.stop", 0.0, "Angle of that stop, rad or m (type 5).", -HUGE),
    number(
        "calibration.stall_time",
        default_of(Calibration, "stall_time"),
        "Time without motion that makes a stop, s (type 5).",
        1e-3,
    ),
    number(
        "calibration.timeout", default_of(Calibration, "timeout"), "Time allowed, s (K4).", 1e-3
    ),
    string("calibration.control_mode", "pos", "Control mode when done (K3).", choices=_STARTUP),
    string(
        "calibration.interaction_mode",
        "stif",
        "Interaction mode when done (K3).",
        choices=_INTERACTION,
    ),
)

JOINT = (
    *_LIMITS,
    *_pid("position_pid", "Position PID", "N·m/rad", "inertia_min", {"kff": 0.0, **_CUTOFF}),
    *_pid("direct_pid", "PID of POSITION_DIRECT", "N·m/rad", "position_pid at start", {}),
    *_pid("torque_pid", "Torque PID", "1", "", {"kp": 0.0, "ki": 30.0, **_PLAIN, "kff": 1.0}),
    *_pid("current_pid", "Current PI", "V/A", "motor and control_rate", _PLAIN),
    number("impedance.stiffness", None, "At start, N·m/rad (I6).", derived="position_pid"),
    number("impedance.damping", None, "At start, N·m·s/rad (I6).", derived="position_pid"),
    number("impedance.max_stiffness", None, "Allowed, N·m/rad.", derived="position_pid"),
    number("impedance.max_damping", None, "Allowed, N·m·s/rad.", derived="position_pid"),
    *_MOTOR,
    number(
        "back_emf_compensation",
        default_of(JointConfig, "back_emf_compensation"),
        "Part of the back-EMF that the output makes up for.",
        high=1.0,
    ),
    number(
        "reference_speed",
        None,
        "Reference speed at start, rad/s or m/s (P2).",
        1e-9,
        derived="10 deg/s; 0.05 m/s",
    ),
    number(
        "reference_acceleration",
        None,
        "Reference acceleration at start, rad/s² or m/s² (P2).",
        1e-9,
        derived="10 deg/s²; 0.05 m/s²",
    ),
    *_TIMEOUTS,
    flag("torque_sensor", True, "Has a torque sensor; TORQUE and COMPLIANT need one (I7)."),
    strings("control_modes", list(_MODES), "What the joint implements (M5).", choices=_MODES),
    strings(
        "interaction_modes",
        list(_INTERACTION),
        "What the joint implements (I7).",
        choices=_INTERACTION,
    ),
    string("startup_mode", "pos", "Control mode without calibration (N3).", choices=_STARTUP),
    string(
        "startup_interaction",
        "stif",
        "Interaction mode without calibration (N3).",
        choices=_INTERACTION,
    ),
    *_CALIBRATION,
    number(
        "max_travel_error",
        None,
        "Disagreement of encoder and motor that is a fault, rad or m.",
        1e-9,
        derived="2 deg; 5 mm",
    ),
    number(
        "inertia_min",
        None,
        "Least inertia that the motor moves, rotor included, other joints free, kg·m² or kg.",
        1e-9,
        derived="URDF and motor.inertia",
    ),
    number(
        "inertia_mean",
        None,
        "Mean inertia that the motor moves, rotor included, kg·m² or kg; for feed-forward.",
        1e-9,
        derived="URDF and motor.inertia",
    ),
    number(
        "inertia_max",
        None,
        "Greatest inertia that the motor moves in any pose, rotor included, kg·m² or kg.",
        1e-9,
        derived="URDF and motor.inertia",
    ),
    *_SIMULATION,
)

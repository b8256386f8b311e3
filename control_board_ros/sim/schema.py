# SPDX-License-Identifier: Apache-2.0
"""Every parameter, in one table: name, type, default, range, unit, and when it can change.

The settings, the ROS declarations and the parameter reference all come from here. Board
parameters have plain names; joint parameters stand once here and are written as
``<joint>.limits.lower`` for one joint or ``joint_defaults.limits.lower`` for all.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Any

from ..core.config import (
    CONTROL_MODES,
    HUGE,
    STARTUP_MODES,
    BoardConfig,
    Calibration,
    JointConfig,
    Limits,
    Motor,
    Timeouts,
)
from ..core.vocabs import InteractionMode
from .config import Encoder, MotorModel, SimulationConfig

JOINT_DEFAULTS = "joint_defaults"


class Kind(StrEnum):
    """The type of a parameter, in ROS's words."""

    BOOL = "bool"
    INTEGER = "integer"
    DOUBLE = "double"
    STRING = "string"
    DOUBLES = "double_array"
    STRINGS = "string_array"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One parameter.

    Attributes: default (None: derived, as ``derived`` says), low and high (inclusive; of
    numbers), choices (of strings), run_time (can change while the board runs), length (of
    arrays with a fixed one).
    """

    name: str
    kind: Kind
    default: Any
    description: str
    derived: str = ""
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    run_time: bool = False
    length: int | None = None

    @property
    def range_text(self) -> str:
        """What is allowed, in words."""
        if self.choices:
            return ", ".join(self.choices)
        if self.kind is Kind.BOOL:
            return "true, false"
        if self.kind in (Kind.STRING, Kind.STRINGS):
            return "text" if self.kind is Kind.STRING else "a list of texts"
        noun = "a list of numbers" if self.kind is Kind.DOUBLES else "a number"
        noun = "a whole number" if self.kind is Kind.INTEGER else noun
        if math.isinf(self.low) and math.isinf(self.high):
            return noun
        if math.isinf(self.high) or self.high >= HUGE:
            return f"{noun} of at least {self.low:g}"
        return f"{noun} from {self.low:g} to {self.high:g}"


def _default(owner: type, name: str) -> Any:
    return next(field.default for field in fields(owner) if field.name == name)


def _number(
    name: str, default: float | None, text: str, low: float = 0.0, **rest: Any
) -> Parameter:
    rest.setdefault("high", HUGE)
    return Parameter(
        name=name, kind=Kind.DOUBLE, default=default, description=text, low=low, **rest
    )


def _flag(name: str, default: bool, text: str, **rest: Any) -> Parameter:
    return Parameter(name=name, kind=Kind.BOOL, default=default, description=text, **rest)


def _text(name: str, default: str, text: str, **rest: Any) -> Parameter:
    return Parameter(name=name, kind=Kind.STRING, default=default, description=text, **rest)


def _texts(name: str, default: list[str], text: str, **rest: Any) -> Parameter:
    return Parameter(name=name, kind=Kind.STRINGS, default=default, description=text, **rest)


BOARD = (
    _text("robot", "iiwa", "Robot: iiwa, panda, icub_left_arm, icub_right_arm or a URDF's path."),
    _texts("joints", [], "Joints of the board in its order; empty: all that move."),
    _number(
        "control_rate", _default(BoardConfig, "control_rate"), "Control cycles, Hz.", 10, high=2e4
    ),
    _number(
        "state_rate", 100.0, "Rate of joint_states and ~/state, Hz.", 0.1, high=1e3, run_time=True
    ),
    _number(
        "real_time_factor",
        1.0,
        "Simulated seconds per second; 0: as fast as possible.",
        high=1000.0,
        run_time=True,
    ),
    _flag("gui", False, "Show the arm in pybullet's window."),
    _flag("autoconfigure", True, "Leave NOT_CONFIGURED at start (N2); else by ~/configure."),
    _text(
        "output",
        "pwm",
        "What the control laws give: pwm, or current to an inner loop (P10).",
        choices=("pwm", "current"),
    ),
    _flag("publish_clock", False, "Publish /clock, also at real_time_factor 1."),
    _flag("allow_fault_injection", False, "Offer ~/inject_fault; for tests, in simulation."),
    _texts(
        "calibration_groups",
        [],
        'Joints that calibrate together, group after group: each "joint,joint,…".',
    ),
    _number(
        "physics_rate",
        None,
        "Physics steps, Hz; a whole multiple of control_rate.",
        10,
        high=1e5,
        derived="control_rate: at least 1000",
    ),
    Parameter(
        name="gravity",
        kind=Kind.DOUBLES,
        default=list(_default(SimulationConfig, "gravity")),
        description="Gravity along the world's x, y, z, m/s².",
        low=-1000.0,
        high=1000.0,
        length=3,
    ),
    _flag("base_fixed", _default(SimulationConfig, "base_fixed"), "The base link cannot move."),
)


def _pid(prefix: str, what: str, unit: str, derived: str) -> Iterator[Parameter]:
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
        yield _number(
            f"{prefix}.{name}", None, text, low, high=high, derived=derived, run_time=True
        )


_LIMITS = (
    _number(
        "limits.lower",
        None,
        "Software limit, rad or m.",
        -HUGE,
        derived="hard stop, 2 deg or 2 % of the range inside",
        run_time=True,
    ),
    _number(
        "limits.upper",
        None,
        "Software limit, rad or m.",
        -HUGE,
        derived="hard stop, 2 deg or 2 % of the range inside",
        run_time=True,
    ),
    _number("limits.hard_lower", None, "Hard stop, rad or m.", -HUGE, derived="URDF"),
    _number("limits.hard_upper", None, "Hard stop, rad or m.", -HUGE, derived="URDF"),
    _number("limits.velocity", None, "Speed limit, rad/s or m/s.", 1e-9, derived="URDF"),
    _number(
        "limits.acceleration",
        None,
        "Acceleration limit, rad/s² or m/s².",
        1e-9,
        derived="10 × limits.velocity per s",
    ),
    _number("limits.torque", None, "Torque limit, N·m or N.", 1e-9, derived="URDF (effort)"),
    _number(
        "limits.output", _default(Limits, "output"), "Largest PWM, percent.", 1e-3, high=100.0
    ),
    _number("limits.nominal_current", None, "Current for ever, A.", 1e-9, derived="0.6 × peak"),
    _number(
        "limits.peak_current",
        None,
        "Current that is an overcurrent, A.",
        1e-9,
        derived="torque limit",
    ),
    _number(
        "limits.hard_margin",
        None,
        "Overrun of a hard stop that is a fault, rad or m.",
        1e-9,
        derived="2 deg; 5 mm",
    ),
    _number(
        "limits.overload_time",
        _default(Limits, "overload_time"),
        "Time at peak current until I²t trips, s.",
        1e-3,
    ),
    _number(
        "limits.temperature", _default(Limits, "temperature"), "Hottest winding allowed, °C.", 1e-3
    ),
    _number(
        "limits.temperature_hysteresis",
        _default(Limits, "temperature_hysteresis"),
        "How far below it the fault can clear, K.",
    ),
)

_MOTOR = (
    _number("motor.resistance", None, "Winding resistance, ohm.", 1e-9, derived="limits"),
    _number("motor.inductance", _default(Motor, "inductance"), "Winding inductance, H.", 1e-12),
    _number("motor.torque_constant", None, "Torque constant, N·m/A.", 1e-9, derived="limits"),
    _number(
        "motor.gear_ratio", _default(Motor, "gear_ratio"), "Motor turns per joint turn.", 1e-9
    ),
    _number("motor.efficiency", _default(Motor, "efficiency"), "Of the gearbox.", 1e-3, high=1.0),
    _number("motor.supply_voltage", _default(Motor, "supply_voltage"), "Supply, V.", 1e-3),
)

_SIMULATION = (
    _number("home", None, "Pose at start and after ~/reset, rad or m.", -HUGE, derived="limits"),
    _number("inertia", None, "What the joint moves, about, kg·m² or kg.", 1e-9, derived="URDF"),
    _number("motor.inertia", None, "Of the rotor, kg·m² on its side.", derived="motor"),
    *(
        _number(f"motor.{name}", _default(MotorModel, name), text, low)
        for name, text, low in (
            ("coulomb", "Dry friction at the joint, N·m.", 0.0),
            ("viscous", "Viscous friction at the joint, N·m·s/rad.", 0.0),
            ("thermal_resistance", "Winding to ambient, K/W.", 1e-9),
            ("thermal_capacitance", "Of the winding, J/K.", 1e-9),
            ("ambient", "Temperature around the motor, °C.", -273.15),
        )
    ),
    _number(
        "encoder.resolution",
        _default(Encoder, "resolution"),
        "Step of the reading, rad or m; 0: none.",
        high=1.0,
    ),
    _number("encoder.zero", _default(Encoder, "zero"), "Added to the reading, rad or m.", -HUGE),
)

_TIMEOUTS = tuple(
    _number(
        f"timeouts.{name}",
        _default(Timeouts, name),
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
    _flag("calibration.required", True, "Leave NOT_CONFIGURED only through calibration (N2)."),
    _number("calibration.zero", 0.0, "Encoder reading at angle 0, rad or m.", -HUGE),
    _number("calibration.start", None, "Where to go when done, rad or m.", -HUGE, derived="home"),
    _number(
        "calibration.speed",
        None,
        "Speed on the way there, rad/s or m/s.",
        1e-9,
        derived="reference_speed",
    ),
    _number("calibration.output", 0.0, "PWM towards the stop, percent (type 5).", -100, high=100),
    _number("calibration.stop", 0.0, "Angle of that stop, rad or m (type 5).", -HUGE),
    _number(
        "calibration.stall_time",
        _default(Calibration, "stall_time"),
        "Time without motion that makes a stop, s (type 5).",
        1e-3,
    ),
    _number(
        "calibration.timeout", _default(Calibration, "timeout"), "Time allowed, s (K4).", 1e-3
    ),
    _text("calibration.control_mode", "pos", "Control mode when done (K3).", choices=_STARTUP),
    _text(
        "calibration.interaction_mode",
        "stif",
        "Interaction mode when done (K3).",
        choices=_INTERACTION,
    ),
)

JOINT = (
    *_LIMITS,
    *_pid("position_pid", "Position PID", "N·m/rad", "mass and reach in the URDF"),
    *_pid("direct_pid", "PID of POSITION_DIRECT", "N·m/rad", "position_pid"),
    *_pid("torque_pid", "Torque PID", "1", "1, 20, 0, 1; limits.torque; 100"),
    *_pid("current_pid", "Current PI", "V/A", "motor"),
    _number("impedance.stiffness", None, "At start, N·m/rad (I6).", derived="position_pid"),
    _number("impedance.damping", None, "At start, N·m·s/rad (I6).", derived="position_pid"),
    _number("impedance.max_stiffness", None, "Allowed, N·m/rad.", derived="10 × stiffness"),
    _number("impedance.max_damping", None, "Allowed, N·m·s/rad.", derived="10 × damping"),
    *_MOTOR,
    _number(
        "back_emf_compensation",
        _default(JointConfig, "back_emf_compensation"),
        "Part of the back-EMF that the output makes up for.",
        high=1.0,
    ),
    _number(
        "reference_speed",
        None,
        "Reference speed at start, rad/s or m/s (P2).",
        1e-9,
        derived="10 deg/s; 0.05 m/s",
    ),
    _number(
        "reference_acceleration",
        None,
        "Reference acceleration at start, rad/s² or m/s² (P2).",
        1e-9,
        derived="10 deg/s²; 0.05 m/s²",
    ),
    *_TIMEOUTS,
    _flag("torque_sensor", True, "Has a torque sensor; TORQUE and COMPLIANT need one (I7)."),
    _texts("control_modes", list(_MODES), "What the joint implements (M5).", choices=_MODES),
    _texts(
        "interaction_modes",
        list(_INTERACTION),
        "What the joint implements (I7).",
        choices=_INTERACTION,
    ),
    _text("startup_mode", "pos", "Control mode without calibration (N3).", choices=_STARTUP),
    _text(
        "startup_interaction",
        "stif",
        "Interaction mode without calibration (N3).",
        choices=_INTERACTION,
    ),
    *_CALIBRATION,
    _number(
        "max_travel_error",
        None,
        "Disagreement of encoder and motor that is a fault, rad or m.",
        1e-9,
        derived="2 deg; 5 mm",
    ),
    _number(
        "guard_stiffness", None, "Push-back at a limit, N·m/rad (P9).", derived="position_pid"
    ),
    _number("guard_damping", None, "Its damping, N·m·s/rad (P9).", derived="position_pid"),
    *_SIMULATION,
)

BOARD_BY_NAME = {parameter.name: parameter for parameter in BOARD}
JOINT_BY_NAME = {parameter.name: parameter for parameter in JOINT}


def rows() -> Iterator[tuple[str, str, str, str, bool, str]]:
    """The parameter reference: name, type, default, range, changes at run time, description."""
    for prefix, table in (("", BOARD), ("<joint>.", JOINT)):
        for row in table:
            default = row.derived and f"from {row.derived}" if row.default is None else row.default
            yield (
                prefix + row.name,
                str(row.kind),
                _written(default),
                row.range_text,
                row.run_time,
                row.description,
            )


def _written(value: Any) -> str:
    """A value as YAML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_written, value)) + "]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)

# SPDX-License-Identifier: Apache-2.0
"""Derivation of missing joint parameters from the URDF.

Sufficient to hold and move common robots; a tuned robot has its own YAML. Joints are sized by
their loads: inertia and gravity torque of the worst pose (see ``loads``); motors by the required
torque (below), gains by the moved inertia (see ``derive_gains``).

The motor, with the joint's torque limit T, speed limit v, gravity torque g, and the supply U::

    Ke v = e U                 back-EMF at the speed limit (e = 0.4; less where necessary)
    R T/kt = (1 − e) U         the torque limit is reached up to the speed limit
    L = 1.5 ms · R             electrical time constant of servo motors of this size
    peak = 1.05 (U + Ke v)/R   a motor reversed at full speed is no overcurrent, a short is
    nominal = max(0.6 T, 1.2 g)/kt, at most T/kt: holds the stretched arm continuously
    J N² = max(½ mean load, T · 1 ms², 4 h drag), drag = Ke kt/R + viscous

The rotor is matched to its load, so that the felt inertia varies little with the pose, with the
least inertia of motors of this torque (the shipped robots have 2 to 3 ms² of T). The last bound
keeps the back-EMF stable in a physics step h. Where the URDF gives no T, the rotor is so heavy
that T accelerates the joint by no more than three times its target, whatever it carries: a
stronger joint in TORQUE would tear along those that its arm carries, whose T is for the targets.
All quantities on the joint side, with kt in N·m/A; N and m/s for sliding joints.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..core.config.parameter import ConfigError
from ..core.config.parts import DEGREE
from ..core.model.coupling import Coupling, rotors_of_motors
from ..core.terms.joint_kind import JointKind
from ..text import first_of
from .couplings import beyond_limits
from .derive_gains import gains
from .loads import Load, loads
from .urdf import Urdf, UrdfJoint

MAX_VELOCITY = 20.0  # rad/s or m/s; more in a URDF is a placeholder
DEFAULT_VELOCITY, DEFAULT_SLIDE_VELOCITY = math.pi, 0.5  # rad/s and m/s
SUSPECT_EFFORT = 1000.0  # N·m or N; more in a URDF may be a placeholder
ABSURD_RATIO = 100.0  # times the required torque: treated as a placeholder
ACCELERATION_RATE = 10.0  # 1/s: target acceleration, in speed limits per second
EMF_SHARE = 0.4
NOMINAL_SHARE = 0.6
ELECTRICAL_TIME = 1.5e-3  # s
ROTOR_SHARE = 0.5
ROTOR_PER_TORQUE = 1e-3  # s²
ASSUMED_ACCELERATION = 3.0  # acceleration by an assumed torque limit, in target accelerations
STEP = 1e-3  # s, the longest derived physics step
TEMPERATURE_MARGIN = 20.0  # K below the temperature limit, at the nominal current
THERMAL_TIME = 120.0  # s
MAX_CURRENT_GAIN = 3.0  # gain of the current loop, of the resistance
FRICTION_SHARE = 0.01
MOST_LOST = 0.8  # largest friction at full speed without a warning, of the torque limit


def required_torque(load: Load, velocity: float) -> float:
    """Torque (force) to hold a load and accelerate it with a rotor of half its inertia."""
    return load.gravity + ACCELERATION_RATE * velocity * (1.0 + ROTOR_SHARE) * load.inertia_max


def speed_limit(values: dict[str, Any], joint: UrdfJoint, assumed: Assumptions) -> None:
    """The URDF's where plausible."""
    name, kind = joint.name, joint.kind
    if "limits.velocity" in values:
        return
    velocity = joint.velocity or kind.choose(DEFAULT_VELOCITY, DEFAULT_SLIDE_VELOCITY)
    values["limits.velocity"] = min(velocity, MAX_VELOCITY)
    text = f"{velocity:.3g} {kind.unit}/s"
    if joint.velocity is None:
        what = "no speed above 0 in the URDF, assumed"
        assumed.warn(name, text, what, "give limits.velocity")
    elif velocity > MAX_VELOCITY:
        top = f"{MAX_VELOCITY:g}"
        what = f"speeds of the URDF above {top} rad/s or m/s are limited to {top}"
        assumed.warn(name, text, what, "give limits.velocity")


def torque_limit(
    values: dict[str, Any], joint: UrdfJoint, load: Load, shared: float, assumed: Assumptions
) -> bool:
    """The URDF's where plausible; else what all joints ask for when they accelerate together.

    Args:
        values: of the joint; its torque limit is set.
        joint: of the URDF.
        load: that it moves.
        shared: torque (force) of all joints' target accelerations at once.
        assumed: what is assumed.

    Returns:
        Whether it is assumed.
    """
    name, unit = joint.name, joint.kind.force_unit
    need = required_torque(load, values["limits.velocity"])
    torque_assumed = False
    if "limits.torque" not in values:
        damping = joint.damping or 0.0
        if joint.kind.slides:
            damping = min(damping, stable_damping(load))
        rubbing = (joint.friction or 0.0) + damping * values["limits.velocity"]
        together = load.gravity + shared + rubbing
        left = ACCELERATION_SHARE - 1.0 / ASSUMED_ACCELERATION  # of it, beside the rotor
        enough = max(3.0 * load.gravity, together / left)
        effort = joint.effort
        if effort is None:
            text = f"{enough:.3g} {unit}"
            assumed.warn(
                name, text, "no effort above 0 in the URDF, assumed", "give limits.torque"
            )
        elif effort > max(SUSPECT_EFFORT, ABSURD_RATIO * need):
            text = f"{enough:.3g} {unit} instead of {effort:.3g} {unit}"
            what = (
                f"effort in the URDF above {ABSURD_RATIO:g} times the torque for the load, ignored"
            )
            assumed.warn(name, text, what, "give limits.torque")
            effort = None
        torque_assumed = effort is None
        values["limits.torque"] = enough if effort is None else effort
    if values["limits.torque"] < load.gravity:
        text = f"{values['limits.torque']:.3g} of {load.gravity:.3g} {unit}"
        what = "the torque limit cannot hold every pose against gravity"
        assumed.warn(name, text, what, "give limits.torque, or stay near the other poses")
    return torque_assumed


def stable_damping(load: Load) -> float:
    """The greatest damping of a sliding joint within a physics step, N·s/m."""
    return max(load.inertia_min, LEAST_INERTIA) / (4.0 * STEP)


def friction(values: dict[str, Any], joint: UrdfJoint, load: Load, assumed: Assumptions) -> None:
    """Friction: the URDF's <dynamics>, else a share of the torque limit."""
    velocity, torque = values["limits.velocity"], values["limits.torque"]
    viscous = joint.damping or 0.5 * FRICTION_SHARE * torque / velocity
    stable = stable_damping(load)
    if joint.kind.slides and viscous > stable and "motor.viscous" not in values:
        if joint.damping:
            text = f"{stable:.3g} N·s/m instead of {viscous:.3g} N·s/m"
            what = "damping unstable for this mass within a physics step, ignored"
            assumed.warn(joint.name, text, what, "give motor.viscous and a higher physics_rate")
        viscous = stable
    values.setdefault("motor.viscous", viscous)
    values.setdefault("motor.coulomb", joint.friction or FRICTION_SHARE * torque)
    lost = values["motor.coulomb"] + values["motor.viscous"] * velocity
    if lost > MOST_LOST * torque:
        text = f"{lost:.3g} of {torque:.3g} {joint.kind.force_unit}"
        what = "friction and damping at full speed need most of the torque limit, or all"
        advice = "expect slow or no motion, or give motor.coulomb, motor.viscous or limits.torque"
        assumed.warn(joint.name, text, what, advice)


def electrical(values: dict[str, Any], joint: UrdfJoint, load: Load) -> None:
    """Torque constant, resistance, inductance and currents."""
    give = values.setdefault
    velocity, torque = values["limits.velocity"], values["limits.torque"]
    supply, gear = values["motor.supply_voltage"], values["motor.gear_ratio"]
    share = EMF_SHARE
    if joint.kind.slides:  # no rotor inertia to stabilise the back-EMF
        bearable = stable_damping(load) * velocity / torque
        share = min(share, bearable / (1.0 + bearable))
    emf = give("motor.torque_constant", share * supply / (velocity * gear)) * gear
    current = torque / (emf * values["motor.efficiency"])
    driving = max(supply - emf * velocity, 0.2 * supply)
    braked = 1.05 * (supply + emf * velocity)
    peak_current = values.get("limits.peak_current")
    resistance = max(driving / current, 0.0 if peak_current is None else braked / peak_current)
    give("motor.resistance", resistance)
    give("motor.inductance", ELECTRICAL_TIME * values["motor.resistance"])
    share = min(max(NOMINAL_SHARE, 1.2 * load.gravity / torque), 1.0)
    peak = max(braked / values["motor.resistance"], 1.05 * share * current)
    if peak_current is not None:
        share = min(share, 0.9 * peak_current / current)
    nominal = give("limits.nominal_current", share * current)
    give("limits.peak_current", max(peak, 1.05 * nominal))


def current_loop(values: dict[str, Any], period: float) -> None:
    """Gains of the inner loop (P10) for the control period T.

    The loop gives V = R i_ref + Ke ω and corrects by a PI. A winding settles by a = exp(−T R/L)
    in a period: kp = R a/(1 − a) would reach i_ref in one; half of it is used. The integral
    compensates a wrong R in 20 periods or 20 ms.
    """
    resistance = values["motor.resistance"]
    left = math.exp(-period * resistance / values["motor.inductance"])
    give = values.setdefault
    give("current_pid.kp", min(0.5 * left / (1.0 - left), MAX_CURRENT_GAIN) * resistance)
    give("current_pid.ki", min(0.05 / period, 50.0) * resistance)
    give("current_pid.integral_limit", values["motor.supply_voltage"])


def rotor(values: dict[str, Any], joint: UrdfJoint, load: Load, torque_assumed: bool) -> None:
    """The rotor's inertia; none for sliding joints, which the physics does not support.

    Args:
        values: of the joint; its rotor is set.
        joint: of the URDF.
        load: that it moves.
        torque_assumed: whether the torque limit is assumed.
    """
    if joint.kind.slides:
        values.setdefault("motor.inertia", 0.0)
        return
    torque, gear = values["limits.torque"], values["motor.gear_ratio"]
    emf = values["motor.torque_constant"] * gear
    drag = emf**2 * values["motor.efficiency"] / values["motor.resistance"]
    heavy = max(ROTOR_SHARE * load.inertia_mean, ROTOR_PER_TORQUE * torque)
    if torque_assumed:
        acceleration_bound = ASSUMED_ACCELERATION * ACCELERATION_RATE * values["limits.velocity"]
        heavy = max(heavy, torque / acceleration_bound - load.inertia_min)
    if (acceleration := values.get("limits.acceleration")) is not None:
        heavy = min(heavy, (torque - load.gravity) / acceleration - load.inertia_max)
    heavy = max(heavy, 4.0 * STEP * (drag + values["motor.viscous"]))
    values.setdefault("motor.inertia", heavy / gear**2)


def thermal(values: dict[str, Any], name: str, assumed: Assumptions) -> None:
    """A winding rated for continuous nominal current, with a time constant of minutes."""
    give = values.setdefault
    limit, ambient = values["limits.temperature"], values["motor.ambient"]
    power = values["motor.resistance"] * values["limits.nominal_current"] ** 2
    rise = max(limit - ambient - TEMPERATURE_MARGIN, 0.5 * (limit - ambient), 1.0)
    give("motor.thermal_resistance", rise / power)
    give("motor.thermal_capacitance", THERMAL_TIME / values["motor.thermal_resistance"])
    time = values["motor.thermal_resistance"] * values["motor.thermal_capacitance"]
    give("motor.thermal_time", time)
    hottest = ambient + values["motor.thermal_resistance"] * power
    if hottest > limit:
        what = "the nominal current overheats the winding"
        advice = "give a smaller limits.nominal_current or motor.thermal_resistance"
        assumed.warn(name, f"{hottest:.0f} °C of {limit:.0f} °C", what, advice)


UNBOUNDED = 1e6  # rad, travel of a continuous joint
LEAST_INERTIA = 1e-4  # kg·m² or kg; smaller values are placeholders
#: Acceleration limit, as a share of what torque and inertia allow.
ACCELERATION_SHARE = 0.8


def complete(
    values: Mapping[str, dict[str, Any]],
    urdf: Urdf,
    gravity: tuple[float, float, float],
    control_rate: float,
    motors: Coupling | None = None,
) -> Assumptions:
    """Complete the parameters of all joints of a board, in place.

    Args:
        values: Parameters by schema name, for each joint; given ones are unchanged.
        urdf: The robot.
        gravity: In world axes, m/s².
        control_rate: Hz.
        motors: Coupling of the same joints with their motors; None: each has its own.

    Returns:
        The assumptions.

    Raises:
        ConfigError: an axis could move a joint beyond its limits (Y3).
    """
    joints = {joint.name: joint for joint in urdf.axes}
    assumed = Assumptions()
    for name, entry in values.items():
        assumed.count(name, entry)
        _travel(entry, joints[name])
    stops = {
        name: (entry["limits.hard_lower"], entry["limits.hard_upper"])
        for name, entry in values.items()
    }
    if (beyond := beyond_limits(urdf, stops)) is not None:
        axis, allowed = beyond
        raise ConfigError(f"{axis}.limits.hard_upper", stops[axis][1], allowed)
    ranges = {
        name: (entry["limits.lower"], entry["limits.upper"]) for name, entry in values.items()
    }
    robot_loads = loads(urdf, ranges, gravity)
    load_of = robot_loads.by_name
    for name, entry in values.items():
        speed_limit(entry, joints[name], assumed)
    shared = robot_loads.shared(
        {name: ACCELERATION_RATE * entry["limits.velocity"] for name, entry in values.items()}
    )
    for name, entry in values.items():
        load = load_of[name]
        entry.setdefault("inertia", max(load.inertia_mean, LEAST_INERTIA))
        torque_assumed = torque_limit(entry, joints[name], load, shared[name], assumed)
        friction(entry, joints[name], load, assumed)
        electrical(entry, joints[name], load)
        current_loop(entry, 1.0 / control_rate)
        entry.setdefault("brake.slip_torque", entry["limits.torque"])
        rotor(entry, joints[name], load, torque_assumed)
        thermal(entry, name, assumed)
    reflected = {
        name: entry["motor.inertia"] * entry["motor.gear_ratio"] ** 2
        for name, entry in values.items()
    }
    if motors is not None:
        felt = rotors_of_motors(motors, np.array([reflected[name] for name in motors.axes]))
        reflected |= dict(zip(motors.axes, felt.tolist(), strict=True))
    for name, moved in robot_loads.with_rotors(reflected).items():
        entry = values[name]
        _moved(entry, moved)
        gains(entry, 1.0 / control_rate, joints[name].kind)
        _start_values(entry, joints[name].kind)
    return assumed


def _moved(values: dict[str, Any], moved: Load) -> None:
    """Moved inertia, rotors included, and acceleration."""
    give = values.setdefault
    give("inertia_min", max(moved.inertia_min, LEAST_INERTIA))
    give("inertia_mean", max(moved.inertia_mean, values["inertia_min"]))
    give("inertia_max", max(moved.inertia_max, values["inertia_mean"]))
    spare = max(values["limits.torque"] - moved.gravity, 0.1 * values["limits.torque"])
    reached = ACCELERATION_SHARE * spare / values["inertia_max"]
    give("limits.acceleration", min(10.0 * values["limits.velocity"], reached))


def _start_values(values: dict[str, Any], kind: JointKind) -> None:
    give = values.setdefault
    slow = kind.choose(10.0 * DEGREE, 0.05)
    give("reference_speed", min(slow, 0.5 * values["limits.velocity"]))
    give("reference_acceleration", min(slow, 0.5 * values["limits.acceleration"]))
    home = give("home", min(max(0.0, values["limits.lower"]), values["limits.upper"]))
    give("calibration.start", min(max(home, values["limits.lower"]), values["limits.upper"]))
    give("calibration.speed", values["reference_speed"])


def _travel(values: dict[str, Any], joint: UrdfJoint) -> None:
    give = values.setdefault
    low = give("limits.hard_lower", joint.lower if math.isfinite(joint.lower) else -UNBOUNDED)
    high = give("limits.hard_upper", joint.upper if math.isfinite(joint.upper) else UNBOUNDED)
    inside = 0.02 * max(high - low, 0.0)
    inside = min(inside, joint.kind.choose(2.0 * DEGREE, inside))
    give("limits.lower", low + inside)
    give("limits.upper", high - inside)
    tolerance = joint.kind.choose(2.0 * DEGREE, 0.005)
    give("limits.hard_margin", tolerance)
    give("max_travel_error", tolerance)


#: Parameters whose absence implies that a whole part of the joint is derived.
PARTS = {"motor.torque_constant": "motors", "position_pid.kp": "gains"}
MAX_NAMES = 6


class Assumptions:
    """Collects assumptions, grouped by kind."""

    def __init__(self) -> None:
        self._count = 0
        self._parts: dict[str, list[str]] = {}
        self._warnings: dict[tuple[str, str], list[str]] = {}

    def count(self, joint: str, values: Mapping[str, Any]) -> None:
        """Record the parts of a joint without parameters."""
        self._count += 1
        for key, part in PARTS.items():
            if key not in values:
                self._parts.setdefault(part, []).append(joint)

    def warn(self, joint: str, value: str, what: str, advice: str) -> None:
        """Record a value to report: ``<joint> <value>, ...: <what>; <advice>``."""
        self._warnings.setdefault((what, advice), []).append(f"{joint} {value}")

    @property
    def notes(self) -> tuple[str, ...]:
        """One line about parts derived as a whole; empty where parameters set all."""
        if not self._parts:
            return ()

        def owners(names: list[str]) -> str:
            return "all joints" if len(names) == self._count else first_of(names, MAX_NAMES)

        parts = ", ".join(f"{part} of {owners(names)}" for part, names in self._parts.items())
        return (
            f"derived from the URDF, as no parameters give them: {parts}; friction is the "
            "URDF's <dynamics>, or 1 % of the torque limit; see docs/howto/own_urdf.md",
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line per kind of value assumed against, or without, the URDF."""
        return tuple(
            f"{what}: {first_of(joints, MAX_NAMES)}; {advice}"
            for (what, advice), joints in self._warnings.items()
        )

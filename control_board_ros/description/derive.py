# SPDX-License-Identifier: Apache-2.0
"""Derivation of missing joint parameters from the URDF.

Sufficient to hold and move common robots; a tuned robot has its own YAML. Joints are sized by
their loads: inertia and gravity torque of the worst pose (see ``loads``); motors by the required
torque (see ``derive_motor``), gains by the moved inertia (see ``derive_gains``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..core.config.parameter import ConfigError
from ..core.config.parts import DEGREE
from ..core.model.coupling import Coupling, rotors_of_motors
from ..core.terms.joint_kind import JointKind
from .assumed import Assumed
from .couplings import beyond_limits
from .derive_gains import gains
from .derive_motor import current_loop, electrical, friction, limits, rotor, thermal
from .loads import MotorLoad, loads
from .urdf import Urdf, UrdfJoint

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
) -> Assumed:
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
    assumed = Assumed()
    for name, given in values.items():
        assumed.count(name, given)
        _travel(given, joints[name])
    stops = {
        name: (given["limits.hard_lower"], given["limits.hard_upper"])
        for name, given in values.items()
    }
    if (beyond := beyond_limits(urdf, stops)) is not None:
        axis, allowed = beyond
        raise ConfigError(f"{axis}.limits.hard_upper", stops[axis][1], allowed)
    ranges = {
        name: (given["limits.lower"], given["limits.upper"]) for name, given in values.items()
    }
    robot_loads = loads(urdf, ranges, gravity)
    load_of = robot_loads.by_name
    for name, given in values.items():
        load = load_of[name]
        given.setdefault("inertia", max(load.inertia_mean, LEAST_INERTIA))
        limits(given, joints[name], load, assumed)
        friction(given, joints[name], load, assumed)
        electrical(given, joints[name], load)
        current_loop(given, 1.0 / control_rate)
        given.setdefault("brake.slip_torque", given["limits.torque"])
        rotor(given, joints[name], load)
        thermal(given, name, assumed)
    reflected = {
        name: given["motor.inertia"] * given["motor.gear_ratio"] ** 2
        for name, given in values.items()
    }
    if motors is not None:
        felt = rotors_of_motors(motors, np.array([reflected[name] for name in motors.axes]))
        reflected |= dict(zip(motors.axes, felt.tolist(), strict=True))
    for name, moved in robot_loads.with_rotors(reflected).items():
        given = values[name]
        _moved(given, moved, load_of[name].gravity)
        gains(given, 1.0 / control_rate, joints[name].kind)
        _start_values(given, joints[name].kind)
    return assumed


def _moved(values: dict[str, Any], moved: MotorLoad, gravity: float) -> None:
    """Moved inertia, rotors included, and acceleration; gravity: torque, N·m."""
    give = values.setdefault
    give("inertia_min", max(moved.inertia_min, LEAST_INERTIA))
    give("inertia_mean", max(moved.inertia_mean, values["inertia_min"]))
    give("inertia_max", max(moved.inertia_max, values["inertia_mean"]))
    spare = max(values["limits.torque"] - gravity, 0.1 * values["limits.torque"])
    reached = ACCELERATION_SHARE * spare / values["inertia_max"]
    give("limits.acceleration", min(10.0 * values["limits.velocity"], reached))


def _start_values(values: dict[str, Any], kind: JointKind) -> None:
    """Initial speeds, home, and the calibration's start."""
    give = values.setdefault
    slow = kind.choose(10.0 * DEGREE, 0.05)
    give("reference_speed", min(slow, 0.5 * values["limits.velocity"]))
    give("reference_acceleration", min(slow, 0.5 * values["limits.acceleration"]))
    home = give("home", min(max(0.0, values["limits.lower"]), values["limits.upper"]))
    give("calibration.start", min(max(home, values["limits.lower"]), values["limits.upper"]))
    give("calibration.speed", values["reference_speed"])


def _travel(values: dict[str, Any], joint: UrdfJoint) -> None:
    give = values.setdefault
    low = give("limits.hard_lower", -UNBOUNDED if joint.lower is None else joint.lower)
    high = give("limits.hard_upper", UNBOUNDED if joint.upper is None else joint.upper)
    inside = 0.02 * max(high - low, 0.0)
    inside = min(inside, joint.kind.choose(2.0 * DEGREE, inside))
    give("limits.lower", low + inside)
    give("limits.upper", high - inside)
    tolerance = joint.kind.choose(2.0 * DEGREE, 0.005)
    give("limits.hard_margin", tolerance)
    give("max_travel_error", tolerance)

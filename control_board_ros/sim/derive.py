# SPDX-License-Identifier: Apache-2.0
"""What a joint's parameters are where nobody gives them: derived from the URDF.

Good enough to hold and move any sane robot; a tuned robot has its own YAML. A joint is sized
by what hangs on it: an inertia and a gravity torque that the stretched-out arm would have.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import Any

from ..core.parts import DEGREE
from .urdf import Urdf, UrdfJoint

GRAVITY = 9.81
BANDWIDTH = 2.0 * math.pi * 3.0  # rad/s, of the position loop
DAMPING_RATIO = 0.9
FAR = 1e6  # rad, where a continuous joint's travel ends
FASTEST = 20.0  # rad/s or m/s; more in a URDF is a placeholder
STRONGEST = 1000.0  # N·m or N; likewise
EMF_SHARE = 0.6  # of the supply, at the speed limit
ROTOR_SHARE = 0.15  # of the load's inertia, that the rotor has at the joint at least
CURRENT_MARGIN = 1.2  # peak current over the current of the torque limit


@dataclass(frozen=True, slots=True)
class Load:
    """What a joint carries at most: inertia (kg·m²; kg) and gravity torque (N·m; N)."""

    inertia: float
    gravity: float


def loads(urdf: Urdf) -> dict[str, Load]:
    """The load of each joint of a URDF, with every link beyond it stretched out."""
    root = ET.fromstring(urdf.text)
    masses = {link.get("name", ""): _mass(link) for link in root.findall("link")}
    beyond: dict[str, list[tuple[str, float]]] = {}
    for joint in root.findall("joint"):
        parent, child = _end(joint, "parent"), _end(joint, "child")
        beyond.setdefault(parent, []).append((child, _reach(joint)))
    found = {}
    for moving in urdf.joints:
        inertia = weight = 0.0
        stack = [(moving.child, 0.0)]
        while stack:
            link, distance = stack.pop()
            mass, offset, moment = masses[link]
            arm = 1.0 if moving.kind == "prismatic" else distance + offset
            inertia += mass * arm**2 + moment * (moving.kind != "prismatic")
            weight += mass * GRAVITY * arm
            stack += [(child, distance + reach) for child, reach in beyond.get(link, [])]
        found[moving.name] = Load(max(inertia, 1e-4), weight)
    return found


def complete(values: dict[str, Any], joint: UrdfJoint, load: Load) -> None:
    """Add what is missing to the parameters of one joint, in place.

    Args:
        values: Parameters of the joint by schema name; those given stay as they are.
        joint: The joint in the URDF.
        load: What it carries.
    """
    _limits(values, joint, load)
    values.setdefault("inertia", load.inertia)
    _motor(values, sliding=joint.kind == "prismatic")
    give = values.setdefault
    total = values["inertia"] + values["motor.inertia"] * values["motor.gear_ratio"] ** 2
    torque = values["limits.torque"]
    give("position_pid.kp", total * BANDWIDTH**2)
    give("position_pid.kd", 2.0 * DAMPING_RATIO * math.sqrt(values["position_pid.kp"] * total))
    give("position_pid.ki", values["position_pid.kp"] * 3.0)
    give("position_pid.integral_limit", torque)
    for name in ("kp", "ki", "kd", "kff", "integral_limit", "derivative_cutoff"):
        give(f"direct_pid.{name}", values[f"position_pid.{name}"])
    give("torque_pid.integral_limit", torque)
    give("current_pid.kp", 0.2 * values["motor.resistance"])
    give("current_pid.ki", 100.0 * values["motor.resistance"])
    give("current_pid.integral_limit", values["motor.supply_voltage"])
    stiffness = give("impedance.stiffness", 0.3 * values["position_pid.kp"])
    damping = give("impedance.damping", 1.4 * math.sqrt(stiffness * total))
    give("impedance.max_stiffness", max(10.0 * stiffness, values["position_pid.kp"]))
    give("impedance.max_damping", max(10.0 * damping, values["position_pid.kd"]))
    give("guard_stiffness", values["position_pid.kp"])
    give("guard_damping", values["position_pid.kd"])
    slow = 0.05 if joint.kind == "prismatic" else 10.0 * DEGREE
    give("reference_speed", min(slow, 0.5 * values["limits.velocity"]))
    give("reference_acceleration", min(slow, 0.5 * values["limits.acceleration"]))
    home = give("home", min(max(0.0, values["limits.lower"]), values["limits.upper"]))
    give("calibration.start", min(max(home, values["limits.lower"]), values["limits.upper"]))
    give("calibration.speed", values["reference_speed"])


def _limits(values: dict[str, Any], joint: UrdfJoint, load: Load) -> None:
    give = values.setdefault
    low = give("limits.hard_lower", -FAR if joint.lower is None else joint.lower)
    high = give("limits.hard_upper", FAR if joint.upper is None else joint.upper)
    inside = 0.02 * max(high - low, 0.0)
    if joint.kind != "prismatic":
        inside = min(inside, 2.0 * DEGREE)
    give("limits.lower", low + inside)
    give("limits.upper", high - inside)
    velocity = give("limits.velocity", min(joint.velocity or math.pi, FASTEST))
    give("limits.acceleration", 10.0 * velocity)
    enough = max(3.0 * load.gravity, 10.0 * load.inertia)
    give("limits.torque", min(joint.effort or enough, STRONGEST))
    tolerance = 0.005 if joint.kind == "prismatic" else 2.0 * DEGREE
    give("limits.hard_margin", tolerance)
    give("max_travel_error", tolerance)


def _motor(values: dict[str, Any], *, sliding: bool) -> None:
    """A motor that fits the limits: the torque at the peak current, the speed at full supply."""
    give = values.setdefault
    supply, gear = values["motor.supply_voltage"], values["motor.gear_ratio"]
    velocity, torque = values["limits.velocity"], values["limits.torque"]
    share = 0.2 * EMF_SHARE if sliding else EMF_SHARE
    give("motor.torque_constant", share * supply / (velocity * gear))
    per_ampere = values["motor.torque_constant"] * gear * values["motor.efficiency"]
    peak = give("limits.peak_current", CURRENT_MARGIN * torque / per_ampere)
    give("limits.nominal_current", 0.6 * peak)
    give("motor.resistance", 1.02 * supply / peak)  # a stall is no overcurrent yet
    # A light rotor would not bear the back-EMF within one physics step, nor gains made for a
    # stretched arm when it is folded; the simulation has no rotor inertia for joints that slide,
    # so their back-EMF is small.
    emf = values["motor.torque_constant"] * gear
    drag = emf * per_ampere / values["motor.resistance"] + values["motor.viscous"]
    heavy = max(4e-3 * drag, ROTOR_SHARE * values["inertia"])
    give("motor.inertia", 0.0 if sliding else heavy / gear**2)


def _mass(link: ET.Element) -> tuple[float, float, float]:
    """Mass, distance of its centre from the link's frame, largest moment of inertia."""
    inertial = link.find("inertial")
    if inertial is None:
        return 0.0, 0.0, 0.0
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    moments = (
        [] if inertia is None else [float(inertia.get(m, "0")) for m in ("ixx", "iyy", "izz")]
    )
    return (
        0.0 if mass is None else float(mass.get("value", "0")),
        _reach(inertial),
        max(moments, default=0.0),
    )


def _reach(element: ET.Element) -> float:
    origin = element.find("origin")
    xyz = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
    return math.hypot(*map(float, xyz.split()))


def _end(joint: ET.Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")

# SPDX-License-Identifier: Apache-2.0
"""Test scenes of gains: poses of the robot, with and without a payload."""

from __future__ import annotations

import copy
import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..core.terms.measurement import Array
from ..description.geometry import origin_of
from ..description.urdf import Urdf
from ..description.urdf_tree import Tree
from ..settings.loading import Settings
from ..sim.config import SimulationConfig

#: Maximum share of the torque limits for a default payload.
PAYLOAD_SHARE = 0.1
#: Least lever of a payload, m; gravity, m/s².
LEAST_LEVER, GRAVITY = 0.1, 9.81
#: Half an edge of the payload, a cube, m.
HALF_EDGE = 0.04
#: Share of each joint's range for poses, around its middle.
INNER = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A pose (rad or m, shape (n,)) and a payload (kg), by name."""

    name: str
    pose: Array
    payload: float


def scenes(settings: Settings, payload: float, seed: int, *, fresh: bool) -> list[Scene]:
    """Home and two poses, one with the payload, for the search; or two fresh poses."""
    joints = settings.board.joints
    home = np.array([joint.home for joint in settings.simulation.joints])
    low = np.array([max(j.limits.lower, -math.pi) for j in joints])
    high = np.array([min(j.limits.upper, math.pi) for j in joints])
    share = np.random.default_rng([seed, int(fresh)]).uniform(-0.5, 0.5, (2, len(joints)))
    places = 0.5 * (low + high) + INNER * share * (high - low)
    if fresh:
        return [Scene("fresh pose", places[0], 0.0), Scene("fresh, payload", places[1], payload)]
    return [
        Scene("home", home, 0.0),
        Scene("pose, payload", places[0], payload),
        Scene("pose", places[1], 0.0),
    ]


def simulation_of(settings: Settings, scene: Scene) -> SimulationConfig:
    """The plant of a scene: starts in the pose with the payload."""
    whole = settings.simulation
    joints = tuple(
        replace(joint, home=float(place))
        for joint, place in zip(whole.joints, scene.pose, strict=True)
    )
    urdf = whole.urdf
    if urdf is not None:
        for row in settings.board.joints:  # the constant payload, as identified
            if row.payload.mass > 0.0:
                link = next(j.child for j in urdf.axes if j.name == row.name)
                urdf = with_mass(urdf, link, row.payload.mass, row.payload.center, row.name)
        if scene.payload > 0.0:
            urdf = with_payload(urdf, settings.board.names, scene.payload)
    return replace(whole, joints=joints, urdf=urdf, gui=False)


def last_link(urdf: Urdf, names: Sequence[str]) -> str:
    """The link that the last turning joint moves: with a hand, that of the wrist."""
    joints = [axis for axis in urdf.axes if axis.name in names]
    turning = [joint for joint in joints if not joint.kind.slides]
    return (turning or joints)[-1].child


def with_payload(urdf: Urdf, names: Sequence[str], mass: float) -> Urdf:
    """The robot with a cube of ``mass`` kg at its last link."""
    return with_mass(urdf, last_link(urdf, names), mass)


def with_mass(
    urdf: Urdf,
    parent: str,
    mass: float,
    center: Sequence[float] = (0.0, 0.0, 0.0),
    name: str = "",
) -> Urdf:
    """The robot with a cube of ``mass`` kg at a place of a link, m; names distinguish several."""
    root = copy.deepcopy(urdf.tree.root)
    link = ET.SubElement(root, "link", name=f"_payload{name}")
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "mass", value=f"{mass:.9g}")
    moment = f"{mass * (2.0 * HALF_EDGE) ** 2 / 6.0:.9g}"
    moments = dict.fromkeys(("ixx", "iyy", "izz"), moment)
    moments |= dict.fromkeys(("ixy", "ixz", "iyz"), "0")
    ET.SubElement(inertial, "inertia", moments)
    joint = ET.SubElement(root, "joint", name=f"_payload{name}_joint", type="fixed")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=f"_payload{name}")
    if any(center):
        ET.SubElement(joint, "origin", xyz=" ".join(f"{x:.9g}" for x in center))
    return replace(urdf, tree=Tree(root, urdf.source))


def usual_payload(settings: Settings) -> float:
    """The mass at the last link that loads no joint beyond PAYLOAD_SHARE of its torque, kg."""
    urdf = settings.simulation.urdf
    if urdf is None:
        return 0.0
    torques = {j.name: j.limits.torque for j in settings.board.joints if not j.kind.slides}
    tree = urdf.tree
    mass, lever, link = math.inf, 0.0, last_link(urdf, settings.board.names)
    while (element := tree.parent_joint.get(link)) is not None:
        name = element.get("name", "")
        if name in torques:
            mass = min(mass, PAYLOAD_SHARE * torques[name] / (GRAVITY * max(lever, LEAST_LEVER)))
        lever += float(np.linalg.norm(origin_of(element)[0]))
        link = tree.parent(element)
    return mass if math.isfinite(mass) else 0.0

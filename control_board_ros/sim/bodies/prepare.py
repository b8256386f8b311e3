# SPDX-License-Identifier: Apache-2.0
"""A robot description prepared for a board: driven joints, followers, fixed joints."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import NamedTuple

from ...core.config.config import BoardConfig, ConfigError
from ...core.model.coupling import Coupling, Gear
from ...core.terms.joint_kind import JointKind
from ...description.couplings import coupling_of, rotors_at_joints
from ...description.geometry import as_text, axis_of
from ...description.merge import merge_fixed
from ...description.urdf import Mimic, Urdf
from ...description.urdf_tree import Tree
from ..config import SimulationConfig
from ..motor import rotors_at_axes

SHAPES = ("visual", "collision")


@dataclass(frozen=True, slots=True)
class FittedRobot:
    """A robot with the joints of its board and their followers, without fixed ones.

    Attributes: tree (modifiable by its owner), joints (that the board moves, and their stops; in
    the order of the coupling), mimics (followers of the board's joints), rotors (rotor inertia at
    the joints, by joint, kg·m²), coupling (of the board's axes with the joints; None: they are the
    joints).
    """

    tree: Tree
    joints: tuple[Stops, ...]
    mimics: tuple[Mimic, ...]
    rotors: dict[str, float]
    coupling: Coupling | None

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.joints)

    @property
    def gears(self) -> tuple[Gear, ...]:
        """How joints follow others by a coupling."""
        return () if self.coupling is None else self.coupling.gears

    def text(self, *, shapes: bool) -> str:
        """The URDF with its shapes, possibly large meshes, or with masses and joints only."""
        root = self.tree.root
        if shapes:
            return ET.tostring(root, encoding="unicode")
        links = [(link, list(link)) for link in root.iter("link")]
        for link, elements in links:
            link[:] = [element for element in elements if element.tag not in SHAPES]
        text = ET.tostring(root, encoding="unicode")
        for link, elements in links:
            link[:] = elements
        return text


class Stops(NamedTuple):
    """Hard stops of a joint, rad or m; none where they are infinite."""

    name: str
    lower: float
    upper: float


def fit(board: BoardConfig, simulation: SimulationConfig) -> FittedRobot:
    """Fit the robot of a simulation to its board.

    Joints that are neither driven nor followers of driven ones become fixed, and links on fixed
    joints are merged. A follower that the board drives itself becomes independent.

    Raises:
        ConfigError: there is no description, or it lacks a joint of the board.
    """
    if (urdf := simulation.urdf) is None:
        raise ConfigError("simulation.urdf", None, "a robot, for a body that has links")
    moving = [*urdf.independent, *urdf.mimics]
    for name in board.names:
        if name not in moving:
            raise ConfigError("joints", name, f"a joint of the URDF: {', '.join(moving)}")
    coupling, stops = _coupled(board, urdf)
    names = [stop.name for stop in stops]
    mimics = {
        name: mimic
        for name, mimic in urdf.mimics.items()
        if name not in names and mimic.leader in names
    }
    tree = urdf.tree.copy()
    for joint in urdf.joints:
        element = tree.joints[joint.name]
        if joint.name not in names and joint.name not in mimics:
            element.set("type", "fixed")
        elif (axis := element.find("axis")) is not None:  # its length would be a lever in pybullet
            axis.set("xyz", as_text(axis_of(element)))
    reflected = dict(zip(board.names, rotors_at_axes(board, simulation).tolist(), strict=True))
    rotors = dict.fromkeys(names, 0.0) | rotors_at_joints(urdf, reflected)
    return FittedRobot(merge_fixed(tree), stops, tuple(mimics.values()), rotors, coupling)


def _coupled(board: BoardConfig, urdf: Urdf) -> tuple[Coupling | None, tuple[Stops, ...]]:
    """The coupling of a board's axes with joints that they drive, and the stops of these."""
    stops = {
        joint.name: Stops(joint.name, -math.inf, math.inf)
        if joint.kind == JointKind.CONTINUOUS
        else Stops(joint.name, joint.limits.hard_lower, joint.limits.hard_upper)
        for joint in board.joints
    }
    try:
        coupling = coupling_of(urdf, board.names, followers=False)
        if coupling is None:
            return None, tuple(stops.values())
        _ = coupling.gears
    except ValueError as error:
        raise ConfigError("couplings", ", ".join(board.names), str(error)) from None
    coupled = {joint for c in urdf.coupled for joint in c.coupling.physical_joints}
    known = {joint.name: joint for joint in urdf.joints}
    return coupling, tuple(
        stops[name] if name not in coupled else Stops(name, known[name].lower, known[name].upper)
        for name in coupling.physical_joints
    )

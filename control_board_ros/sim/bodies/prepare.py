# SPDX-License-Identifier: Apache-2.0
"""A robot description prepared for a board: driven joints, followers, fixed joints."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass

from ...core.config.config import BoardConfig, ConfigError
from ...description.geometry import as_text, axis_of
from ...description.merge import merge_fixed
from ...description.rotor import Moments, add_rotor_inertia
from ...description.urdf import Mimic
from ...description.urdf_tree import Tree
from ..config import SimulationConfig
from ..motor import reflected_inertia

SHAPES = ("visual", "collision")


@dataclass(frozen=True, slots=True)
class Fitted:
    """A robot with the joints of its board and their followers, without fixed ones.

    Attributes: tree (modifiable by its owner), mimics (followers of the board's joints), rotors
    (rotor inertia at the joints, by joint, kg·m²).
    """

    tree: Tree
    mimics: tuple[Mimic, ...]
    rotors: dict[str, float]


@dataclass(frozen=True, slots=True)
class Model:
    """The description loaded by pybullet.

    Attributes: root (of the URDF), mimics (followers of the board's joints), moments (inertia to
    set afterwards, by link, kg·m²; see ``rotor``).
    """

    root: ET.Element
    mimics: tuple[Mimic, ...]
    moments: Moments

    def text(self, *, shapes: bool) -> str:
        """The URDF with its shapes, possibly large meshes, or with masses and joints only."""
        if shapes:
            return ET.tostring(self.root, encoding="unicode")
        links = [(link, list(link)) for link in self.root.iter("link")]
        for link, elements in links:
            link[:] = [element for element in elements if element.tag not in SHAPES]
        text = ET.tostring(self.root, encoding="unicode")
        for link, elements in links:
            link[:] = elements
        return text


def fit(board: BoardConfig, simulation: SimulationConfig) -> Fitted:
    """Fit the robot of a simulation to its board.

    Joints that are neither driven nor followers of driven ones become fixed, and links on fixed
    joints are merged. A follower that the board drives itself becomes independent.

    Raises:
        ConfigError: there is no description, or it lacks a joint of the board.
    """
    if (urdf := simulation.urdf) is None:
        raise ConfigError("simulation.urdf", None, "a robot, for a body that has links")
    moving = [joint.name for joint in urdf.joints]
    for name in board.names:
        if name not in moving:
            raise ConfigError("joints", name, f"a joint of the URDF: {', '.join(moving)}")
    mimics = {
        name: mimic
        for name, mimic in urdf.mimics.items()
        if name not in board.names and mimic.leader in board.names
    }
    tree = urdf.tree.copy()
    for joint in urdf.joints:
        element = tree.joints[joint.name]
        if joint.name not in board.names and joint.name not in mimics:
            element.set("type", "fixed")
        elif (axis := element.find("axis")) is not None:  # its length would be a lever in pybullet
            axis.set("xyz", as_text(axis_of(element)))
    rotors = dict(zip(board.names, reflected_inertia(board, simulation).tolist(), strict=True))
    return Fitted(merge_fixed(tree), tuple(mimics.values()), rotors)


def prepare(board: BoardConfig, simulation: SimulationConfig) -> Model:
    """A robot fitted to its board, for pybullet.

    Raises:
        ConfigError: there is no description, or it does not fit the board.
    """
    fitted = fit(board, simulation)
    root = fitted.tree.root
    moments = add_rotor_inertia(fitted.tree, fitted.rotors)
    ET.indent(root)  # pybullet cannot read long lines
    return Model(root, fitted.mimics, moments)

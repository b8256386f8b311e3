# SPDX-License-Identifier: Apache-2.0
"""A robot description made ready for one board: what is driven, what follows, what is fixed."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass

from ...core.config import BoardConfig, ConfigError
from ...description.geometry import as_text, axis_of
from ...description.merge import merge_fixed
from ...description.rotor import Moments, add_rotor_inertia
from ...description.urdf import Mimic
from ..config import SimulationConfig
from ..motor import reflected_inertia


@dataclass(frozen=True, slots=True)
class Model:
    """What the physics loads.

    Attributes: text (URDF), mimics (joints that follow a joint of the board), moments (inertia
    to set afterwards, by link, kg·m²; see ``rotor``).
    """

    text: str
    mimics: tuple[Mimic, ...]
    moments: Moments


def prepare(board: BoardConfig, simulation: SimulationConfig) -> Model:
    """Fit the robot of a simulation to its board.

    Joints that neither the board drives nor follow one that it drives become fixed, and links
    on fixed joints part of the links that carry them. A joint that the board drives itself
    follows none.

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
    tree = merge_fixed(tree)
    rotors = dict(zip(board.names, reflected_inertia(board, simulation).tolist(), strict=True))
    moments = add_rotor_inertia(tree, rotors)
    ET.indent(tree.root)  # pybullet cannot read long lines
    return Model(ET.tostring(tree.root, encoding="unicode"), tuple(mimics.values()), moments)

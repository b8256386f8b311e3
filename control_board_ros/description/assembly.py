# SPDX-License-Identifier: Apache-2.0
"""Several robots as one description, each fixed to the world or to a link of another."""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .geometry import as_text
from .urdf import Urdf, of_tree
from .urdf_tree import Tree

WORLD = "world"
Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Piece:
    """One of the robots.

    Attributes: robot (as the parameter), prefix (of the names of its links and joints), on (the
    supporting link, with that robot's prefix), xyz (m) and rpy (rad) of its base link in the axes
    of that link.
    """

    robot: str
    prefix: str = ""
    on: str = WORLD
    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)


def assemble(name: str, pieces: Sequence[Piece], load: Callable[[str], Urdf]) -> Urdf:
    """One description of all pieces, each fixed to its supporting link.

    Raises:
        UrdfError: a piece cannot be loaded, or two links or joints have the same name.
    """
    root = ET.Element("robot", name=name)
    ET.SubElement(root, "link", name=WORLD)
    loaded = [load(piece.robot) for piece in pieces]
    for piece, urdf in zip(pieces, loaded, strict=True):
        root.extend(renamed(element, piece.prefix) for element in urdf.tree.root)
        base = piece.prefix + urdf.tree.base
        joint = ET.SubElement(root, "joint", name=f"{base}_mount", type="fixed")
        ET.SubElement(joint, "parent", link=piece.on)
        ET.SubElement(joint, "child", link=base)
        ET.SubElement(
            joint, "origin", xyz=as_text(np.array(piece.xyz)), rpy=as_text(np.array(piece.rpy))
        )
    warnings = [warning for urdf in loaded for warning in urdf.warnings]
    return of_tree(name, Tree(root, name), [*dict.fromkeys(warnings)])


def renamed(element: ET.Element, prefix: str) -> ET.Element:
    """A copy with prefixed names of links and joints; material names are unchanged."""
    made = copy.deepcopy(element)
    if made.tag in ("link", "joint"):
        made.set("name", prefix + made.get("name", ""))
    for tag, attribute in (("parent", "link"), ("child", "link"), ("mimic", "joint")):
        if made.tag == "joint" and (end := made.find(tag)) is not None:
            end.set(attribute, prefix + end.get(attribute, ""))
    return made

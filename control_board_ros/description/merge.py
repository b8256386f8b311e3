# SPDX-License-Identifier: Apache-2.0
"""Links on fixed joints, merged into their supporting links: each link costs physics time.

Mass m, centre of mass c and inertia tensor I about it of two links in the axes of one::

    m = m1 + m2,  c = (m1 c1 + m2 c2)/m,  I = Σ I_k + m_k (d_k·d_k E − d_k d_kᵀ),  d_k = c_k − c

Many robots have frames without mass (sensors, tools): of the 213 joints of an iCub, 32 move.
pybullet's own flag would merge the placeholder moments of rotors (see ``rotor``).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np

from ..core.terms.measurement import Array
from .geometry import inertia_of, numbers_of, origin_of, set_origin
from .urdf_tree import Tree


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass (kg), centre of mass (shape (3,), m) and tensor about it (shape (3, 3), kg·m²)."""

    mass: float
    centre: Array
    tensor: Array

    def moved(self, position: Array, rotation: Array) -> Inertial:
        """In the axes of a frame in which its own has this origin and rotation."""
        centre = position + rotation @ self.centre
        return Inertial(self.mass, centre, rotation @ self.tensor @ rotation.T)

    def __add__(self, other: Inertial) -> Inertial:
        mass = self.mass + other.mass
        if mass == 0.0:
            return Inertial(0.0, self.centre, self.tensor + other.tensor)
        centre = (self.mass * self.centre + other.mass * other.centre) / mass
        return Inertial(mass, centre, self.about(centre) + other.about(centre))

    def about(self, point: Array) -> Array:
        """Tensor about a point, by Steiner's theorem."""
        offset = self.centre - point
        return self.tensor + self.mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))


NOTHING = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))


def merge_fixed(tree: Tree) -> Tree:
    """The robot without fixed joints; the tree is changed.

    A link gets masses, shapes and joints of those that are fixed to it. The links behind
    moving joints, and the base link, keep their frames.
    """
    for joint in reversed(list(tree.walk(tree.base))):
        if joint.get("type") != "fixed":
            continue
        parent, child = tree.parent(joint), tree.child(joint)
        carrier, link = tree.links[parent], tree.links[child]
        position, rotation = origin_of(joint)
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            _move(shape, position, rotation)
            carrier.append(shape)
        for beyond in list(tree.children[child]):
            _move(beyond, position, rotation)
            tree.attach(beyond, parent)
        inertials = [inertial_of(carrier), inertial_of(link)]
        if (added := inertials[1]) is not None:
            added = added.moved(position, rotation)
            _set_inertial(carrier, added if inertials[0] is None else inertials[0] + added)
        tree.root.remove(joint)
        tree.root.remove(link)
    return Tree(tree.root, tree.source)


def inertial_of(link: ET.Element) -> Inertial | None:
    inertial = link.find("inertial")
    if inertial is None:
        return None
    mass = float(numbers_of(inertial.find("mass"), "value", (0.0,))[0])
    return Inertial(mass, numbers_of(inertial.find("origin"), "xyz"), inertia_of(link))


def _set_inertial(link: ET.Element, made: Inertial) -> None:
    if (old := link.find("inertial")) is not None:
        link.remove(old)
    inertial = ET.SubElement(link, "inertial")
    set_origin(inertial, made.centre, np.eye(3))
    ET.SubElement(inertial, "mass", value=repr(made.mass))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = made.tensor.tolist()
    moments = {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}
    ET.SubElement(inertial, "inertia", {key: repr(value) for key, value in moments.items()})


def _move(element: ET.Element, position: Array, rotation: Array) -> None:
    """Transform an element from a frame with this origin and rotation."""
    offset, turn = origin_of(element)
    set_origin(element, position + rotation @ offset, rotation @ turn)

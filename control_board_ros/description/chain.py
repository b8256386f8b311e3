# SPDX-License-Identifier: Apache-2.0
"""Extraction of one limb from a robot."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from ..core.terms.measurement import Array
from .geometry import origin_of, set_origin
from .urdf_tree import Tree
from .urdf_xml import UrdfError


def cut(tree: Tree, base: str, tip: str) -> Tree:
    """Keep the chain from base to tip and the masses fixed to it.

    The base link keeps its pose in the robot with all joints at zero, so that gravity acts as in
    the whole robot. The robot's own base link remains as a bare frame that supports it.

    Raises:
        UrdfError: a link is missing, or base is not an ancestor of tip.
    """
    chain = _chain(tree, base, tip)
    kept = {base}
    stack = [base]
    while stack:
        for joint in tree.children[stack.pop()]:
            child = tree.child(joint)
            rigid = joint.get("type") == "fixed" and tree.has_mass(child)
            if child in chain or rigid:
                kept.add(child)
                stack.append(child)
    position, rotation = _pose(tree, base)
    for name, element in tree.links.items():
        if name not in kept:
            tree.root.remove(element)
    for joint in tree.joints.values():
        if tree.child(joint) not in kept - {base}:
            tree.root.remove(joint)
    if base != tree.base:
        _hang(tree, base, position, rotation)
    return Tree(tree.root, tree.source)


def _chain(tree: Tree, base: str, tip: str) -> set[str]:
    """The links from base to tip, both included."""
    for link in (base, tip):
        if link not in tree.links:
            raise UrdfError(f"{tree.source}: link {link!r} is not in the URDF")
    chain, link = {tip}, tip
    while link != base:
        if link not in tree.parent_joint:
            raise UrdfError(f"{tree.source}: no chain leads from {base!r} to {tip!r}")
        link = tree.parent(tree.parent_joint[link])
        chain.add(link)
    return chain


def _pose(tree: Tree, link: str) -> tuple[Array, Array]:
    """Position, shape (3,), and rotation, shape (3, 3), of a link in the robot's base link."""
    position, rotation = np.zeros(3), np.eye(3)
    while link in tree.parent_joint:
        joint = tree.parent_joint[link]
        offset, turn = origin_of(joint)
        position, rotation = offset + turn @ position, turn @ rotation
        link = tree.parent(joint)
    return position, rotation


def _hang(tree: Tree, base: str, position: Array, rotation: Array) -> None:
    """Restore the robot's base link, bare, and fix the chain's base to it."""
    tree.root.insert(0, ET.Element("link", name=tree.base))
    mount = ET.SubElement(tree.root, "joint", name=f"{base}_mount", type="fixed")
    ET.SubElement(mount, "parent", link=tree.base)
    ET.SubElement(mount, "child", link=base)
    set_origin(mount, position, rotation)

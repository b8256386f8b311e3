# SPDX-License-Identifier: Apache-2.0
"""A robot as a checked tree: one base link, one parent joint per other link, no loops."""

from __future__ import annotations

import copy
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator

from ..core.terms.joint_kind import JointKind
from ..urdf_xml import UrdfError

LONGEST_NAME = 200


class Tree:
    """The links and joints of a robot.

    Attributes: root (the <robot> element), source (the file, for messages), links and joints
    (elements by name), base (name of the base link), parent_joint (by child link), children
    (joints of a parent link, in file order, by link).

    Raises:
        UrdfError: links and joints do not form a tree, or a name is not usable.
    """

    def __init__(self, root: ET.Element, source: str) -> None:
        self.root, self.source = root, source
        self.links = self._named("link")
        self.joints = self._named("joint")
        self.parent_joint: dict[str, ET.Element] = {}
        self.children: dict[str, list[ET.Element]] = {name: [] for name in self.links}
        for name, joint in self.joints.items():
            parent, child = (self._link(name, joint, tag) for tag in ("parent", "child"))
            if child in self.parent_joint:
                raise UrdfError(f"{source}: link {child!r} hangs on two joints; it may on one")
            self.parent_joint[child] = joint
            self.children[parent].append(joint)
        if not self.links:
            raise UrdfError(f"{source}: there is no <link>; a robot has one base link at least")
        bases = [name for name in self.links if name not in self.parent_joint]
        if len(bases) != 1:
            names = ", ".join(map(repr, bases[:4])) or "none"
            raise UrdfError(f"{source}: a robot has one base link, this one has {names}")
        self.base = bases[0]
        if sum(1 for _ in self.walk(self.base)) != len(self.joints):
            raise UrdfError(f"{source}: the joints form a loop; a URDF is a tree")

    def _named(self, tag: str) -> dict[str, ET.Element]:
        elements: dict[str, ET.Element] = {}
        for element in self.root.findall(tag):
            name = element.get("name", "")
            if (reason := _not_usable(name)) is not None:
                raise UrdfError(
                    f"{self.source}: {tag} name {name[:40]!r} is not usable: {reason}; rename it "
                    "in the URDF"
                )
            if name in elements:
                raise UrdfError(f"{self.source}: {tag} {name!r} is there twice; rename one")
            elements[name] = element
        return elements

    def _link(self, name: str, joint: ET.Element, tag: str) -> str:
        link = _end(joint, tag)
        if link not in self.links:
            raise UrdfError(
                f"{self.source}: joint {name!r}: its {tag} link {link!r} is not in the URDF"
            )
        return link

    def copy(self) -> Tree:
        return Tree(copy.deepcopy(self.root), self.source)

    def attach(self, joint: ET.Element, link: str) -> None:
        """Change the parent link of a joint."""
        self.children[self.parent(joint)].remove(joint)
        self.children[link].append(joint)
        element = joint.find("parent")
        assert element is not None  # checked when the tree was made
        element.set("link", link)

    @staticmethod
    def parent(joint: ET.Element) -> str:
        return _end(joint, "parent")

    @staticmethod
    def child(joint: ET.Element) -> str:
        return _end(joint, "child")

    @staticmethod
    def slides(joint: ET.Element) -> bool:
        return JointKind.of(joint.get("type")).slides

    def walk(self, link: str) -> Iterator[ET.Element]:
        """The joints beyond a link, depth first, in file order."""
        stack = list(reversed(self.children[link]))
        while stack:
            joint = stack.pop()
            yield joint
            stack += reversed(self.children[self.child(joint)])

    def moving(self) -> list[ET.Element]:
        """The movable joints, from the base outwards."""
        return [joint for joint in self.walk(self.base) if joint.get("type") != "fixed"]

    def has_mass(self, link: str) -> bool:
        """Whether a link, or one fixed to it, has an <inertial>."""
        stack = [link]
        while stack:
            link = stack.pop()
            if self.links[link].find("inertial") is not None:
                return True
            fixed = [joint for joint in self.children[link] if joint.get("type") == "fixed"]
            stack += map(self.child, fixed)
        return False

    def add_masses(self) -> list[str]:
        """Add a negligible mass to links without <inertial>; pybullet assumes 1 kg.

        What a sliding joint carries counts as without one where it has no mass.

        Returns:
            A warning for each joint without any moved mass: its link gets 1 kg.
        """
        for joint in self.walk(self.base):
            child = self.child(joint)
            carried = [self.links[link] for link in (child, *map(self.child, self.walk(child)))]
            if self.slides(joint) and not any(_mass(link) > ROUNDING for link in carried):
                for link in carried:
                    for inertial in link.findall("inertial"):
                        link.remove(inertial)
        warnings = []
        for name, link in self.links.items():
            if link.find("inertial") is not None or name == self.base:
                continue
            beyond = [self.child(joint) for joint in self.walk(name)]
            light = any(self.links[other].find("inertial") is not None for other in beyond)
            fixed = self.parent_joint[name].get("type") == "fixed"
            mass, inertia = ("1e-4", "1e-7") if light or fixed else ("1", "0.01")
            if not (light or fixed):
                warnings.append(f"link {name!r} has no mass; 1 kg is assumed")
            inertial = ET.SubElement(link, "inertial")
            ET.SubElement(inertial, "mass", value=mass)
            moments = {"ixx": inertia, "iyy": inertia, "izz": inertia}
            ET.SubElement(inertial, "inertia", moments, ixy="0", ixz="0", iyz="0")
        return warnings


def _end(joint: ET.Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def _mass(link: ET.Element) -> float:
    mass = link.find("inertial/mass")
    return 0.0 if mass is None else float(mass.get("value", "0"))


def _not_usable(name: str) -> str | None:
    """Why a name is invalid for a link or joint; None if valid."""
    if not name:
        return "it is empty or missing"
    if len(name) > LONGEST_NAME:
        return f"it is longer than {LONGEST_NAME} characters"
    if name.split() != [name]:
        return "a space ends a name in parameters and commands, as in 'joint_1=30deg'"
    if not name.isprintable():
        return "it holds a character that cannot be printed"
    return None


#: Numeric attributes by element, with their count of numbers.
NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
    "dynamics": {"damping": 1, "friction": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "mesh": {"scale": 3},
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "color": {"rgba": 4},
}
#: Nonnegative ones, within rounding: exporters write -5e-20 kg·m².
ROUNDING = 1e-12
#: Greatest magnitude, so that products stay finite; of <limit>: see ``urdf.MAX_LIMIT``.
MAX_NUMBER = 1e12
POSITIVE = {("mass", "value"), ("inertia", "ixx"), ("inertia", "iyy"), ("inertia", "izz")}


def check_numbers(root: ET.Element, source: str) -> None:
    """Raise UrdfError for a numeric attribute that is not finite numbers."""
    for owner in root:
        for element in owner.iter():
            for attribute, count in NUMBERS.get(element.tag, {}).items():
                text = element.get(attribute)
                positive = (element.tag, attribute) in POSITIVE
                high = sys.float_info.max if element.tag == "limit" else MAX_NUMBER
                low = -ROUNDING if positive else -high
                if text is None or _are_numbers(text, count, low, high):
                    continue
                allowed = "a number" if count == 1 else f"{count} numbers"
                allowed += " of at least 0" if positive else ""
                raise UrdfError(
                    f"{source}: {owner.tag} {owner.get('name', '')!r}: <{element.tag} "
                    f"{attribute}={text[:40]!r}> is not {allowed}; numbers are finite, up to "
                    f"{MAX_NUMBER:g}, with spaces between"
                )


def _are_numbers(text: str, count: int, low: float, high: float) -> bool:
    try:
        values = list(map(float, text.split()))
    except ValueError:
        return False
    right = len(values) == count and "_" not in text
    return right and all(low <= value <= high for value in values)


def check_expanded(data: bytes, root: ET.Element, source: str) -> None:
    """Raise UrdfError for unexpanded xacro."""
    if not any(mark in data for mark in (b"<xacro:", b"${", b"$(")):
        return
    for element in root.iter():
        left = [f"<{element.tag}>"] if element.tag.startswith("xacro:") else []
        for key, text in element.attrib.items():
            if "${" in text or "$(" in text:
                left.append(f"<{element.tag} {key}={text[:40]!r}>")
        if left:
            raise UrdfError(
                f"{source}: {left[0]} is for xacro to replace; give the .xacro file itself as "
                "robot, or what the command xacro makes of it"
            )

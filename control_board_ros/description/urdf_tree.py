# SPDX-License-Identifier: Apache-2.0
"""The XML of a robot description as a checked tree of links and joints.

Bounded in size, depth and number of elements, without document types and entities; every
number finite; one base link, every other link on exactly one joint, no loops.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from xml.parsers import expat

from .errors import OneLineError

SIZE_CAP = 5 * 1024 * 1024
DEPTH_CAP = 64
ELEMENT_CAP = 50_000


class UrdfError(OneLineError):
    """A robot description that cannot be used; one line: file, what, the next step."""


#: Attributes that are numbers, and how many each holds.
NUMBERS = {
    ("origin", "xyz"): 3,
    ("origin", "rpy"): 3,
    ("axis", "xyz"): 3,
    ("mass", "value"): 1,
    **{("inertia", moment): 1 for moment in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")},
    **{("limit", bound): 1 for bound in ("lower", "upper", "effort", "velocity")},
    ("dynamics", "damping"): 1,
    ("dynamics", "friction"): 1,
    ("mimic", "multiplier"): 1,
    ("mimic", "offset"): 1,
    ("mesh", "scale"): 3,
    ("box", "size"): 3,
    ("sphere", "radius"): 1,
    ("cylinder", "radius"): 1,
    ("cylinder", "length"): 1,
    ("color", "rgba"): 4,
}
#: Those of them that cannot be below zero.
POSITIVE = {("mass", "value"), ("inertia", "ixx"), ("inertia", "iyy"), ("inertia", "izz")}


def check_numbers(root: ET.Element, source: str) -> None:
    """Raise UrdfError where an attribute that is to be numbers is not, or is not finite."""
    for owner in root:
        for element in owner.iter():
            for attribute, text in element.attrib.items():
                count = NUMBERS.get((element.tag, attribute))
                low = 0.0 if (element.tag, attribute) in POSITIVE else -math.inf
                if count is None or _are_numbers(text, count, low):
                    continue
                wanted = "a number" if count == 1 else f"{count} numbers"
                wanted += " of at least 0" if low == 0.0 else ""
                raise UrdfError(
                    f"{source}: {owner.tag} {owner.get('name', '')!r}: <{element.tag} "
                    f"{attribute}={text[:40]!r}> is not {wanted}"
                )


def _are_numbers(text: str, count: int, low: float) -> bool:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return False
    right = len(values) == count and "_" not in text
    return right and all(low <= value < math.inf and value > -math.inf for value in values)


def parse_xml(data: bytes, source: str) -> ET.Element:
    """XML without DTD and entities, bounded in size, depth and number of elements."""
    if len(data) > SIZE_CAP:
        raise UrdfError(f"{source}: larger than {SIZE_CAP >> 20} MiB; no URDF is")
    if not data.strip():
        raise UrdfError(f"{source}: is empty; a URDF begins with <robot name=…>")
    parser = expat.ParserCreate()
    depth = count = 0

    def refuse(*_: object) -> None:
        raise UrdfError(
            f"{source}:{parser.CurrentLineNumber}: document types and entities are not allowed "
            "in a URDF; remove <!DOCTYPE …>"
        )

    def start(*_: object) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > DEPTH_CAP or count > ELEMENT_CAP:
            raise UrdfError(
                f"{source}:{parser.CurrentLineNumber}: nested deeper than {DEPTH_CAP} or more "
                f"than {ELEMENT_CAP} elements; no URDF is"
            )

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        parser.Parse(data, True)
        return ET.fromstring(data)
    except UrdfError:
        raise
    except (expat.ExpatError, ET.ParseError, LookupError, ValueError) as error:
        line = f":{error.lineno}" if isinstance(error, expat.ExpatError) else ""
        reason = " ".join(str(error).partition(": line ")[0].split())
        raise UrdfError(f"{source}{line}: not well-formed XML ({reason})") from None


class Tree:
    """The links and joints of a robot: one root link, every other link hangs on one joint."""

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
        bases = [name for name in self.links if name not in self.parent_joint]
        if len(bases) != 1:
            found = ", ".join(map(repr, bases[:4])) or "none"
            raise UrdfError(f"{source}: a robot has one base link, this one has {found}")
        self.base = bases[0]
        if sum(1 for _ in self.walk(self.base)) != len(self.joints):
            raise UrdfError(f"{source}: the joints form a loop; a URDF is a tree")

    def _named(self, tag: str) -> dict[str, ET.Element]:
        found: dict[str, ET.Element] = {}
        for element in self.root.findall(tag):
            name = element.get("name", "")
            if not name or len(name) > 200 or not name.isprintable() or " " in name:
                raise UrdfError(f"{self.source}: {tag} name {name[:40]!r} is not usable")
            if name in found:
                raise UrdfError(f"{self.source}: {tag} {name!r} is there twice; rename one")
            found[name] = element
        return found

    def _link(self, name: str, joint: ET.Element, tag: str) -> str:
        link = self.end(joint, tag)
        if link not in self.links:
            raise UrdfError(
                f"{self.source}: joint {name!r}: its {tag} link {link!r} is not in the URDF"
            )
        return link

    @staticmethod
    def end(joint: ET.Element, tag: str) -> str:
        """The link at one end of a joint: its ``parent`` or ``child``."""
        element = joint.find(tag)
        return "" if element is None else element.get("link", "")

    def child(self, joint: ET.Element) -> str:
        """The link that a joint moves."""
        return self.end(joint, "child")

    def walk(self, link: str) -> Iterator[ET.Element]:
        """The joints beyond a link, depth first, in the order of the file."""
        stack = list(reversed(self.children[link]))
        while stack:
            joint = stack.pop()
            yield joint
            stack += reversed(self.children[self.child(joint)])

    def moving(self) -> list[ET.Element]:
        """The joints that are not fixed, from the base outwards."""
        return [joint for joint in self.walk(self.base) if joint.get("type") != "fixed"]

    def has_mass(self, link: str) -> bool:
        """Whether a link, or one fixed to it, has an inertial element."""
        stack = [link]
        while stack:
            link = stack.pop()
            if self.links[link].find("inertial") is not None:
                return True
            fixed = [joint for joint in self.children[link] if joint.get("type") == "fixed"]
            stack += map(self.child, fixed)
        return False

    def add_masses(self) -> list[str]:
        """Give links without <inertial> next to no mass; pybullet would give them 1 kg each.

        Returns:
            A warning for each joint that would move no mass at all: its link gets 1 kg.
        """
        warnings = []
        for name, link in self.links.items():
            if link.find("inertial") is not None or name == self.base:
                continue
            beyond = [self.child(joint) for joint in self.walk(name)]
            light = any(self.links[other].find("inertial") is not None for other in beyond)
            fixed = self.parent_joint[name].get("type") == "fixed"
            mass, inertia = ("1e-4", "1e-7") if light or fixed else ("1", "0.01")
            if not (light or fixed):
                warnings.append(f"link {name!r} has no <inertial>; 1 kg is assumed")
            inertial = ET.SubElement(link, "inertial")
            ET.SubElement(inertial, "mass", value=mass)
            moments = {"ixx": inertia, "iyy": inertia, "izz": inertia}
            ET.SubElement(inertial, "inertia", moments, ixy="0", ixz="0", iyz="0")
        return warnings

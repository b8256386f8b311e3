# SPDX-License-Identifier: Apache-2.0
"""Checks of a robot description's XML: valid numbers, no unexpanded xacro."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from .. import urdf_xml
from .errors import OneLineError

SIZE_CAP = urdf_xml.SIZE_CAP


class UrdfError(OneLineError):
    """An unusable robot description; one line: file, problem, next step."""


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
POSITIVE = {("mass", "value"), ("inertia", "ixx"), ("inertia", "iyy"), ("inertia", "izz")}


def check_numbers(root: ET.Element, source: str) -> None:
    """Raise UrdfError for a numeric attribute that is not finite numbers."""
    for owner in root:
        for element in owner.iter():
            for attribute, count in NUMBERS.get(element.tag, {}).items():
                text = element.get(attribute)
                positive = (element.tag, attribute) in POSITIVE
                low = -ROUNDING if positive else -math.inf
                if text is None or _are_numbers(text, count, low):
                    continue
                wanted = "a number" if count == 1 else f"{count} numbers"
                wanted += " of at least 0" if positive else ""
                raise UrdfError(
                    f"{source}: {owner.tag} {owner.get('name', '')!r}: <{element.tag} "
                    f"{attribute}={text[:40]!r}> is not {wanted}; numbers are finite and have "
                    "spaces between"
                )


def _are_numbers(text: str, count: int, low: float) -> bool:
    try:
        values = list(map(float, text.split()))
    except ValueError:
        return False
    right = len(values) == count and "_" not in text
    return right and all(map(math.isfinite, values)) and min(values) >= low


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


def parse_xml(data: bytes, source: str) -> ET.Element:
    """As :func:`control_board_ros.urdf_xml.parse_xml`; UrdfError outside its bounds."""
    try:
        return urdf_xml.parse_xml(data, source)
    except urdf_xml.XmlError as error:
        raise UrdfError(str(error)) from None

# SPDX-License-Identifier: Apache-2.0
"""What the command line takes from a URDF: kinds and hard limits of joints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree import ElementTree


@dataclass(frozen=True, slots=True)
class JointDescription:
    """A joint of the URDF: kind, and its stops (rad or m; infinite where it has none)."""

    kind: str
    lower: float = -math.inf
    upper: float = math.inf

    @property
    def prismatic(self) -> bool:
        return self.kind == "prismatic"

    @property
    def dimension(self) -> str:
        """``length`` or ``angle``."""
        return "length" if self.prismatic else "angle"


def describe(urdf: str) -> dict[str, JointDescription]:
    """The joints of a URDF by name; empty when it cannot be read."""
    try:
        robot = ElementTree.fromstring(urdf)
    except ElementTree.ParseError:
        return {}
    joints = {}
    for joint in robot.findall("joint"):
        kind = joint.get("type", "")
        limit = joint.find("limit")
        if limit is None or kind == "continuous":
            joints[joint.get("name", "")] = JointDescription(kind)
            continue
        joints[joint.get("name", "")] = JointDescription(
            kind, float(limit.get("lower", 0.0)), float(limit.get("upper", 0.0))
        )
    return joints

# SPDX-License-Identifier: Apache-2.0
"""The XML of robot descriptions, which is untrusted: bounded, without DTD and entities.

The one reader of ``<joint>``, for files and for the descriptions that boards publish.
"""

from __future__ import annotations

import codecs
import math
import os
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from .core.terms.joint_kind import JointKind
from .text import OneLineError

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)
SIZE_CAP = 5 * 1024 * 1024
DEPTH_CAP = 64
ELEMENT_CAP = 50_000
#: Greatest size of a published description, in multiples of a file's: it may join several files.
PUBLISHED = 4


class UrdfError(OneLineError):
    """An unusable robot description: place, problem, next step."""


@dataclass(frozen=True, slots=True)
class DescribedJoint:
    """A joint of a robot description: the one reading of <joint>.

    Attributes:
        kind: ``revolute``, ``prismatic``, ….
        lower, upper: Its stops, rad or m; infinite where it has none.
        velocity, effort: Its limits; None where it has none.
        parent, child: Its links.
        xyz, rpy: Of its frame in that of the parent link, m and rad.
        axis: In its own frame, as written.
        leader: The joint that it follows, q = multiplier · leader + offset; None: none.
        damping, friction: N·m·s/rad or N·s/m, and N·m or N; 0: unknown.
    """

    kind: str
    lower: float = -math.inf
    upper: float = math.inf
    velocity: float | None = None
    effort: float | None = None
    parent: str = ""
    child: str = ""
    xyz: Vector = ZERO
    rpy: Vector = ZERO
    axis: Vector = (1.0, 0.0, 0.0)
    leader: str | None = None
    multiplier: float = 1.0
    offset: float = 0.0
    damping: float = 0.0
    friction: float = 0.0

    @property
    def slides(self) -> bool:
        return JointKind.of(self.kind).slides

    @property
    def dimension(self) -> str:
        """``length`` or ``angle``."""
        return JointKind.of(self.kind).choose("angle", "length")


def share_folders() -> list[Path]:
    """Where ``package://`` leads: the share folders of ROS prefixes and of this environment."""
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    shares = [Path(prefix) / "share" for prefix in [*prefixes, sys.prefix] if prefix]
    return list(dict.fromkeys(share for share in shares if share.is_dir()))


def published_joints(urdf: str) -> dict[str, DescribedJoint]:
    """The joints of a description that a board publishes, by name; none when it cannot be read."""
    try:
        return joints_in(published_robot(urdf))
    except UrdfError:
        return {}


def published_robot(urdf: str) -> ET.Element:
    """The root of a description that a board publishes.

    Raises:
        UrdfError: it cannot be used.
    """
    return parse_xml(urdf, "robot_description", PUBLISHED)


def joints_in(robot: ET.Element) -> dict[str, DescribedJoint]:
    return {joint.get("name", ""): joint_of(joint) for joint in robot.findall("joint")}


def joint_of(joint: ET.Element) -> DescribedJoint:
    """A <joint>; an invalid number counts as missing, a missing stop beside the other as zero."""
    kind, leader = joint.get("type", ""), joint.find("mimic")
    lower, upper = -math.inf, math.inf
    if kind != "continuous" and joint.find("limit") is not None:
        low, high = _number(joint, "limit", "lower", 0.0), _number(joint, "limit", "upper", 0.0)
        if low is not None and high is not None:
            lower, upper = low, high
    return DescribedJoint(
        kind,
        lower,
        upper,
        velocity=_number(joint, "limit", "velocity"),
        effort=_number(joint, "limit", "effort"),
        parent=_text(joint, "parent", "link", ""),
        child=_text(joint, "child", "link", ""),
        xyz=_vector(joint, "origin", "xyz", ZERO),
        rpy=_vector(joint, "origin", "rpy", ZERO),
        axis=_vector(joint, "axis", "xyz", (1.0, 0.0, 0.0)),
        leader=None if leader is None else leader.get("joint", ""),
        multiplier=_number(joint, "mimic", "multiplier", 1.0) or 0.0,
        offset=_number(joint, "mimic", "offset", 0.0) or 0.0,
        damping=_number(joint, "dynamics", "damping", 0.0) or 0.0,
        friction=_number(joint, "dynamics", "friction", 0.0) or 0.0,
    )


def _text(owner: ET.Element, tag: str, key: str, default: str) -> str:
    element = owner.find(tag)
    return default if element is None else element.get(key, default)


def _number(owner: ET.Element, tag: str, key: str, default: float | None = None) -> float | None:
    """A finite number of an attribute; the default where missing, None where invalid."""
    text = _text(owner, tag, key, "")
    if not text:
        return default
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _vector(owner: ET.Element, tag: str, key: str, default: Vector) -> Vector:
    """Three finite numbers of an attribute, or the default."""
    try:
        x, y, z = map(float, _text(owner, tag, key, "").split())
    except ValueError:
        return default
    return (x, y, z) if math.isfinite(x + y + z) else default


def parse_xml(document: bytes | str, source: str, times: int = 1) -> ET.Element:
    """XML without DTD and entities, bounded in size, depth and number of elements.

    Blank lines before the XML declaration and zeros at the end of the file are left out; a tag
    or attribute keeps the prefix of its namespace.

    Args:
        document: the XML; the encoding that a text declares is ignored.
        source: where it comes from, for people.
        times: its greatest size, in multiples of that of one file.

    Raises:
        UrdfError: not XML, or beyond the bounds.
    """
    data = document.encode(errors="replace") if isinstance(document, str) else document
    if len(data) > times * SIZE_CAP:
        raise UrdfError(f"{source}: larger than {times * SIZE_CAP >> 20} MiB; no URDF is")
    if not data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        data = data.rstrip(b"\0")
    blank = len(data) - len(data.lstrip())
    if blank == len(data):
        raise UrdfError(f"{source}: is empty; a URDF begins with <robot name=…>")
    skipped = data.count(b"\n", 0, blank)
    parser = _BoundedParser(lambda line: f"{source}:{skipped + line}", source, times * ELEMENT_CAP)
    return parser.parse(data[blank:], "utf-8" if isinstance(document, str) else None)


class _BoundedParser:
    """Builds a tree, and refuses what no URDF has.

    Args:
        place: file and line, for people, of a line of the data.
        source: the file.
        max_elements: greatest number of elements.
    """

    def __init__(self, place: Callable[[int], str], source: str, max_elements: int) -> None:
        self._place, self._source, self._max_elements = place, source, max_elements
        self._tree = ET.TreeBuilder()
        self._depth = self._count = 0

    def parse(self, data: bytes, encoding: str | None) -> ET.Element:
        """The root; ``encoding`` overrides the declared one."""
        self._parser = expat.ParserCreate(encoding)
        self._parser.buffer_text = True
        self._parser.StartDoctypeDeclHandler = self._refuse
        self._parser.EntityDeclHandler = self._refuse
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._tree.data
        try:
            self._parser.Parse(data, True)
            return self._tree.close()
        except UrdfError:
            raise
        except (expat.ExpatError, LookupError, ValueError) as error:
            at_line = isinstance(error, expat.ExpatError)
            where = self._place(self._parser.ErrorLineNumber) if at_line else self._source
            reason = " ".join(str(error).partition(": line ")[0].split())
            raise UrdfError(f"{where}: not well-formed XML ({reason})") from None

    def _refuse(self, *_: object) -> None:
        raise UrdfError(
            f"{self._place(self._parser.CurrentLineNumber)}: document types and entities are not "
            "allowed in a URDF; remove <!DOCTYPE …>"
        )

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth, self._count = self._depth + 1, self._count + 1
        if self._depth > DEPTH_CAP or self._count > self._max_elements:
            raise UrdfError(
                f"{self._place(self._parser.CurrentLineNumber)}: nested deeper than {DEPTH_CAP} "
                f"or more than {self._max_elements} elements; no URDF is"
            )
        self._tree.start(tag, attributes)

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self._tree.end(tag)

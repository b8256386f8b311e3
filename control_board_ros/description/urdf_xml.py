# SPDX-License-Identifier: Apache-2.0
"""The XML of a robot description: bounded, without DTD and entities, its numbers checked."""

from __future__ import annotations

import codecs
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from xml.parsers import expat

from .errors import OneLineError

SIZE_CAP = 5 * 1024 * 1024
DEPTH_CAP = 64
ELEMENT_CAP = 50_000


class UrdfError(OneLineError):
    """A robot description that cannot be used; one line: file, what, the next step."""


#: Attributes that are numbers, by element, and how many each holds.
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
#: Those of them that cannot be below zero, but by rounding: exporters write -5e-20 kg·m².
ROUNDING = 1e-12
POSITIVE = {("mass", "value"), ("inertia", "ixx"), ("inertia", "iyy"), ("inertia", "izz")}


def check_numbers(root: ET.Element, source: str) -> None:
    """Raise UrdfError where an attribute that is to be numbers is not, or is not finite."""
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
    """Raise UrdfError where something is left that xacro is to replace."""
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
    """XML without DTD and entities, bounded in size, depth and number of elements.

    Blank lines before the XML declaration and zeros at the end of the file are left out; a tag
    or attribute keeps the prefix of its namespace.
    """
    if len(data) > SIZE_CAP:
        raise UrdfError(f"{source}: larger than {SIZE_CAP >> 20} MiB; no URDF is")
    if not data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        data = data.rstrip(b"\0")
    blank = len(data) - len(data.lstrip())
    if blank == len(data):
        raise UrdfError(f"{source}: is empty; a URDF begins with <robot name=…>")
    skipped = data.count(b"\n", 0, blank)
    return _BoundedParser(lambda line: f"{source}:{skipped + line}", source).parse(data[blank:])


class _BoundedParser:
    """Builds a tree, and refuses what no URDF has.

    Args:
        place: file and line, for people, of a line of what is parsed.
        source: the file.
    """

    def __init__(self, place: Callable[[int], str], source: str) -> None:
        self._place, self._source = place, source
        self._parser, self._tree = expat.ParserCreate(), ET.TreeBuilder()
        self._depth = self._count = 0
        self._parser.buffer_text = True
        self._parser.StartDoctypeDeclHandler = self._refuse
        self._parser.EntityDeclHandler = self._refuse
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._tree.data

    def parse(self, data: bytes) -> ET.Element:
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
        if self._depth > DEPTH_CAP or self._count > ELEMENT_CAP:
            raise UrdfError(
                f"{self._place(self._parser.CurrentLineNumber)}: nested deeper than {DEPTH_CAP} "
                f"or more than {ELEMENT_CAP} elements; no URDF is"
            )
        self._tree.start(tag, attributes)

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self._tree.end(tag)

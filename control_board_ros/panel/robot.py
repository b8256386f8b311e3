# SPDX-License-Identifier: Apache-2.0
"""The robot for the page: kinds of joints, and meshes of the description.

A browser requests a mesh by its number in the description, never by a path. Only mesh files are
served, since any ROS node can publish a description.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

from ..urdf_xml import DescribedJoint, UrdfError, joints_in, published_robot, share_folders

#: Supported mesh types and their media types.
MEDIA = {
    ".stl": "model/stl",
    ".obj": "text/plain; charset=utf-8",
    ".dae": "text/xml; charset=utf-8",
}
MAX_MESH = 64 * 1024 * 1024
MAX_MESHES = 1000


@dataclass(frozen=True, slots=True)
class Robot:
    """The content of a description.

    Attributes: joints (by name), urdf (with meshes by number), meshes (their files).
    """

    joints: dict[str, DescribedJoint]
    urdf: str
    meshes: tuple[Path, ...]

    def kind(self, joint: str) -> str:
        """``revolute``, ``prismatic``, …; empty if unknown."""
        return self.joints[joint].kind if joint in self.joints else ""


NO_ROBOT = Robot({}, "", ())


def read(urdf: str, prefix: str) -> Robot:
    """Read a description; NO_ROBOT if invalid.

    Args:
        urdf: the description.
        prefix: of the mesh addresses, before number and suffix.
    """
    try:
        root = published_robot(urdf)
    except UrdfError:
        return NO_ROBOT
    numbers: dict[Path, int] = {}
    for link in root.iter("link"):
        for collision in link.findall("collision"):  # invisible
            link.remove(collision)
    for mesh in root.iter("mesh"):
        path = mesh_file(mesh.get("filename", ""))
        if path is None or (path not in numbers and len(numbers) >= MAX_MESHES):
            mesh.set("filename", "")
            continue
        number = numbers.setdefault(path, len(numbers))
        mesh.set("filename", f"{prefix}{number}{path.suffix.lower()}")
    return Robot(joints_in(root), ElementTree.tostring(root, "unicode"), tuple(numbers))


def mesh_file(name: str) -> Path | None:
    """The file of a ``package://`` or ``file://`` address; None if not a mesh here.

    The resolved path counts: links named like a mesh do not lead to other files.
    """
    scheme, mark, rest = name.partition("://")
    if not mark or "\0" in name or scheme not in ("package", "file"):
        return None
    inside = unquote(rest)
    places = [Path(inside)] if scheme == "file" else [share / inside for share in share_folders()]
    for place in places:
        try:
            path = place.resolve()
            if (
                place.is_absolute()
                and ".." not in place.parts
                and path.suffix.lower() in MEDIA
                and path.is_file()
                and path.stat().st_size <= MAX_MESH
            ):
                return path
        except OSError:
            continue
    return None

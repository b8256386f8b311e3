# SPDX-License-Identifier: Apache-2.0
"""Named robots, others by the path of their URDF, and several as one description."""

from __future__ import annotations

import copy
import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ..text import unknown_word
from ..urdf_xml import share_folders
from .geometry import as_text
from .meshes import package_folder
from .urdf import Urdf, UrdfError, load, of_tree
from .urdf_tree import Tree
from .xacro_file import split_arguments

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


def assemble(name: str, pieces: Sequence[Piece]) -> Urdf:
    """One description of all pieces, each fixed to its supporting link.

    Raises:
        UrdfError: a piece cannot be loaded, or two links or joints have the same name.
    """
    root = ET.Element("robot", name=name)
    ET.SubElement(root, "link", name=WORLD)
    loaded = [load_robot(piece.robot) for piece in pieces]
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


#: Shipped descriptions, with plain shapes.
SHIPPED = Path(__file__).with_name("shipped")


def _pybullet_data(relative: str, shipped: str) -> Path:
    """A file of pybullet_data if installed; otherwise the same arm in plain shapes."""
    folder = package_folder("pybullet_data")
    return SHIPPED / shipped if folder is None else folder / relative


def _icub_models(relative: str) -> Path:
    """A file of icub-models: in a share folder."""
    for share in share_folders():
        path = share / "iCub" / relative
        if path.is_file():
            return path
    raise UrdfError(
        "robot needs the iCub models, which are not installed; "
        "install them with: pip install 'control_board_ros[icub]'"
    )


@dataclass(frozen=True, slots=True)
class NamedRobot:
    """A named robot: location of its URDF, and the chain (base link, tip link) to keep.

    ``remark``: where the URDF differs from the real robot; for those who drive one.
    """

    path: Callable[[], Path]
    chain: tuple[str, str] | None = None
    remark: str = ""


_ICUB = partial(_icub_models, "robots/iCubGazeboV2_7/model.urdf")

ROBOTS = {
    "iiwa": NamedRobot(partial(_pybullet_data, "kuka_iiwa/model.urdf", "iiwa.urdf")),
    "panda": NamedRobot(
        partial(_pybullet_data, "franka_panda/panda.urdf", "panda.urdf"),
        remark="the masses of its URDF are not those of a real Panda: gravity compensation, loads "
        "and external torques of one need cbctl identify",
    ),
    "icub": NamedRobot(_ICUB),
    # The rest of the robot has links without inertia.
    "icub_left_arm": NamedRobot(_ICUB, ("chest", "l_hand")),
    "icub_right_arm": NamedRobot(_ICUB, ("chest", "r_hand")),
    "icub_hand_mk3": NamedRobot(partial(_icub_models, "robots/left_hand_mk3/model.urdf")),
    "icub_hand": NamedRobot(lambda: SHIPPED / "icub_left_hand.urdf"),
}

#: Robots assembled from others.
ASSEMBLIES = {
    "panda_pair": (
        Piece("panda", "left_", xyz=(0.0, 0.0, 0.0)),
        Piece("panda", "right_", xyz=(1.2, 0.0, 0.0), rpy=(0.0, 0.0, math.pi)),  # face to face
    ),
    "iiwa_gripper": (
        Piece("iiwa"),
        Piece(str(SHIPPED / "gripper.urdf"), on="lbr_iiwa_link_7", xyz=(0.0, 0.0, 0.045)),
    ),
    "icub_hands": (
        Piece("icub"),
        Piece(str(SHIPPED / "icub_eyes.urdf"), on="head", xyz=(0.0, 0.13, 0.06)),
        Piece(str(SHIPPED / "icub_left_hand.urdf"), on="l_hand", xyz=(0.03, 0.0, 0.02)),
        Piece(str(SHIPPED / "icub_right_hand.urdf"), on="r_hand", xyz=(-0.03, 0.0, 0.02)),
    ),
}
#: Robots whose parameters are those of another one, and more.
EXTENDS = {"icub_hands": "icub"}
NAMES = (*ROBOTS, *ASSEMBLIES)


def load_robot(robot: str, folder: Path | None = None) -> Urdf:
    """The description of a named robot, or of the URDF at a path.

    Args:
        robot: One of NAMES, or a path; that of a xacro file may have arguments after it, as
            in ``arm.urdf.xacro side:=left``.
        folder: Base folder of relative paths besides the working directory (that of the
            configuration file).

    Raises:
        UrdfError: no such robot, or a description that cannot be used; one line.
    """
    if robot in ROBOTS:
        named = ROBOTS[robot]
        return load(named.path(), named.chain)
    if robot in ASSEMBLIES:
        return assemble(robot, ASSEMBLIES[robot])
    name, arguments = split_arguments(robot)
    if looks_like_path(name):
        return load(_find(name, folder), arguments=arguments)
    raise UrdfError(
        unknown_word("robot", robot, NAMES, "known:") + ", or the path of a URDF or xacro file"
    )


def remark_of(robot: str) -> str:
    """Where the URDF of a named robot, or of its pieces, differs from the real one; or empty."""
    names = [piece.robot for piece in ASSEMBLIES.get(robot, ())] or [robot]
    return next((ROBOTS[n].remark for n in names if n in ROBOTS and ROBOTS[n].remark), "")


def located(robot: str, folder: Path | None = None) -> str:
    """The same robot, with a path made absolute."""
    name, arguments = split_arguments(robot)
    if robot in NAMES or not looks_like_path(name):
        return robot
    return " ".join((str(_find(name, folder).absolute()), *arguments))


def _find(name: str, folder: Path | None) -> Path:
    """A path relative to the working directory, or else to ``folder``."""
    path = Path(os.path.expanduser(name))  # unchanged for unknown users
    beside = folder / path if folder is not None else path
    return beside if not path.is_file() and beside.is_file() else path


def looks_like_path(robot: str) -> bool:
    """Whether ``robot`` is a path, not a name."""
    return "/" in robot or robot.lower().endswith((".urdf", ".xml", ".xacro"))

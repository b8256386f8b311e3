# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions: read safely, checked, cut to a chain, prepared for the simulation.

A URDF is untrusted input. It is read with a size cap, without DTD and entities, with meshes from
allowed folders only (see :mod:`.meshes`), and checked completely: pybullet gets only loadable
files, as it reports errors to a terminal or not at all.
"""

from __future__ import annotations

import copy
import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..core.model.coupling import Coupling
from ..core.terms.joint_kind import JointKind
from ..core.terms.measurement import Array
from ..text import first_of
from ..urdf_xml import SIZE_CAP, UrdfError, joint_of, parse_xml
from .geometry import axis_of, origin_of, rotations_about, set_origin
from .meshes import MeshFinder, MeshPathError, mesh_url, not_found
from .urdf_tree import Tree, check_expanded, check_numbers
from .xacro_file import expand, is_xacro


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


__all__ = ["MOVABLE", "CoupledAxes", "Mimic", "Urdf", "UrdfError", "UrdfJoint", "load", "parse"]

MOVABLE = tuple(JointKind)
#: Characters that separate names in parameters, and what stands for them in names of joints.
SEPARATORS = str.maketrans(".,", "__")
FLOATING = "; for a base that floats leave the joint out and set base_fixed to false"


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another one: follower = multiplier · leader + offset, rad or m."""

    follower: str
    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True)
class UrdfJoint:
    """A movable joint of a URDF.

    Attributes: kind (``revolute``, ``continuous`` or ``prismatic``), lower and upper (rad or m;
    infinite for continuous), effort (N·m or N) and velocity (rad/s or m/s; None where it
    gives none above zero), damping (N·m·s/rad or N·s/m) and friction (N·m or N), likewise,
    mimic (None: an independent joint).
    """

    name: str
    kind: JointKind
    child: str
    lower: float
    upper: float
    effort: float | None
    velocity: float | None
    mimic: Mimic | None
    damping: float | None = None
    friction: float | None = None


@dataclass(frozen=True, slots=True)
class CoupledAxes:
    """Axes, as if they were joints of the robot, and what they move (SPEC Y3)."""

    name: str
    coupling: Coupling
    axes: tuple[UrdfJoint, ...]


@dataclass(frozen=True, slots=True)
class Urdf:
    """A checked robot description.

    Attributes: name, source (the file), tree (read-only, modify ``tree.copy()``; mesh paths are
    absolute), joints (all movable ones, from the base outwards), warnings (one line each),
    coupled (axes that move several joints, or parts of their motion; see ``couplings``).
    """

    name: str
    source: str
    tree: Tree = field(repr=False)
    joints: tuple[UrdfJoint, ...]
    warnings: tuple[str, ...] = ()
    coupled: tuple[CoupledAxes, ...] = ()

    @property
    def axes(self) -> tuple[UrdfJoint, ...]:
        """What can be driven: movable joints that neither follow nor are coupled, and axes.

        Axes are where the first of their joints is.
        """
        first = {c.coupling.physical_joints[0]: c.axes for c in self.coupled}
        coupled = {name for c in self.coupled for name in c.coupling.physical_joints}
        driven: list[UrdfJoint] = []
        for joint in self.joints:
            driven += first.get(joint.name, ())
            if joint.mimic is None and joint.name not in coupled:
                driven.append(joint)
        return tuple(driven)

    @property
    def independent(self) -> tuple[str, ...]:
        """Names of what can be driven, see ``axes``."""
        return tuple(joint.name for joint in self.axes)

    @property
    def mimics(self) -> dict[str, Mimic]:
        """The followers' leaders, by the follower's name."""
        return {joint.name: joint.mimic for joint in self.joints if joint.mimic is not None}

    def with_prefix(self, prefix: str) -> Urdf:
        if not prefix:
            return self
        root = copy.deepcopy(self.tree.root)
        for element in root.findall("joint"):
            element.set("name", prefix + element.get("name", ""))
            if (mimic := element.find("mimic")) is not None:
                mimic.set("joint", prefix + mimic.get("joint", ""))
        return of_tree(self.name, Tree(root, self.source), self.warnings)

    @property
    def description(self) -> str:
        """The text for ``robot_description``: mesh paths as URLs, for RViz."""
        root = copy.deepcopy(self.tree.root)
        for mesh in root.iter("mesh"):
            mesh.set("filename", mesh_url(Path(mesh.get("filename", ""))))
        return ET.tostring(root, encoding="unicode")


def load(path: Path, chain: tuple[str, str] | None = None, arguments: Sequence[str] = ()) -> Urdf:
    """Read, check and prepare a URDF file, or a xacro file.

    Args:
        path: The file.
        chain: Base link and tip link; removes links not fixed to the links between them. None
            keeps everything.
        arguments: Of a xacro file, ``name:=value`` each.

    Raises:
        UrdfError: the file cannot be read or used; one line with the next step.
    """
    source = str(path)
    try:
        if path.is_dir():
            raise UrdfError(f"{source}: is a folder; name the URDF file in it")
        if path.exists() and not path.is_file():
            raise UrdfError(f"{source}: is not a regular file; name a URDF file")
        with path.open("rb") as file:
            data = file.read(SIZE_CAP + 1)
        if is_xacro(path):
            data = expand(path, arguments)
        return parse(data, source, path.absolute().parent, chain)
    except (OSError, ValueError) as error:
        if isinstance(error, UrdfError):
            raise
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise UrdfError(f"{source}: cannot be read ({reason}); check robot") from None


def parse(data: bytes, source: str, folder: Path, chain: tuple[str, str] | None = None) -> Urdf:
    """As :func:`load`, from the bytes of a file in ``folder``."""
    root = parse_xml(data, source)
    if root.tag != "robot":
        raise UrdfError(f"{source}: the root is <{root.tag[:40]}>; a URDF's is <robot>")
    check_expanded(data, root, source)
    root.set("name", root.get("name") or Path(source).stem)  # the physics engines require one
    for element in list(root):
        if element.tag not in ("link", "joint", "material"):
            root.remove(element)  # gazebo, transmission, sensor: for other programs
    renamed = _rename_joints(root, source)
    tree = Tree(root, source)
    check_numbers(root, source)
    if chain is not None:
        tree = cut(tree, *chain)
    renamed += _fix_locked(tree)
    joints = tuple(_joint(element, source) for element in tree.moving())
    _check_mimics(joints, source)
    if all(joint.mimic for joint in joints):
        raise UrdfError("; ".join([f"{source}: no joint moves; a board needs one", *renamed]))
    warnings = renamed + _place_meshes(root, source, MeshFinder(folder)) + tree.add_masses()
    return of_tree(root.get("name", ""), tree, warnings)


def _rename_joints(root: ET.Element, source: str) -> list[str]:
    """Replace '.' and ',' in joint names, which separate names in parameters, by '_'."""
    names = [element.get("name", "") for element in root.findall("joint")]
    new = {name: name.translate(SEPARATORS) for name in names}
    changed = [name for name in names if new[name] != name]
    for name in changed:
        if list(new.values()).count(new[name]) > 1:
            raise UrdfError(
                f"{source}: joint {name!r} is {new[name]!r} here, as another joint is; rename one"
            )
    for element in root.findall("joint"):
        element.set("name", new[element.get("name", "")])
        if (mimic := element.find("mimic")) is not None:
            mimic.set("joint", mimic.get("joint", "").translate(SEPARATORS))
    if not changed:
        return []
    count = "joint is" if len(changed) == 1 else f"{len(changed)} joints are"
    return [
        f"{source}: {count} renamed, as {changed[0]!r} to {new[changed[0]]!r}: '.' and ',' "
        "separate names in parameters"
    ]


def _fix_locked(tree: Tree) -> list[str]:
    """Fix the joints whose stops are one position, where they are, as pybullet locks them.

    A <limit> without stops is left: its joint is at 0 by URDF, and moves without limits in
    pybullet.

    Returns:
        A warning that names them; none without any.
    """
    locked: dict[str, float] = {}
    for joint in tree.moving():
        has, limit = joint_of(joint), joint.find("limit")
        written = limit is not None and limit.attrib.keys() >= {"lower", "upper"}
        usable = math.hypot(*has.axis) > LEAST_LIMIT and abs(has.lower) <= MAX_LIMIT
        if has.lower != has.upper or not (written and usable):
            continue
        locked[joint.get("name", "")] = has.lower
        position, rotation = origin_of(joint)
        axis = axis_of(joint)
        if has.slides:
            position = position + rotation @ axis * has.lower
        else:
            rotation = rotation @ rotations_about(axis, np.array([has.lower]))[0]
        set_origin(joint, position, rotation)
        joint.set("type", "fixed")
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    if not locked:
        return []
    names = first_of([f"{name} ({place:g})" for name, place in locked.items()], 4)
    return [
        f"{tree.source}: fixed, as their limits have lower = upper: {names}; give joints "
        "that move <limit lower=… upper=…> with lower < upper"
    ]


def of_tree(name: str, tree: Tree, warnings: Sequence[str] = ()) -> Urdf:
    """The robot of a checked and prepared tree; raises UrdfError for an unusable joint."""
    ET.indent(tree.root)
    joints = tuple(_joint(element, tree.source) for element in tree.moving())
    return Urdf(name, tree.source, tree, joints, tuple(warnings))


#: Magnitude of a joint's limits at most, rad, m, rad/s, m/s, N·m, N; below the least one is zero.
MAX_LIMIT, LEAST_LIMIT = 1e6, 1e-9


def _joint(element: ET.Element, source: str) -> UrdfJoint:
    name, kind = element.get("name", ""), element.get("type", "")
    if kind not in MOVABLE:
        raise UrdfError(
            f"{source}: joint {name!r} is of type {kind[:40]!r}; allowed: fixed, "
            f"{', '.join(MOVABLE)}{FLOATING if kind == 'floating' else ''}"
        )
    has = joint_of(element)
    if not math.hypot(*has.axis) > LEAST_LIMIT:
        raise UrdfError(f"{source}: joint {name!r}: its <axis> is zero; give it a direction")
    unlimited = element.find("limit") is None
    if kind != "continuous" and (unlimited or not has.lower < has.upper):
        range_text = "no <limit>" if unlimited else f"lower {has.lower:g}, upper {has.upper:g}"
        raise UrdfError(
            f"{source}: joint {name!r} has {range_text}; give it <limit lower=… upper=…> with "
            "lower < upper, or make it continuous"
        )
    bounded = () if kind == "continuous" else ("lower", "upper")
    for what in (*bounded, "effort", "velocity"):
        value = getattr(has, what)
        if value is not None and not abs(value) <= MAX_LIMIT:
            raise UrdfError(
                f"{source}: joint {name!r} has <limit {what}={value:g}>; give it a number within "
                f"±{MAX_LIMIT:g}"
            )
    return UrdfJoint(
        name=name,
        kind=JointKind(kind),
        child=has.child,
        lower=has.lower,
        upper=has.upper,
        effort=_known(has.effort),
        velocity=_known(has.velocity),
        mimic=None
        if has.leader is None
        else Mimic(follower=name, leader=has.leader, multiplier=has.multiplier, offset=has.offset),
        damping=_known(has.damping),
        friction=_known(has.friction),
    )


def _known(value: float | None) -> float | None:
    """A positive value; exporters write zero for unknown ones."""
    return value if value is not None and value > LEAST_LIMIT else None


def _check_mimics(joints: tuple[UrdfJoint, ...], source: str) -> None:
    leaders = {joint.name for joint in joints if joint.mimic is None}
    for joint in joints:
        if joint.mimic is not None and joint.mimic.leader not in leaders:
            raise UrdfError(
                f"{source}: joint {joint.name!r} mimics {joint.mimic.leader!r}, which is no "
                "independent joint"
            )


def _place_meshes(root: ET.Element, source: str, finder: MeshFinder) -> list[str]:
    """Make mesh paths absolute; drop shapes with missing meshes, with one warning of all."""
    missing = []
    for link in root.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            try:
                path = finder.find(name)
            except MeshPathError as error:
                raise UrdfError(f"{source}: link {link.get('name')!r}: {error}") from None
            if path is None:
                link.remove(shape)
                missing.append(name)
            else:
                mesh.set("filename", str(path))
    return [f"{source}: {not_found(missing)}"] if missing else []

# SPDX-License-Identifier: Apache-2.0
"""Dynamics of a robot for the board: its URDF as a ``core.dynamics.ArmModel``."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..core.model.arm_model import ArmModel, Link
from ..core.terms.measurement import Array
from .geometry import axis_of, origin_of, rotations_about
from .merge import NOTHING, Inertial, inertial_of
from .urdf import Urdf
from .urdf_tree import Tree

BASE = -1


@dataclass(frozen=True, slots=True, kw_only=True)
class Motors:
    """Motor data of a board's joints, not part of the URDF.

    Attributes: rotors (J N² by joint, kg·m²; kg for sliding joints), coulomb and viscous (friction
    by joint, N·m and N·m·s/rad), moved (inertia of what a coupled axis moves, kg·m² or kg),
    in_links (rotors turn with their whole link, as in pybullet; see ``rotor``; otherwise each acts
    on its own joint only).
    """

    rotors: Mapping[str, float]
    coulomb: Mapping[str, float]
    viscous: Mapping[str, float]
    in_links: bool
    moved: Mapping[str, float] = field(default_factory=dict)


def arm_model(
    urdf: Urdf,
    names: Sequence[str],
    motors: Motors,
    standing: Mapping[str, float],
    gravity: tuple[float, float, float],
) -> ArmModel:
    """The model of some joints of a robot.

    Args:
        urdf: The robot.
        names: The joints, in the board's order.
        motors: Of the same joints.
        standing: Positions of other joints, rad or m; default zero. Followers are placed by their
            leaders. The joints of coupled axes are fixed, too: for the others they are part of
            what they carry, and the axes have an inertia of their own.
        gravity: In world axes, m/s².
    """
    tree = urdf.tree
    places = dict(standing)
    for group in urdf.coupled:
        at = np.array([standing.get(axis, 0.0) for axis in group.coupling.axes])
        where = group.coupling.positions(at).tolist()
        places |= dict(zip(group.coupling.physical_joints, where, strict=True))
    for mimic in urdf.mimics.values():
        places.setdefault(
            mimic.follower, mimic.multiplier * places.get(mimic.leader, 0.0) + mimic.offset
        )
    index = {name: j for j, name in enumerate(names)}
    # Per link: the joint that moves it, and its frame in that joint's axes.
    frames: dict[str, tuple[int, Array, Array]] = {tree.base: (BASE, np.zeros(3), np.eye(3))}
    placed: dict[int, tuple[int, Array, Array]] = {}
    axes: dict[str, Array] = {}
    bodies = dict.fromkeys(range(len(names)), NOTHING)
    for joint in tree.walk(tree.base):
        carrier, position, rotation = frames[tree.parent(joint)]
        offset, turn = origin_of(joint)
        position, rotation = position + rotation @ offset, rotation @ turn
        name, child = joint.get("name", ""), tree.child(joint)
        if name in index:
            axes[name] = aligned = _z_along(axis_of(joint))
            placed[index[name]] = carrier, position, rotation @ aligned
            carrier, position, rotation = index[name], np.zeros(3), aligned.T
        elif joint.get("type") != "fixed":
            position, rotation = _moved(tree, joint, position, rotation, places.get(name, 0.0))
        frames[child] = carrier, position, rotation
        if carrier != BASE and (inertial := inertial_of(tree.links[child])) is not None:
            bodies[carrier] += inertial.moved(position, rotation)
    slides = {joint.name: joint.kind.slides for joint in urdf.axes}
    links = tuple(
        _axis(name, motors, slides=slides[name])
        if j not in placed
        else replace(
            _link(*placed[j], bodies[j], name, motors, slides=tree.slides(tree.joints[name])),
            axes=tuple(axes[name].T.reshape(-1).tolist()),
        )
        for j, name in enumerate(names)
    )
    return ArmModel(links=links, gravity=gravity)


def _axis(name: str, motors: Motors, *, slides: bool) -> Link:
    """A coupled axis: an inertia of its own, without weight."""
    rotor = motors.rotors.get(name, 0.0) + motors.moved.get(name, 0.0)
    alone = replace(motors, rotors={name: rotor}, in_links=False)
    return _link(BASE, np.zeros(3), np.eye(3), NOTHING, name, alone, slides=slides)


def _link(
    carrier: int,
    position: Array,
    rotation: Array,
    body: Inertial,
    name: str,
    motors: Motors,
    *,
    slides: bool,
) -> Link:
    rotor, tensor = motors.rotors.get(name, 0.0), body.about(np.zeros(3))
    if motors.in_links and not slides:
        tensor[2, 2] += rotor
        rotor = 0.0
    return Link(
        parent=carrier,
        slides=slides,
        rotation=tuple(rotation.reshape(-1).tolist()),
        offset=tuple(position.tolist()),
        mass=float(body.mass),
        moment=tuple((body.mass * body.centre).tolist()),
        tensor=tuple(
            float(tensor[i, k]) for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        ),
        rotor=rotor,
        coulomb=motors.coulomb.get(name, 0.0),
        viscous=motors.viscous.get(name, 0.0),
    )


def _moved(
    tree: Tree, joint: ET.Element, position: Array, rotation: Array, place: float
) -> tuple[Array, Array]:
    """The frame beyond a joint at position ``place``."""
    axis = axis_of(joint)
    if tree.slides(joint):
        return position + rotation @ axis * place, rotation
    return position, rotation @ rotations_about(axis, np.array([place]))[0]


def _z_along(axis: Array) -> Array:
    """A rotation whose third column is a unit axis, shape (3, 3)."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])

# SPDX-License-Identifier: Apache-2.0
"""What each joint of a robot moves: inertia and gravity torque over sampled poses.

With the axis a through the point p, and of all links beyond the joint the mass M, the first
moment h = Σ m c and the inertia tensor about the origin I = Σ R I_c Rᵀ + m (c·c E − c cᵀ)::

    M_jj  = aᵀ I a − 2 (h·p) + 2 (a·h)(a·p) + M (p·p − (a·p)²)     kg·m²  (prismatic: M, kg)
    τ_j   = a · ((h − M p) × g)                                     N·m    (prismatic: M a·g, N)

M_jj is the diagonal of the joint-space inertia matrix: what the motor accelerates while the
other joints stand still (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 6: composite
rigid bodies). Beside it, the momentum of the bodies beyond joint k, moving at unit speed about
its axis, gives M_jk at each joint j on the way to the base::

    L = I a_k − h × (a_k × p_k),  P = a_k × (h − M p_k)             M_jk = a_j · (L − p_j × P)

1/(M⁻¹)_jj is what the motor feels while the other joints give way: less, the more they are
coupled. The base is taken as fixed. Joints that follow the joint do not load it, as in the
physics, unless they lie beyond it.

A rotor behind a gear adds J N² at its own joint. The simulation gives it to the child link's
tensor (see ``rotor``): a rotor k adds J N² (a_k · a_i) (a_k · a_j) to M_ij of the joints i and j
from the base up to its own.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..core.measurement import Array
from .rotor import axis_of, inertia_of, numbers_of, rotation_of
from .urdf import Urdf

EARTH = (0.0, 0.0, -9.81)
POSES = 128
#: Sampled travel of a sliding joint whose limits are placeholders, m.
REACH = 10.0

#: Robots of more joints are looked at in every FEWER-th pose where matrices are inverted, and
#: what is added to their diagonals, kg·m²: links may be without mass.
MANY, FEWER, TINY = 32, 8, 1e-9

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Load:
    """What a joint moves without its rotor: least, mean and greatest over the poses.

    Attributes: inertia_min, inertia_mean, inertia_max (kg·m²; kg where it slides), gravity
    (greatest torque, N·m; force, N).
    """

    inertia_min: float
    inertia_mean: float
    inertia_max: float
    gravity: float


@dataclass(frozen=True, slots=True)
class Felt:
    """The inertia that a motor moves, rotors included, kg·m²; kg where the joint slides.

    Attributes: least (over the poses, with the other joints free to give way), middle and
    greatest (with the other joints standing).
    """

    least: float
    mean: float
    greatest: float


@dataclass(frozen=True, slots=True)
class Loads:
    """The loads of the joints that move, n of them, in P poses.

    Attributes: names, sliding (flags, shape (n,)), matrix (M, shape (P, n, n)), gravity (τ_j,
    shape (n, P)), axes (world axes of the joints, shape (n, P, 3)), inside (the joint on whose
    child side a joint hangs next, −1: none, shape (n,); from the base outwards).
    """

    names: tuple[str, ...]
    sliding: Array
    matrix: Array
    gravity: Array
    axes: Array
    inside: tuple[int, ...]

    @property
    def inertia(self) -> Array:
        """M_jj, shape (n, P)."""
        return np.array(np.einsum("pnn->np", self.matrix))

    @property
    def by_name(self) -> dict[str, Load]:
        """The load of each joint."""
        return {
            name: Load(float(row.min()), float(row.mean()), float(row.max()), float(pull))
            for name, row, pull in zip(
                self.names, self.inertia, np.abs(self.gravity).max(axis=1), strict=True
            )
        }

    def chain(self, k: int) -> list[int]:
        """A joint and those between it and the base."""
        found = [k]
        while self.inside[found[-1]] >= 0:
            found.append(self.inside[found[-1]])
        return found

    def with_rotors(self, reflected: Mapping[str, float]) -> dict[str, Felt]:
        """The inertia that each motor moves, rotors included.

        Args:
            reflected: J N² by joint name, kg·m² (kg where it slides); missing ones have none.
        """
        matrix = self.matrix.copy()
        for k, name in enumerate(self.names):
            own = reflected.get(name, 0.0)
            if self.sliding[k]:
                matrix[:, k, k] += own
            elif own:
                chain = self.chain(k)
                along = np.einsum("cpi,pi->pc", self.axes[chain], self.axes[k])
                along *= 1.0 - self.sliding[chain]
                matrix[np.ix_(range(len(matrix)), chain, chain)] += own * (
                    along[:, :, None] * along[:, None, :]
                )
        whole = np.einsum("pnn->np", matrix)
        few = matrix if len(self.names) <= MANY else matrix[::FEWER]
        inverse = np.linalg.inv(few + TINY * np.eye(len(self.names)))
        least = (1.0 / np.einsum("pnn->np", inverse)).min(axis=1)
        return {
            name: Felt(float(gives), 0.5 * float(stands.min() + stands.max()), float(stands.max()))
            for name, gives, stands in zip(self.names, least, whole, strict=True)
        }


def loads(
    urdf: Urdf,
    limits: Mapping[str, Range] | None = None,
    gravity: tuple[float, float, float] = EARTH,
) -> Loads:
    """The loads of the joints of a robot.

    Args:
        urdf: The robot.
        limits: Lower and upper limit of each joint of the board, rad or m; the others stand at
            zero. None: all independent joints, within the URDF's limits.
        gravity: In world axes, m/s².
    """
    if limits is None:
        limits = {
            joint.name: (_or(joint.lower, -math.pi), _or(joint.upper, math.pi))
            for joint in urdf.joints
            if joint.mimic is None
        }
    return _Sampler(urdf, limits, gravity).loads()


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


class _Sampler:
    """Forward kinematics of P poses at a time, then composite bodies from the tips inwards."""

    def __init__(
        self, urdf: Urdf, limits: Mapping[str, Range], gravity: tuple[float, float, float]
    ) -> None:
        root = ET.fromstring(urdf.text)
        self._links = {link.get("name", ""): link for link in root.findall("link")}
        self._moving = {joint.name: joint for joint in urdf.joints}
        self._below: dict[str, list[ET.Element]] = {name: [] for name in self._links}
        children = set()
        for joint in root.findall("joint"):
            self._below[_end(joint, "parent")].append(joint)
            children.add(_end(joint, "child"))
        self._base = next(name for name in self._links if name not in children)
        self._gravity = np.array(gravity)
        self._names = tuple(name for name in limits if name in self._moving)
        self._positions = poses(urdf, limits)
        self._inside: dict[str, str] = {}
        self._axes: dict[str, Array] = {}
        self._points: dict[str, Array] = {}
        self._bodies: dict[str, tuple[float, Array, Array]] = {}

    def loads(self) -> Loads:
        """Walk the tree once outwards, once inwards."""
        order = self._outwards()
        names = tuple(joint for joint, _, _ in order if joint in self._names)
        pulls: dict[str, Array] = {}
        matrix = np.zeros((POSES, len(names), len(names)))
        for joint, parent, child in reversed(order):
            if joint in self._axes:
                pulls[joint] = self._pull(joint, child)
                self._couple(matrix, names, joint, child)
            mass, first, tensor = self._bodies.pop(child)
            total, moment, inertia = self._bodies[parent]
            self._bodies[parent] = total + mass, moment + first, inertia + tensor
        return Loads(
            names,
            np.array([float(self._moving[name].kind == "prismatic") for name in names]),
            matrix,
            np.array([pulls[name] for name in names]),
            np.array([self._axes[name] for name in names]),
            tuple(names.index(self._inside[name]) if self._inside[name] else -1 for name in names),
        )

    def _outwards(self) -> list[tuple[str, str, str]]:
        """Place every link: (joint, parent, child) from the base outwards."""
        order = []
        start = np.zeros((POSES, 3)), np.broadcast_to(np.eye(3), (POSES, 3, 3))
        self._bodies[self._base] = self._body(self._links[self._base], *start)
        stack = [(self._base, "", *start)]
        while stack:
            link, inside, position, rotation = stack.pop()
            for joint in self._below[link]:
                name, child = joint.get("name", ""), _end(joint, "child")
                order.append((name, link, child))
                placed = self._place(joint, name, inside, position, rotation)
                self._bodies[child] = self._body(self._links[child], *placed)
                stack.append((child, name if name in self._names else inside, *placed))
        depth = {self._base: 0}
        for _, parent, child in order:
            depth[child] = depth[parent] + 1
        return sorted(order, key=lambda row: depth[row[2]])

    def _place(
        self, joint: ET.Element, name: str, inside: str, position: Array, rotation: Array
    ) -> tuple[Array, Array]:
        """Origin, shape (P, 3), and axes, shape (P, 3, 3), of the link behind a joint."""
        origin = joint.find("origin")
        position = position + rotation @ numbers_of(origin, "xyz", (0.0, 0.0, 0.0))
        rotation = rotation @ rotation_of(numbers_of(origin, "rpy", (0.0, 0.0, 0.0)))
        if name not in self._positions:
            return position, rotation
        local, travel = axis_of(joint), self._positions[name]
        axis = rotation @ local
        if name in self._names:
            self._axes[name], self._points[name], self._inside[name] = axis, position, inside
        if self._moving[name].kind == "prismatic":
            return position + axis * travel[:, None], rotation
        return position, rotation @ turn(local, travel)

    @staticmethod
    def _body(link: ET.Element, position: Array, rotation: Array) -> tuple[float, Array, Array]:
        """Mass, first moment, shape (P, 3), and tensor about the origin, shape (P, 3, 3)."""
        inertial = link.find("inertial")
        if inertial is None:
            return 0.0, np.zeros((POSES, 3)), np.zeros((POSES, 3, 3))
        mass = float(numbers_of(inertial.find("mass"), "value", (0.0,))[0])
        offset = numbers_of(inertial.find("origin"), "xyz", (0.0, 0.0, 0.0))
        centre = position + rotation @ offset
        tensor = rotation @ inertia_of(link) @ rotation.transpose(0, 2, 1)
        square = np.einsum("pi,pi->p", centre, centre)[:, None, None] * np.eye(3)
        tensor += mass * (square - centre[:, :, None] * centre[:, None, :])
        return mass, mass * centre, tensor

    def _pull(self, name: str, child: str) -> Array:
        """Gravity torque of a joint, shape (P,)."""
        axis, point = self._axes[name], self._points[name]
        mass, first, _ = self._bodies[child]
        if self._moving[name].kind == "prismatic":
            return np.array(mass * (axis @ self._gravity))
        return _dot(axis, np.cross(first - mass * point, self._gravity))

    def _couple(self, matrix: Array, names: tuple[str, ...], name: str, child: str) -> None:
        """Fill a joint's column, from itself to the base, and its row."""
        axis, point = self._axes[name], self._points[name]
        mass, first, tensor = self._bodies[child]
        if self._moving[name].kind == "prismatic":
            linear, angular = mass * axis, np.cross(first, axis)
        else:
            linear = np.cross(axis, first - mass * point)
            angular = np.einsum("pij,pj->pi", tensor, axis)
            angular -= np.cross(first, np.cross(axis, point))
        k, nearer = names.index(name), name
        while nearer:
            j, towards = names.index(nearer), self._axes[nearer]
            if self._moving[nearer].kind == "prismatic":
                moment = _dot(towards, linear)
            else:
                moment = _dot(towards, angular - np.cross(self._points[nearer], linear))
            matrix[:, j, k] = matrix[:, k, j] = np.maximum(moment, 0.0) if j == k else moment
            nearer = self._inside[nearer]


def turn(axis: Array, angles: Array) -> Array:
    """Rotations about a unit axis by angles, rad, shape (P, 3, 3): Rodrigues' formula.

    R = E + sin θ K + (1 − cos θ) K², K being the cross product with the axis.
    """
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, rest = np.sin(angles)[:, None, None], 1.0 - np.cos(angles)[:, None, None]
    return np.array(np.eye(3) + sine * cross + rest * (cross @ cross))


def _dot(a: Array, b: Array) -> Array:
    return np.array(np.einsum("pi,pi->p", a, b))


def _end(joint: ET.Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def poses(urdf: Urdf, limits: Mapping[str, Range]) -> dict[str, Array]:
    """Positions of the joints that move, followers too, shape (P,) each: always the same ones.

    The first pose has every joint as near to zero as it may be. Half of the others are uniform
    within the limits; in the other half each joint is at one of its limits or next to zero,
    where arms are stretched out.
    """
    random = np.random.default_rng(1)
    found = {}
    for joint in urdf.joints:
        if joint.name not in limits:
            continue
        low, high = sorted(limits[joint.name])  # wrong ones are refused later, with their place
        if joint.kind == "prismatic":
            low, high = max(low, min(-REACH, high)), min(high, max(REACH, low))
        elif high - low > 2.0 * math.pi:
            low, high = max(low, -math.pi), min(high, math.pi)
        rest = min(max(0.0, low), high)
        half = POSES // 2
        edges = np.array([low, high, rest, rest])[random.integers(0, 4, POSES - half)]
        travel = np.concatenate([random.uniform(low, high, half), edges])
        travel[0] = rest
        found[joint.name] = travel
    for name, mimic in urdf.mimics.items():
        if mimic.joint in found:
            found[name] = mimic.multiplier * found[mimic.joint] + mimic.offset
    return found

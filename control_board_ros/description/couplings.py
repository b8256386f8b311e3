# SPDX-License-Identifier: Apache-2.0
"""Axes that move several joints of a robot, or that joints share (SPEC Y3): see ``couple``."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from ..core.model.coupling import Coupling, side_by_side
from ..core.terms.joint_kind import JointKind
from ..text import nearest
from .urdf import CoupledAxes, Urdf, UrdfJoint

Range = tuple[float, float]
#: Part of its range by which a joint may be moved beyond its limit by rounding.
ROUNDING = 1e-6


def couple(urdf: Urdf, name: str, coupling: Coupling) -> Urdf:
    """The robot with axes in place of the joints that they move.

    Args:
        urdf: the robot.
        name: of the coupling.
        coupling: with joints that nothing else drives.

    Raises:
        ValueError: a joint or an axis that cannot be coupled; what would be allowed.
    """
    free = {joint.name: joint for joint in urdf.joints if joint.mimic is None}
    owner = {
        joint: group.name for group in urdf.coupled for joint in group.coupling.physical_joints
    }
    for joint in coupling.physical_joints:
        if joint in owner:
            raise ValueError(f"{joint} in one coupling; {owner[joint]} has it")
        if joint in urdf.mimics:
            raise ValueError(
                f"joints that drive themselves; {joint} follows {urdf.mimics[joint].leader}"
            )
        if joint not in free:
            hint = nearest(joint, free)
            raise ValueError(
                f"joints of the robot, not {joint!r}{hint}; they are: {', '.join(free)}"
            )
        if coupling.physical_joints.count(joint) > 1:
            raise ValueError(f"{joint} once")
    taken = set(urdf.independent) - set(coupling.physical_joints)
    for axis in coupling.axes:
        if axis in taken or coupling.axes.count(axis) > 1:
            raise ValueError(f"another name for the axis {axis}; it is in use")
    axes = tuple(_axis(k, coupling, free) for k in range(len(coupling.axes)))
    return replace(urdf, coupled=(*urdf.coupled, CoupledAxes(name, coupling, axes)))


def _axis(k: int, coupling: Coupling, joints: Mapping[str, UrdfJoint]) -> UrdfJoint:
    """An axis as a joint: as far and as fast as the joints that it moves alone allow."""
    matrix = coupling.matrix
    moved = [i for i in range(len(matrix)) if matrix[i, k] != 0.0]
    driven = [joints[coupling.physical_joints[i]] for i in moved]
    alone = [i for i in moved if np.count_nonzero(matrix[i]) == 1 and i not in coupling.curved]
    low, high = -np.inf, np.inf
    for i in alone:
        joint = joints[coupling.physical_joints[i]]
        ends = (np.array([joint.lower, joint.upper]) - coupling.offset[i]) / matrix[i, k]
        low, high = max(low, float(ends.min())), min(high, float(ends.max()))
    shares = np.abs(matrix[moved, k]).tolist()
    speeds = [
        j.velocity / c for j, c in zip(driven, shares, strict=True) if j.velocity is not None
    ]
    damping = sum(c * c * (j.damping or 0.0) for j, c in zip(driven, shares, strict=True))
    friction = sum(c * (j.friction or 0.0) for j, c in zip(driven, shares, strict=True))
    bounded = np.isfinite(low)
    turning = JointKind.REVOLUTE if bounded else JointKind.CONTINUOUS
    return UrdfJoint(
        name=coupling.axes[k],
        kind=JointKind.PRISMATIC if driven[0].kind.slides else turning,
        child=driven[0].child,
        lower=low,
        upper=high,
        effort=None,
        velocity=min(speeds, default=None),
        mimic=None,
        damping=damping or None,
        friction=friction or None,
    )


def coupling_of(urdf: Urdf, names: Collection[str], *, followers: bool = True) -> Coupling | None:
    """The coupling of a board's joints with the physical ones; None: they are those.

    Args:
        urdf: the robot.
        names: of the joints, in the board's order.
        followers: with those that mimic others in the URDF.

    Raises:
        ValueError: some of a coupling's axes are missing; what would be allowed.
    """
    kept = [entry for entry in urdf.coupled if set(entry.coupling.axes) & set(names)]
    for entry in kept:
        if missing := [axis for axis in entry.coupling.axes if axis not in names]:
            raise ValueError(
                f"all axes of the coupling {entry.name}, or none; {', '.join(missing)} is missing"
            )
    coupled = {axis for entry in kept for axis in entry.coupling.axes}
    rest = [name for name in names if name not in coupled]
    plain = [Coupling.plain(rest)] if rest else []
    whole = side_by_side([*plain, *(entry.coupling for entry in kept)])
    following = [
        mimic
        for mimic in urdf.mimics.values()
        if followers and mimic.follower not in names and mimic.leader in whole.physical_joints
    ]
    if not kept and not following:
        return None
    order = [whole.axes.index(name) for name in names]
    rows = [tuple(row[k] for k in order) for row in whole.rows]
    leads = [whole.physical_joints.index(mimic.leader) for mimic in following]
    sizes = [mimic.multiplier for mimic in following]
    return Coupling(
        tuple(names),
        (*whole.physical_joints, *(mimic.follower for mimic in following)),
        (*rows, *(tuple(c * v for v in rows[i]) for i, c in zip(leads, sizes, strict=True))),
        (
            *whole.offset.tolist(),
            *(
                mimic.multiplier * float(whole.offset[i]) + mimic.offset
                for mimic, i in zip(following, leads, strict=True)
            ),
        ),
        (*whole.functions, *(None for _ in following)) if whole.functions else (),
    )


def rotors_at_joints(urdf: Urdf, reflected: Mapping[str, float]) -> dict[str, float]:
    """Inertia of rotors at the joints of couplings: R/Σc² at each of the joints c q of an axis.

    Spread like this, no joint is much lighter than one that it follows. Where axes share joints,
    the leading ones have it, without what couples the rotors.

    Args:
        urdf: the robot.
        reflected: J N² by axis, kg·m² (kg where it slides).
    """
    rotors = dict(reflected)
    for coupled in urdf.coupled:
        coupling = coupled.coupling
        if not set(coupling.axes) <= reflected.keys():
            continue
        axis_rotors = np.array([rotors.pop(axis) for axis in coupling.axes])
        plain = [i for i in range(len(coupling.rows)) if i not in coupling.curved]
        squares = coupling.matrix[plain] ** 2
        if np.all(np.count_nonzero(squares, axis=1) == 1):
            inertias = (squares > 0.0) @ (axis_rotors / squares.sum(axis=0))
        else:
            plain, inertias = list(coupling.leads), (coupling.lead_inverse.T**2) @ axis_rotors
        for i, inertia in zip(plain, inertias.tolist(), strict=True):
            rotors[coupling.physical_joints[i]] = inertia
    return rotors


def beyond_limits(urdf: Urdf, ranges: Mapping[str, Range]) -> tuple[str, str] | None:
    """The first axis that could move a physical joint beyond its limits, and what is allowed.

    Args:
        urdf: the robot.
        ranges: of the axes, rad or m.
    """
    limits = {joint.name: (joint.lower, joint.upper) for joint in urdf.joints}
    for coupled in urdf.coupled:
        coupling = coupled.coupling
        if not set(coupling.axes) <= ranges.keys():
            continue
        ends = np.array([ranges[axis] for axis in coupling.axes])
        sides = coupling.matrix[:, :, None] * ends
        reach = np.column_stack([sides.min(axis=2).sum(axis=1), sides.max(axis=2).sum(axis=1)])
        reach += coupling.offset[:, None]
        for i, joint in enumerate(coupling.physical_joints):
            low, high = limits[joint]
            if np.isinf(high - low):
                continue
            way = np.linspace(reach[i, 0], reach[i, 1], 33)
            if i in coupling.curved:
                way = coupling.curved[i].value(way)
            slack = ROUNDING * (high - low)
            if np.all((low - slack <= way) & (way <= high + slack)):
                continue
            axis = coupling.axes[int(np.argmax(np.abs(coupling.matrix[i])))]
            if np.isnan(way).any():
                return axis, f"a range in which the links of {joint} reach each other"
            return axis, (
                f"a range that keeps {joint} within {low:.4g}…{high:.4g}; with it, it goes from "
                f"{way.min():.4g} to {way.max():.4g}"
            )
    return None

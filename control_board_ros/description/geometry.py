# SPDX-License-Identifier: Apache-2.0
"""Geometry of URDF elements: numbers, origins, axes, inertia tensors and rotations.

The elements were checked before (see ``urdf_tree``): valid numbers, nonzero axes.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from ..core.terms.measurement import Array

ZEROS = (0.0, 0.0, 0.0)


def numbers_of(element: ET.Element | None, key: str, default: tuple[float, ...] = ZEROS) -> Array:
    """The numbers of an attribute, of any count; the default if missing."""
    text = None if element is None else element.get(key)
    return np.array(default if text is None else [float(word) for word in text.split()])


def as_text(numbers: Array) -> str:
    """Numbers as an attribute's value, exact."""
    return " ".join(map(repr, numbers.tolist()))


def origin_of(element: ET.Element) -> tuple[Array, Array]:
    """Position, shape (3,), m, and rotation, shape (3, 3), of the <origin> of an element."""
    origin = element.find("origin")
    return numbers_of(origin, "xyz"), rotation_of_rpy(numbers_of(origin, "rpy"))


def set_origin(element: ET.Element, position: Array, rotation: Array) -> None:
    origin = element.find("origin")
    if origin is None:
        origin = ET.SubElement(element, "origin")
    origin.set("xyz", as_text(position))
    origin.set("rpy", as_text(rpy_of_rotation(rotation)))


def axis_of(joint: ET.Element) -> Array:
    """The unit axis of a joint in its own frame, shape (3,)."""
    axis = numbers_of(joint.find("axis"), "xyz", (1.0, 0.0, 0.0))
    return np.array(axis / float(np.linalg.norm(axis)))


def inertia_of(link: ET.Element) -> Array:
    """Inertia tensor about the centre of mass in the link's axes, shape (3, 3), kg·m²."""
    element = link.find("inertial/inertia")
    if element is None:
        return np.zeros((3, 3))
    xx, xy, xz, yy, yz, zz = (
        float(element.get(name, "0")) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    rotation = rotation_of_rpy(numbers_of(link.find("inertial/origin"), "rpy"))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.array(rotation @ tensor @ rotation.T)


def principal_axes(tensor: Array) -> tuple[Array, Array]:
    """Principal moments, shape (3,), and right-handed axes, the columns of shape (3, 3)."""
    moments, axes = np.linalg.eigh(tensor)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return moments, axes


def rotation_of_rpy(angles: Array) -> Array:
    """Rotation matrix, shape (3, 3), of roll, pitch and yaw about fixed axes, rad."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_of_rotation(rotation: Array) -> Array:
    """Roll, pitch and yaw, shape (3,), rad, of a rotation matrix: inverse of rotation_of_rpy."""
    across = np.hypot(rotation[0, 0], rotation[1, 0])
    pitch = np.arctan2(-rotation[2, 0], across)
    if across < 1e-9:  # pitch at a right angle: roll and yaw turn about the same axis
        return np.array([np.arctan2(-rotation[1, 2], rotation[1, 1]), pitch, 0.0])
    roll = np.arctan2(rotation[2, 1], rotation[2, 2])
    return np.array([roll, pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])


def rotations_about(axis: Array, angles: Array) -> Array:
    """Rotations about a unit axis by P angles, rad, shape (P, 3, 3): Rodrigues' formula.

    R = E + sin θ K + (1 − cos θ) K², K being the cross product with the axis.
    """
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, rest = np.sin(angles)[:, None, None], 1.0 - np.cos(angles)[:, None, None]
    return np.array(np.eye(3) + sine * cross + rest * (cross @ cross))

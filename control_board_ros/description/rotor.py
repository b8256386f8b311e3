# SPDX-License-Identifier: Apache-2.0
"""Rotor inertia in a robot description.

A rotor of inertia J behind a gear of ratio N weighs J N² at its joint. The physics integrates
it with the rest when it is part of the child link's inertia tensor about the joint axis a::

    I' = I + J N² a aᵀ

It turns with the whole link then, so joints further in feel it too, as far as their axes are
parallel; a real rotor, at right angles to nothing but its own bearing, adds N times less there.

Such a tensor is not that of a rigid body (one moment may exceed the sum of the others), and
pybullet replaces what it finds impossible by zero. So the description gets the principal axes
of I' with a harmless moment on them, and the true moments are set in the physics afterwards.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

import numpy as np

from ..core.config import ConfigError
from ..core.measurement import Array

Moments = dict[str, tuple[float, float, float]]
HARMLESS = 1e-3


def with_rotor_inertia(text: str, reflected: Mapping[str, float]) -> tuple[str, Moments]:
    """Give the links behind these joints room for the inertia of their rotors.

    Args:
        text: A robot description (URDF).
        reflected: J N² by joint name, kg·m²; zeros are left out.

    Returns:
        The description with the principal axes of the new inertia tensors, and for each changed
        link its three principal moments, kg·m².

    Raises:
        ConfigError: a prismatic joint has rotor inertia: a mass that resists along the axis
            only cannot be given to a link.
    """
    root = ET.fromstring(text)
    links = {link.get("name"): link for link in root.findall("link")}
    moments: Moments = {}
    for joint in root.findall("joint"):
        inertia = reflected.get(joint.get("name", ""), 0.0)
        if inertia == 0.0:
            continue
        if joint.get("type") == "prismatic":
            raise ConfigError(
                f"{joint.get('name')}.motor.inertia", inertia, "0 for a prismatic joint of a URDF"
            )
        child = joint.find("child")
        name = "" if child is None else child.get("link", "")
        link, axis = links[name], axis_of(joint)
        tensor = inertia_of(link) + inertia * np.outer(axis, axis)
        values, axes = np.linalg.eigh(tensor)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        _write(link, axes)
        moments[name] = (float(values[0]), float(values[1]), float(values[2]))
    ET.indent(root)  # pybullet cannot read long lines
    return ET.tostring(root, encoding="unicode"), moments


def normalise_axis(joint: ET.Element) -> None:
    """Make the axis of a joint one long: pybullet takes its length for a lever."""
    element = joint.find("axis")
    if element is not None and joint.get("type") != "fixed":
        element.set("xyz", " ".join(repr(float(part)) for part in axis_of(joint)))


def axis_of(joint: ET.Element) -> Array:
    """The unit axis of a joint in its own frame, shape (3,)."""
    element = joint.find("axis")
    axis = numbers_of(element, "xyz", (1.0, 0.0, 0.0))
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise ConfigError(f"{joint.get('name')}.axis", "0 0 0", "one that is not zero")
    return np.array(axis / length)


def inertia_of(link: ET.Element) -> Array:
    """Inertia tensor about the centre of mass in the link's axes, shape (3, 3), kg·m²."""
    element = link.find("inertial/inertia")
    if element is None:
        return np.zeros((3, 3))
    xx, xy, xz, yy, yz, zz = (
        float(element.get(name, "0")) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    rotation = rotation_of(numbers_of(link.find("inertial/origin"), "rpy", (0.0, 0.0, 0.0)))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.array(rotation @ tensor @ rotation.T)


def _write(link: ET.Element, axes: Array) -> None:
    """Turn the inertial frame of a link to these axes, with a harmless moment on each."""
    inertial = link.find("inertial")
    if inertial is None:
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "mass", value="1e-4")
    origin = inertial.find("origin")
    if origin is None:
        origin = ET.SubElement(inertial, "origin", xyz="0 0 0")
    origin.set("rpy", " ".join(repr(float(angle)) for angle in angles_of(axes)))
    tensor = inertial.find("inertia")
    if tensor is None:
        tensor = ET.SubElement(inertial, "inertia")
    for name in ("ixx", "iyy", "izz"):
        tensor.set(name, repr(HARMLESS))
    for name in ("ixy", "ixz", "iyz"):
        tensor.set(name, "0")


def numbers_of(element: ET.Element | None, key: str, default: tuple[float, ...]) -> Array:
    """The numbers of an attribute, as many as it has; the default where it is missing."""
    text = None if element is None else element.get(key)
    return np.array(default if text is None else [float(word) for word in text.split()])


def rotation_of(angles: Array) -> Array:
    """Rotation matrix, shape (3, 3), of roll, pitch and yaw about fixed axes, rad."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def angles_of(rotation: Array) -> Array:
    """Roll, pitch and yaw, shape (3,), rad, of a rotation matrix; inverse of rotation_of."""
    across = np.hypot(rotation[0, 0], rotation[1, 0])
    pitch = np.arctan2(-rotation[2, 0], across)
    if across < 1e-9:  # pitch at a right angle: roll and yaw turn about the same axis
        return np.array([np.arctan2(-rotation[1, 2], rotation[1, 1]), pitch, 0.0])
    roll = np.arctan2(rotation[2, 1], rotation[2, 2])
    return np.array([roll, pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])

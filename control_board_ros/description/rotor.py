# SPDX-License-Identifier: Apache-2.0
"""Rotor inertia in a robot description, for pybullet.

A rotor of inertia J behind a gear of ratio N adds J N² at its joint. The physics integrates
it with the rest when it is part of the child link's inertia tensor about the joint axis a::

    I' = I + J N² a aᵀ

It then turns with the whole link, so inner joints feel it as far as their axes are parallel; a
real rotor adds N times less there.

Such a tensor is not that of a rigid body (one moment may exceed the sum of the others), and
pybullet replaces invalid ones by zero. So the description gets the principal axes of I' with
valid moments, and the true moments are set in the physics afterwards.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

import numpy as np

from ..core.config.config import ConfigError
from ..core.terms.measurement import Array
from .geometry import as_text, axis_of, inertia_of, principal_axes, rpy_of_rotation
from .urdf_tree import Tree

Moments = dict[str, tuple[float, float, float]]
HARMLESS = 1e-3


def add_rotor_inertia(tree: Tree, reflected: Mapping[str, float]) -> Moments:
    """Prepare the child links of these joints for the inertia of their rotors.

    Args:
        tree: The robot; its links get the principal axes of the new inertia tensors.
        reflected: J N² by joint name, kg·m²; zeros are ignored.

    Returns:
        For each changed link its three principal moments, kg·m².

    Raises:
        ConfigError: a prismatic joint has rotor inertia, which acts along its axis only and
            cannot be part of a link.
    """
    moments: Moments = {}
    for name, inertia in reflected.items():
        if inertia == 0.0:
            continue
        joint = tree.joints[name]
        if tree.slides(joint):
            raise ConfigError(
                f"{name}.motor.inertia", inertia, "0 for a prismatic joint of a URDF"
            )
        link, axis = tree.links[tree.child(joint)], axis_of(joint)
        values, axes = principal_axes(inertia_of(link) + inertia * np.outer(axis, axis))
        _set_principal_axes(link, axes)
        moments[tree.child(joint)] = (float(values[0]), float(values[1]), float(values[2]))
    return moments


def _set_principal_axes(link: ET.Element, axes: Array) -> None:
    """Set the inertial frame of a link to these axes, with a valid moment on each."""
    inertial = link.find("inertial")
    if inertial is None:
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "mass", value="1e-4")
    origin = inertial.find("origin")
    if origin is None:
        origin = ET.SubElement(inertial, "origin", xyz="0 0 0")
    origin.set("rpy", as_text(rpy_of_rotation(axes)))
    tensor = inertial.find("inertia")
    if tensor is None:
        tensor = ET.SubElement(inertial, "inertia")
    for name in ("ixx", "iyy", "izz"):
        tensor.set(name, repr(HARMLESS))
    for name in ("ixy", "ixz", "iyz"):
        tensor.set(name, "0")

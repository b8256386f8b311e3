# SPDX-License-Identifier: Apache-2.0
"""Links on fixed joints become part of their carriers; what moves weighs the same."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from in_bullet import dynamics
from marks import needs_icub
from plants import described, joint, link, robot, xml_of

from control_board_ros.description.merge import inertial_of, merge_fixed
from control_board_ros.description.robots import load_robot
from control_board_ros.settings.loading import load

#: A hand of 3 kg on an arm of 1 kg, 1 m away and turned by a quarter about x, with a finger.
HAND = robot(
    link("arm", 1.0, "0 0 0", "0.1 0.2 0.3 0 0 0"),
    link("hand", 3.0, "0 0 0", "0.4 0.5 0.6 0 0 0"),
    link("finger", 0.1, "0 0 0", "1e-3 1e-3 1e-3 0 0 0"),
    joint("elbow", "base", "arm"),
    joint(
        "wrist",
        "arm",
        "hand",
        kind="fixed",
        rest='<origin xyz="1 0 0" rpy="1.5707963267948966 0 0"/>',
    ),
    joint("knuckle", "hand", "finger", rest='<origin xyz="0 0 0.5"/>'),
).replace(
    '<link name="hand">',
    '<link name="hand"><visual><origin xyz="0 1 0"/><geometry><sphere radius="1"/></geometry>'
    "</visual>",
)


def numbers(element: ET.Element | None, key: str) -> list[float]:
    assert element is not None
    return [float(word) for word in element.get(key, "").split()]


def test_masses_shapes_and_joints_move_to_the_carrier() -> None:
    tree = merge_fixed(described(HAND).tree.copy())
    assert set(tree.links) == {"base", "arm", "finger"}
    arm = inertial_of(tree.links["arm"])
    assert arm is not None
    assert arm.mass == 4.0
    assert arm.centre == pytest.approx([0.75, 0.0, 0.0])
    # y and z of the hand change places; Steiner: 1 · 0.75² + 3 · 0.25² = 0.75 kg·m².
    expected = np.diag([0.1 + 0.4, 0.2 + 0.6 + 0.75, 0.3 + 0.5 + 0.75])
    np.testing.assert_allclose(arm.tensor, expected, atol=1e-12)
    shape = tree.links["arm"].find("visual/origin")
    assert numbers(shape, "xyz") == pytest.approx([1.0, 0.0, 1.0])
    knuckle = tree.joints["knuckle"]
    assert tree.parent(knuckle) == "arm"
    assert numbers(knuckle.find("origin"), "xyz") == pytest.approx([1.0, -0.5, 0.0])
    assert numbers(knuckle.find("origin"), "rpy") == pytest.approx([np.pi / 2, 0.0, 0.0])


def test_a_robot_without_fixed_joints_stays_as_it_is() -> None:
    urdf = load_robot("iiwa")
    merged = merge_fixed(urdf.tree.copy())
    assert ET.tostring(merged.root) == ET.tostring(urdf.tree.root)


def physics(text: str, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """M and gravity torques by pybullet in ten poses, for the joints of these names."""
    poses = np.random.default_rng(5).uniform(-1.0, 1.0, (10, len(names)))
    order, matrices, torques = dynamics(
        text, load("iiwa").simulation, [dict(zip(names, pose, strict=True)) for pose in poses]
    )
    pick = [order.index(name) for name in names]
    return matrices[:, pick][:, :, pick], torques[:, pick]


@pytest.mark.parametrize("name", ["panda", pytest.param("icub_left_arm", marks=needs_icub)])
def test_the_physics_of_a_robot_is_the_same(name: str) -> None:
    urdf = load_robot(name)
    names = tuple(one.name for one in urdf.joints)
    merged = merge_fixed(urdf.tree.copy())
    assert len(merged.links) == len(names) + 1
    ET.indent(merged.root)
    text = ET.tostring(merged.root, encoding="unicode")
    for ours, theirs in zip(physics(text, names), physics(xml_of(urdf), names), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9)

# SPDX-License-Identifier: Apache-2.0
"""Frames of links, against pybullet's own kinematics."""

from __future__ import annotations

import numpy as np
import pytest
from in_bullet import in_bullet
from plants import described, xml_of

from control_board_ros.description.geometry import rotation_of_rpy, rotations_about
from control_board_ros.description.robots import load_robot
from control_board_ros.description.urdf import Urdf
from control_board_ros.frames import Frames, quaternions_of_rpy
from control_board_ros.node.wiring.transforms import frames_of
from control_board_ros.settings.loading import load
from control_board_ros.sim.bodies.world import bullet

#: Turns, slides and follows, about slanted axes at slanted origins, with a fixed frame between.
SLANTED = """
<robot name="slanted">
  <link name="base"/><link name="arm"/><link name="plate"/><link name="slide"/>
  <link name="finger"/><link name="thumb"/>
  <joint name="shoulder" type="continuous">
    <parent link="base"/><child link="arm"/>
    <origin xyz="0.1 -0.2 0.3" rpy="0.3 -1.2 2.5"/><axis xyz="0.36 0.48 -0.8"/>
  </joint>
  <joint name="mount" type="fixed">
    <parent link="arm"/><child link="plate"/>
    <origin xyz="0 0.5 0" rpy="-3 0.4 0.7"/>
  </joint>
  <joint name="rail" type="prismatic">
    <parent link="plate"/><child link="slide"/>
    <origin xyz="0.2 0 0" rpy="0.5 0.6 0.7"/><axis xyz="0 0.6 0.8"/>
    <limit lower="-1" upper="1" effort="10" velocity="1"/>
  </joint>
  <joint name="claw" type="revolute">
    <parent link="slide"/><child link="finger"/>
    <origin xyz="0 0 0.1" rpy="0 0 3"/><axis xyz="0 -1 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="1"/>
    <mimic joint="rail" multiplier="-3" offset="0.25"/>
  </joint>
  <joint name="spare" type="revolute">
    <parent link="slide"/><child link="thumb"/>
    <origin xyz="0 0.1 0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="10" velocity="1"/>
  </joint>
</robot>
"""


def in_the_world(urdf: Urdf, frames: Frames, q: np.ndarray) -> dict[str, tuple]:
    """Position and rotation of each link, edge by edge, as tf2 makes them."""
    edges = [*zip(frames.moving, frames.poses(q), strict=True)]
    edges += zip(frames.standing, frames.standing_poses, strict=True)
    found = {urdf.tree.base: (np.zeros(3), np.eye(3))}
    by_child = {edge.child: (edge.parent, pose) for edge, pose in edges}
    for element in urdf.tree.walk(urdf.tree.base):
        child = urdf.tree.child(element)
        parent, pose = by_child[child]
        position, rotation = found[parent]
        found[child] = position + rotation @ pose[:3], rotation @ matrix(pose[3:])
    return found


def matrix(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix of a unit quaternion x, y, z, w, by pybullet."""
    return np.array(bullet.getMatrixFromQuaternion(quaternion.tolist())).reshape(3, 3)


@pytest.mark.parametrize("name", ["iiwa", "panda", "slanted"])
def test_frames_are_those_of_pybullet(name: str) -> None:
    """Every link, in ten random poses, to 0.01 mm and 0.01 mrad: pybullet has single precision."""
    urdf = described(SLANTED) if name == "slanted" else load_robot(name)
    names = tuple(one for one in urdf.independent if one != "spare")
    frames, random = frames_of(urdf, names), np.random.default_rng(5)
    with in_bullet(xml_of(urdf), load(None).simulation) as (client, body, info):
        for q in random.uniform(-3.0, 3.0, (10, len(names))):
            at = dict(zip(names, q, strict=True))
            for mimic in urdf.mimics.values():
                at[mimic.follower] = mimic.multiplier * at[mimic.leader] + mimic.offset
            for one in info:
                place = at.get(one[1].decode(), 0.0)
                bullet.resetJointState(body, one[0], place, physicsClientId=client)
            links = in_the_world(urdf, frames, q)
            assert len(links) == len(urdf.tree.links)
            for one in info:
                state = bullet.getLinkState(
                    body, one[0], computeForwardKinematics=True, physicsClientId=client
                )
                position, rotation = links[one[12].decode()]
                assert position == pytest.approx(np.array(state[4]), abs=1e-5)
                assert rotation == pytest.approx(matrix(np.array(state[5])), abs=1e-5)


def test_moving_and_fixed_links() -> None:
    """Followers move with their leaders; other joints are fixed; axes have any length."""
    frames = frames_of(described(SLANTED.replace("0 0.6 0.8", "0 3 4")), ["rail", "shoulder"])
    assert [edge.child for edge in frames.moving] == ["arm", "slide", "finger"]
    assert [edge.child for edge in frames.standing] == ["plate", "thumb"]
    assert frames.standing[0].parent == "arm"
    moved = frames.poses(np.array([0.5, 0.0]))[1] - frames.poses(np.zeros(2))[1]
    along = rotation_of_rpy(np.array([0.5, 0.6, 0.7])) @ np.array([0.0, 0.3, 0.4])
    assert moved == pytest.approx(np.concatenate([along, np.zeros(4)]), abs=1e-12)


def test_a_joint_that_follows_and_is_driven_is_its_own() -> None:
    """As in the plant: what the board drives follows none."""
    frames = frames_of(described(SLANTED), ["rail", "claw"])
    pose = frames.poses(np.array([0.7, 0.0]))[1]
    assert pose[3:] == pytest.approx(quaternions_of_rpy(np.array([[0.0, 0.0, 3.0]]))[0], abs=1e-12)


@pytest.mark.parametrize("angles", [(0.3, -1.2, 2.5), (-3.0, 1.5707963, 0.1), (0.0, 0.0, 3.14)])
def test_a_quaternion_is_its_rotation(angles: tuple[float, float, float]) -> None:
    quaternion = quaternions_of_rpy(np.array([angles]))[0]
    assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-15)
    turned = 2.0 * np.arctan2(np.linalg.norm(quaternion[:3]), quaternion[3])
    axis = quaternion[:3] / np.linalg.norm(quaternion[:3])
    made = rotations_about(axis, np.array([turned]))[0]
    assert made == pytest.approx(rotation_of_rpy(np.array(angles)), abs=1e-12)

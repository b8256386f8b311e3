# SPDX-License-Identifier: Apache-2.0
"""Serial chains of any length, as URDF: they hang, and their joints turn about x and y in turn."""

from __future__ import annotations

LENGTH, MASS = 0.05, 0.05  # m and kg of each link
MOMENT = MASS * LENGTH**2 / 3.0

LINK = f"""\
  <link name="link_{{j}}"><inertial>
    <origin xyz="0 0 {-LENGTH / 2}"/><mass value="{MASS}"/>
    <inertia ixx="{MOMENT}" iyy="{MOMENT}" izz="{MOMENT}" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
"""
JOINT = f"""\
  <joint name="joint_{{j}}" type="revolute">
    <parent link="link_{{before}}"/><child link="link_{{j}}"/>
    <origin xyz="0 0 {-LENGTH}"/><axis xyz="{{axis}}"/>
    <limit lower="-1" upper="1" effort="{{effort:g}}" velocity="3"/>
  </joint>
"""


def chain(joints: int) -> str:
    """The description of a chain of ``joints`` joints, each strong enough for what hangs on it."""
    parts = ['<robot name="chain">\n  <link name="link_0"/>\n']
    for j in range(1, joints + 1):
        beyond = joints + 1 - j
        effort = 1.0 + 2.0 * 9.81 * MASS * beyond * LENGTH * beyond / 2.0
        axis = "1 0 0" if j % 2 else "0 1 0"
        parts.append(LINK.format(j=j))
        parts.append(JOINT.format(j=j, before=j - 1, axis=axis, effort=effort))
    return "".join(parts) + "</robot>\n"

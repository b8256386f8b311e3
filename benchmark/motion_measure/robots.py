# SPDX-License-Identifier: Apache-2.0
"""The robots of the table: those that are shipped, and URDFs from elsewhere, derived."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

SEED = 9


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot to measure.

    Attributes: name, robot (a shipped name, a path, ``data:`` and a path inside pybullet_data, or
    ``here:`` and a file of this folder), derived (no tuned parameters), stretched (positions of
    the stretched pose by joint index, rad; the others are at 0), parameters (on top of the
    configuration).
    """

    name: str
    robot: str
    derived: bool = True
    stretched: Mapping[int, float] | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def source(self) -> str:
        """What the parameter ``robot`` gets."""
        if self.robot.startswith("here:"):
            return str(Path(__file__).parent / self.robot.removeprefix("here:"))
        if self.robot.startswith("data:"):
            import pybullet_data

            return str(Path(pybullet_data.getDataPath()) / self.robot.removeprefix("data:"))
        return self.robot


SHIPPED = (
    Robot("iiwa", "iiwa", derived=False, stretched={1: 1.5}),
    Robot("panda", "panda", derived=False, stretched={1: 1.4, 3: -0.4, 5: 1.6, 7: 0.02}),
    Robot("icub_left_arm", "icub_left_arm", derived=False, stretched={1: 1.5, 3: 0.35}),
)
#: The same on the other engine.
IN_MUJOCO = [
    replace(robot, name=f"{robot.name} in MuJoCo", parameters={"physics": "mujoco"})
    for robot in SHIPPED
]
ROBOTS = {
    robot.name: robot
    for robot in (
        *SHIPPED,
        Robot("kuka", "data:kuka_iiwa/model.urdf", stretched={1: 1.5}),
        Robot("cartpole", "data:cartpole.urdf"),
        Robot("r2d2", "data:r2d2.urdf"),
        Robot("xarm6", "data:xarm/xarm6_robot.urdf", stretched={1: 1.2, 2: -1.2}),
        Robot("gantry", "here:gantry.urdf"),
        Robot("scara", "here:scara.urdf"),
        Robot("snake", "here:snake.urdf"),
        Robot("franka", "data:franka_panda/panda.urdf", stretched={1: 1.4, 3: -0.4, 5: 1.6}),
        Robot("lift", "here:lift.urdf"),
        *IN_MUJOCO,
    )
}


def find(name: str) -> Robot:
    """The robot of a name, or of a URDF's path."""
    return ROBOTS.get(name) or Robot(Path(name).stem, name)


def poses(robot: Robot, home: Any, windows: Any) -> dict[str, Any]:
    """The poses to measure in, arrays of shape (n,), rad or m.

    home; stretched (where one is known: the arm level and straight, as heavy as it gets);
    random (uniform in the middle half of each joint's window, from a fixed seed), where no
    stretched one is known, and for shipped robots.
    """
    found = {"home": np.array(home)}
    if robot.stretched is not None:
        wanted = [robot.stretched.get(j, 0.0) for j in range(len(windows))]
        found["stretched"] = np.array(
            [w.clip(p, 0.05 * w.span) for w, p in zip(windows, wanted, strict=True)]
        )
    if robot.derived and len(found) > 1:
        return found
    parts = np.random.default_rng(SEED).uniform(0.25, 0.75, len(windows))
    found["random"] = np.array([w.at(part) for w, part in zip(windows, parts, strict=True)])
    return found

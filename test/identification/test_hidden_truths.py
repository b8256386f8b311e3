# SPDX-License-Identifier: Apache-2.0
"""Properties unknown to the board are found from motions (SPEC G3).

Friction within 10 %, everything else within 5 %, with noise and steps in the sensors.
"""

from __future__ import annotations

import pytest
from hidden import ENGINES, GRID, ROBOTS, Hidden, drawn, misses, of_grid

from control_board_ros.identification.outcome import Outcome

#: What a payload can hide, at the joint that carries it.
HIDDEN = {"mass", "center", "inertia"}


def check(hidden: Hidden, found: Outcome) -> None:
    """What is written is within its tolerance; nothing is left out but what a payload hides."""
    assert not found.troubles
    rows = misses(hidden, found)
    assert not [one for one in rows if not one.why and not one.allowed]
    refused = [one for one in rows if one.why]
    assert not [one for one in refused if one.quantity not in HIDDEN]
    assert {one.joint for one in refused} <= {hidden.robot.payload_joint()}
    assert {one.joint for one in rows} >= set(hidden.joints)
    (mass,) = (one for one in rows if one.quantity == "mass")
    assert abs(mass.found - mass.truth) <= max(0.05 * mass.truth, 1.5 * mass.sure)


@pytest.mark.soak
def test_two_joints_and_a_payload_are_identified() -> None:
    """G3: the small form of the grid below: an elbow and a wrist, in MuJoCo."""
    joints = [f"lbr_iiwa_joint_{k}" for k in (4, 6)]
    hidden = Hidden("iiwa", "mujoco", joints, drawn("iiwa", joints, 1, "mujoco"), 1.0)
    check(hidden, hidden.identified())


@pytest.mark.soak
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("seed", list(GRID))
@pytest.mark.parametrize("physics", ENGINES)
@pytest.mark.parametrize("robot", list(ROBOTS))
def test_hidden_truths_are_found(robot: str, physics: str, seed: int) -> None:
    """G3: three robots, both engines, three seeds, all joints of each arm."""
    pytest.importorskip(physics)
    hidden = of_grid(robot, physics, seed)
    check(hidden, hidden.identified())

# SPDX-License-Identifier: Apache-2.0
"""Properties that the board does not know are found from motions (SPEC G3).

Friction within 10 %, everything else within 5 %, with noise and steps in the sensors.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from hidden import Hidden, drawn

from control_board_ros.identification.judge import PARAMETERS
from control_board_ros.identification.outcome import Outcome

SCARA = Path(__file__).resolve().parents[2] / "benchmark" / "motion_measure" / "scara.urdf"
IIWA = [f"lbr_iiwa_joint_{k}" for k in range(1, 8)]
PANDA = [f"panda_joint{k}" for k in range(1, 8)]
#: Quantities of every joint; drive_delay is sure to a quarter of a cycle.
FRICTION = ("coulomb", "viscous", "breakaway")
OTHERS = ("torque_constant", "efficiency", "inertia", "resistance")


def check(hidden: Hidden, found: Outcome, payload: float) -> None:
    """Everything is written, and within its tolerance."""
    assert not found.troubles
    assert not [
        one for one in found.findings if one.why and one.quantity not in ("mass", "center")
    ]
    for one in found.written:
        if one.quantity in (*FRICTION, *OTHERS):
            truth = hidden.truth[one.parameter]
            tolerance = 0.1 if one.quantity in FRICTION else 0.05
            assert one.value[0] == pytest.approx(truth, rel=tolerance), one
        elif one.quantity == "delay":
            truth = hidden.truth[one.parameter]
            assert one.value[0] == pytest.approx(truth, rel=0.05, abs=2.5e-4), one
    if payload:
        (mass,) = (one for one in found.findings if one.quantity == "mass")
        assert mass.value[0] == pytest.approx(payload, rel=0.05), mass
    names = {one.parameter for one in found.written}
    assert {f"{j}.{PARAMETERS[q]}" for j in hidden.joints for q in (*FRICTION, *OTHERS)} <= names


@pytest.mark.slow
def test_two_joints_and_a_payload_are_identified() -> None:
    """The small form of the grid below: an elbow and a wrist, in MuJoCo."""
    pytest.importorskip("mujoco")
    joints = [IIWA[3], IIWA[5]]
    hidden = Hidden("iiwa", "mujoco", joints, drawn("iiwa", joints, 1, "mujoco"), 1.0)
    check(hidden, hidden.identified(), 1.0)


@pytest.mark.soak
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("physics", ["mujoco", "pybullet"])
@pytest.mark.parametrize("robot", ["iiwa", "panda", "scara"])
def test_hidden_truths_are_found(robot: str, physics: str, seed: int) -> None:
    """Whole arms: three robots, both engines, three seeds; scara is a derived URDF."""
    pytest.importorskip(physics)
    joints = {"iiwa": IIWA, "panda": PANDA, "scara": []}[robot]
    source = str(SCARA) if robot == "scara" else robot
    joints = joints or list(Hidden(source, physics, [], {}).robot.names)
    payload = {"iiwa": 1.5, "panda": 0.6, "scara": 0.5}[robot]
    truth = drawn(source, joints, seed, physics)
    hidden = Hidden(source, physics, joints, truth, payload, seed)
    check(hidden, hidden.identified(), payload)

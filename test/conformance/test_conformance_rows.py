# SPDX-License-Identifier: Apache-2.0
"""The conformance suite on drives of each kind (rows of S1, S7), and on coupled axes (Y3)."""

from __future__ import annotations

import board_in_process
import pytest
from bad_wire import WIRES
from conformance_sessions import ARM, RATE, not_held, tried

from control_board_ros.conformance import Outcome
from control_board_ros.conformance.bench import Permissions
from control_board_ros.core.terms.drives import KINDS, SetPoint
from control_board_ros.settings.loading import load
from control_board_ros.testing import board_process

#: One of each kind of rule, on every row all day; the others are in the soak.
SOME = ("M4", "M9", "I4")
#: Held on every row, and on those whose drives reach the laws of torque (S1).
HELD_BY_ALL, HELD_WITH_TORQUE = 29, 35
OWN = tuple(kind for kind in KINDS if kind is not SetPoint.PWM)
WITHOUT_TORQUE = (SetPoint.POSITION, SetPoint.VELOCITY)


@pytest.mark.parametrize("kind", OWN, ids=[kind.code for kind in OWN])
def test_rules_are_held_on_each_row(kind: SetPoint) -> None:
    """S7: without ROS and without a clock; the joint beside it has a drive of another kind."""
    other = OWN[OWN.index(kind) - 1]
    arm = load(ARM, {"left.drive": [kind.code], "right.drive": [other.code]})
    outcomes = {name: outcome for name, (outcome, _) in board_in_process.tried(SOME, arm).items()}
    torque = Outcome.NOT_TESTABLE if kind in WITHOUT_TORQUE else Outcome.HELD
    assert outcomes == {"M4": Outcome.HELD, "M9": Outcome.HELD, "I4": torque}


@pytest.mark.ros
@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS, ids=[kind.code for kind in KINDS])
def test_all_rules_are_held_on_each_row(kind: SetPoint) -> None:
    """S7: no rule fails; what is not testable is for want of a mode, or of a permission."""
    params = RATE | {"physics": "mujoco", "joint_defaults.drive": [kind.code]}
    with board_process(params, config=ARM) as board:
        results = tried(board, joint="left", allowed=Permissions(calibrate=True, power_cycle=True))
    assert not not_held(results)
    held = [name for name, one in results.items() if one.outcome is Outcome.HELD]
    assert len(held) >= (HELD_BY_ALL if kind in WITHOUT_TORQUE else HELD_WITH_TORQUE), results


@pytest.mark.ros
@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS, ids=[kind.code for kind in KINDS])
def test_rules_are_held_on_a_bad_wire(kind: SetPoint) -> None:
    """B7, S7: behind frames that come 5 to 10 ms late, or not at all."""
    wire = {f"joint_defaults.drive_model.{name}": value for name, value in WIRES["all"].items()}
    patient = {f"joint_defaults.timeouts.{sensor}": 0.1 for sensor in ("encoder", "torque_sensor")}
    drive = {"physics": "mujoco", "joint_defaults.drive": [kind.code]}
    with board_process(RATE | drive | wire | patient, config=ARM) as board:
        results = tried(board, joint="left")
    assert not not_held(results)


AXES = ["lbr_iiwa_joint_1", "lbr_iiwa_joint_2", "lbr_iiwa_joint_3"]
#: A finger of a hand, and three coupled motors.
BOARDS = {
    "l_index_distal": {"robot": "icub_hand", "physics": "mujoco"},
    AXES[2]: {
        "robot": "iiwa",
        "joints": AXES,
        "physics": "mujoco",
        "couplings.shoulder.axes": AXES,
        "couplings.shoulder.motor_matrix": [1.0, 0.0, 0.0, -0.6, 1.0, 0.0, -0.6, 0.6, 1.0],
    },
}


@pytest.mark.ros
@pytest.mark.soak
@pytest.mark.parametrize("joint", BOARDS)
def test_rules_are_held_by_coupled_axes(joint: str) -> None:
    """Y3: the rules of joints hold for axes; with coupled motors joint_states has the axes.

    All day test_rules_couplings has them move in process, and test_conformance_suite a finger.
    """
    with board_process(RATE | BOARDS[joint]) as board:
        results = tried(board, joint=joint)
    assert not not_held(results)
    held = [name for name, one in results.items() if one.outcome is Outcome.HELD]
    assert len(held) >= 30, results
    assert ("Y3" in held) == (joint not in AXES)

# SPDX-License-Identifier: Apache-2.0
"""The conformance suite on coupled axes: a finger of a hand, and three coupled motors (Y3)."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from conformance_sessions import RATE, not_held, tried

from control_board_ros.conformance import Outcome
from control_board_ros.testing import board_process

pytestmark = pytest.mark.ros

AXES = ["lbr_iiwa_joint_1", "lbr_iiwa_joint_2", "lbr_iiwa_joint_3"]
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


@pytest.mark.parametrize(
    "names",
    [
        pytest.param(("M1", "M9", "I5", "Y3"), marks=pytest.mark.slow, id="some"),
        pytest.param(None, marks=pytest.mark.soak, id="all"),
    ],
)
@pytest.mark.parametrize("joint", BOARDS)
def test_rules_are_held_by_coupled_axes(joint: str, names: Sequence[str] | None) -> None:
    """Y3: what holds of joints holds of axes; coupled motors leave joint_states to the axes."""
    with board_process(RATE | BOARDS[joint]) as board:
        results = tried(board, names, joint=joint)
    assert not not_held(results)
    held = [name for name, one in results.items() if one.outcome is Outcome.HELD]
    assert len(held) >= (30 if names is None else 3), results
    assert ("Y3" in held) == (joint not in AXES)

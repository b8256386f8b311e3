# SPDX-License-Identifier: Apache-2.0
"""What the panel says of commands that other programs send."""

from __future__ import annotations

from typing import Any

import pytest
from control_board_msgs.msg import PositionCommand
from trajectory_msgs.msg import JointTrajectory

from control_board_ros.panel.boards import first_values, in_words, names_of


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (PositionCommand(names=["a", "b"], positions=[0.5, 1.0]), "a 0.5, b 1"),
        (PositionCommand(positions=[0.5, 1.0]), "all joints"),
        (JointTrajectory(joint_names=["a"]), "a"),
        (JointTrajectory(joint_names=[*"abcd"]), "a, b, c and 1 more"),
    ],
)
def test_a_command_is_told_with_its_joints(message: Any, words: str) -> None:
    assert in_words(names_of(message), first_values(message)) == words

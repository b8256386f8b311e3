# SPDX-License-Identifier: Apache-2.0
"""A board of the panel: its subscriptions, and texts of other programs' commands."""

from __future__ import annotations

from typing import Any

import pytest
from control_board_msgs.msg import PositionCommand
from trajectory_msgs.msg import JointTrajectory
from waiting import until

from control_board_ros.interface import STATE
from control_board_ros.panel import boards
from control_board_ros.panel.boards import Board, first_values, in_words, names_of
from control_board_ros.testing import free_domain, ros_node


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (PositionCommand(names=["a", "b"], positions=[0.5, 1.0]), "a 0.5, b 1"),
        (PositionCommand(positions=[0.5, 1.0]), "all joints"),
        (JointTrajectory(joint_names=["a"]), "a"),
        (JointTrajectory(joint_names=[*"abcd"]), "a, b, c and 1 more"),
    ],
)
def test_a_command_is_shown_with_its_joints(message: Any, words: str) -> None:
    assert in_words(names_of(message), first_values(message)) == words


@pytest.mark.ros
def test_a_silent_board_is_subscribed_to_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boards, "SILENCE", 0.3)
    with free_domain() as domain, ros_node(domain, "panel", spin=False) as node:
        board = Board(node, "/late", 0, 1.0)
        board.watch(on=True)
        watched = board.state
        assert watched is not None
        with ros_node(domain, "late") as late:
            states = late.create_publisher(STATE.load(), STATE.of("/late"), 10)
            late.create_timer(0.02, lambda: states.publish(STATE.load()(names=["a"])))
            until(lambda: watched.take() is not None)
            deaf = watched._subscription
            node.destroy_subscription(deaf)  # no longer served
            until(lambda: board.poll() == {} and watched._subscription is not deaf)
            until(lambda: watched.take() is not None)
        board.close()

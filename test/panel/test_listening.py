# SPDX-License-Identifier: Apache-2.0
"""The panel renews the subscriptions to a silent board."""

from __future__ import annotations

import pytest
from talk import until

from control_board_ros.interface import STATE
from control_board_ros.panel import boards
from control_board_ros.panel.boards import Board
from control_board_ros.testing import free_domain, ros_node

pytestmark = pytest.mark.ros


def test_a_silent_board_is_listened_for_anew(monkeypatch: pytest.MonkeyPatch) -> None:
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

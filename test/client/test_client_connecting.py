# SPDX-License-Identifier: Apache-2.0
"""connect(): a client for programs without a node."""

from __future__ import annotations

import pytest
import rclpy

from control_board_ros.client import BoardError, BoardNotFound, connect
from control_board_ros.testing import BoardProcess

pytestmark = pytest.mark.ros


def test_three_lines_are_enough(board: BoardProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    """It brings a node and a context of its own, which end with it; rclpy's own stays as it is."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(board.domain))
    client = connect(find_timeout=60.0, answer_timeout=60.0)
    try:
        assert len(client.names) == 7
        assert client.set_control_mode(0, "pos")
        assert not rclpy.ok()
        context = client._link._node.context
        assert context.ok()
    finally:
        client.close()
        client.close()  # the second time there is nothing to end
    assert not context.ok()


@pytest.mark.slow
def test_a_board_that_is_not_there(board: BoardProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line with the domain, the time, and the boards that are."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(board.domain))
    with connect("nowhere", find_timeout=2.0) as client, pytest.raises(BoardNotFound) as raised:
        client.get_encoder()
    assert str(raised.value) == (
        f"no board found on domain {board.domain} after 2 s as /nowhere; "
        "boards there are: /control_board"
    )


def test_refusals_of_ros_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """A domain that is none ends nothing but the call; an option that is none is a TypeError."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "none")
    with pytest.raises(BoardError, match=r"^cannot start a ROS node: .+$"):
        connect()
    monkeypatch.setenv("ROS_DOMAIN_ID", "47")
    with pytest.raises(TypeError, match="patience"):
        connect(patience=1.0)

# SPDX-License-Identifier: Apache-2.0
"""Integration tests against a real board, without launch files.

A test starts the node in a separate process and ROS domain, and connects to it::

    from control_board_ros.client import ControlBoardClient
    from control_board_ros.testing import board_process, ros_node

    def test_my_controller():
        with board_process({"real_time_factor": 0.0}) as board:
            with ros_node(board.domain) as node:
                client = ControlBoardClient(node, board.name)
                assert client.set_control_mode(None, "vel")

With ``pytest -p control_board_ros.testing``, the fixture ``control_board`` provides the same (or
``from control_board_ros.testing import control_board, control_board_options``); override
``control_board_options`` to pass arguments of :func:`board_process`. The process is stopped with
SIGTERM at the end of the block and must exit with code 0; its output is part of the error of a
failed test.

Domains: each board uses a free one of 40 to 99 (``CONTROL_BOARD_TEST_DOMAINS=30-39`` selects
others) and holds a lock file while it runs, so that pytest-xdist workers never share one.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from typing import Any

from .domains import child_environment, free_domain
from .nodes import ros_node
from .process import BoardProcess, board_process

__all__ = ["BoardProcess", "board_process", "child_environment", "free_domain", "ros_node"]

if importlib.util.find_spec("pytest") is not None:  # board_process works without it
    import pytest

    __all__ += ["control_board", "control_board_options"]

    @pytest.fixture
    def control_board_options() -> dict[str, Any]:
        """Arguments of :func:`board_process` for ``control_board``; override to change them."""
        return {}

    @pytest.fixture
    def control_board(control_board_options: dict[str, Any]) -> Iterator[BoardProcess]:
        """A board of the default configuration, in a process of its own."""
        with board_process(**control_board_options) as board:
            yield board

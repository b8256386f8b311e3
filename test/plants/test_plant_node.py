# SPDX-License-Identifier: Apache-2.0
"""A node on a third-party plant, as users start it (B2, B3)."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from levers import IIWA, path_with
from talk import patient

from control_board_ros.testing import board_process, child_environment, free_domain, ros_node

pytestmark = [pytest.mark.ros, pytest.mark.slow]


def test_a_node_drives_the_levers(tmp_path: Path) -> None:
    """B1, B2, M5: it moves, and offers no torque mode."""
    params = {"plant": "levers", "plant_timeout": 5.0, "joint_defaults.startup_mode": "idl"}
    with (
        board_process(params, env=path_with(tmp_path)) as board,
        ros_node(board.domain, spin=False) as node,
        patient(node, board.name) as client,
    ):
        assert client.set_control_mode(IIWA[0], "open")
        before = client.get_encoder(IIWA[0])[0]
        assert client.set_output(IIWA[0], 30.0)
        while client.get_encoder(IIWA[0])[0] < before + 0.05:
            pass
        refused = client.set_control_mode(IIWA[1], "torq")
        assert not refused
        assert "torq" in refused.message


def test_an_unknown_plant_is_one_line() -> None:
    command = [sys.executable, "-m", "control_board_ros.node.main", "--ros-args", "-p"]
    with free_domain() as domain:
        done = subprocess.run(
            [*command, "plant:=nothing"],
            env=child_environment(domain),
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 2
    assert "plant: 'nothing' unknown; " in done.stderr
    assert done.stderr.count("\n") == 1

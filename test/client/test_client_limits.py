# SPDX-License-Identifier: Apache-2.0
"""The limits in force, where drives allow less than the board (SPEC S4)."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from cbctl_process import Asker, Cbctl
from iiwa import JOINTS
from levers import path_with
from talk import patient, until

from control_board_ros.client import ControlBoardClient
from control_board_ros.core.terms.drives import DriveReport
from control_board_ros.testing import BoardProcess, board_process, ros_node

pytestmark = pytest.mark.ros
PLANT = {
    "plant": "levers",
    "plant_timeout": 5.0,
    "joint_defaults.startup_mode": "idl",
    "control_rate": 250.0,
}


@pytest.fixture(scope="module")
def process(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BoardProcess]:
    """The iiwa on drives with narrower limits."""
    path = path_with(tmp_path_factory.mktemp("path"), "levers:make_narrow")
    with board_process(PLANT, env=path) as board:
        yield board


@pytest.fixture
def client(process: BoardProcess) -> Iterator[ControlBoardClient]:
    with ros_node(process.domain, "user", spin=False) as node, patient(node, process.name) as one:
        until(lambda: one.get_velocity_limits(0)[0] == 0.5)  # the drives answer
        yield one


def test_the_smaller_limits_are_shown(client: ControlBoardClient) -> None:
    """S4: by every getter; the parameters keep what was set, and smaller ones act."""
    lower, upper = client.get_limits([1, 0])
    assert upper.tolist() == [1.0, 1.0]
    assert (lower < -1.0).all()
    assert client.get_pos_limits(0)[1].tolist() == [1.0]
    assert client.get_vel_limits().tolist() == [0.5] * 7
    assert client.get_torque_range(0)[1].tolist() == [3.0]
    first, *_ = client.get_joint_limits()
    assert (first.upper, first.velocity, first.torque) == (1.0, 0.5, 3.0)
    assert client.get_current_range(0)[1].tolist() == [first.peak_current]
    name = f"{JOINTS[0]}.limits.upper"
    before = client.get_parameters([name])
    assert before[name] > 2.0
    for asked, acts in ((2.0, 1.0), (0.5, 0.5), (before[name], 1.0)):
        assert client.set_pos_limits(0, lower[1], asked)
        assert client.get_parameters([name]) == {name: asked}
        assert client.get_limits(0)[1].tolist() == [acts]


def test_what_drives_report_crosses_every_process(client: ControlBoardClient) -> None:
    """S8: in another process than the board, told where it changes; what is not told is None."""
    reported = lambda: [one.reported for one in client.get_drives([1, 0])]  # noqa: E731
    assert client.set_control_mode(0, "open")
    until(lambda: [one.power for one in reported()] == [False, True])
    assert reported() == [DriveReport("lost", False), DriveReport("lost", True, "1 PWM")]
    assert client.set_control_mode(0, "idl")
    until(lambda: reported()[1] == DriveReport("lost", False))


@pytest.mark.slow
def test_cbctl_shows_and_checks_them(process: BoardProcess, client: ControlBoardClient) -> None:
    """S4: in ``info``, and before a move."""
    cbctl = Cbctl(process.environment)
    ask = Asker(cbctl)
    row = ask("info")["joints"][JOINTS[0]]
    assert (row["upper"], row["velocity"], row["torque"]) == (1.0, 0.5, 3.0)
    assert row["hard_upper"] > 2.0
    refused = ask("move", "0=1.5")["message"]
    assert "1.5 rad = 85.9° is outside its limits" in refused
    assert "57.3°" in refused
    cbctl.close()

# SPDX-License-Identifier: Apache-2.0
"""A node on a third-party plant, as users start it: what it refuses (B2, B4).

Time and faults on demand belong to simulations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest
from cbctl_process import Cbctl
from control_board_msgs import msg, srv
from iiwa import JOINTS
from levers import path_with
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger
from talk import Talker, talking_to
from waiting import until

from control_board_ros.testing import BoardProcess, board_process

pytestmark = [pytest.mark.ros, pytest.mark.slow]

REASON = "drives a plant that is no simulation: its time and its faults are real"
PLANT = {
    "plant": "levers",
    "plant_timeout": 5.0,  # a busy machine is no silence
    "allow_fault_injection": True,
    "joint_defaults.startup_mode": "idl",
    "control_rate": 250.0,
}
PARTS = {
    "robot_name": "pair",
    "parts.upper": [*JOINTS[:4]],
    "parts.lower": [*JOINTS[4:]],
}


@pytest.fixture(scope="module")
def process(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[BoardProcess]:
    """A board, or a robot of parts, on a plant that is no simulation."""
    params = PLANT | PARTS if request.param else PLANT
    path = path_with(tmp_path_factory.mktemp("path"))
    with board_process(params, env=path, robot="pair" if request.param else "") as process:
        yield process
    assert "internal error" not in process.output
    assert "Traceback" not in process.output


@pytest.fixture(scope="module")
def talker(process: BoardProcess, request: pytest.FixtureRequest) -> Iterator[Talker]:
    with talking_to(process, to=request.param) as one:
        yield one


def of(*places: tuple[bool, str]) -> pytest.MarkDecorator:
    """On a robot of parts or not, and whom of it a test talks to."""
    return pytest.mark.parametrize(
        ("process", "talker"), places, indirect=True, ids=[name for _, name in places]
    )


BOARD, ROBOT, PART = (False, "/control_board"), (True, "/pair/robot"), (True, "/pair/upper")
ALONE = pytest.mark.parametrize("process", [False], indirect=True, ids=["board"])


def still_moves(talker: Talker) -> None:
    """Nothing has changed: the loop runs, and a driven joint moves, off its stops."""
    assert talker.set_mode([JOINTS[0]], "open").success
    start = talker.state().position[0]
    way = math.copysign(1.0, -start)
    talker.until_state(
        lambda: talker.command(
            "command/output", msg.OutputCommand(names=[JOINTS[0]], outputs=[20.0 * way])
        ),
        lambda state: way * (state.position[0] - start) > 0.02,
    )
    assert talker.set_mode([JOINTS[0]], "idl").success


REQUESTS: list[tuple[str, Any, dict[str, Any]]] = [
    ("pause", SetBool, {"data": True}),
    ("pause", SetBool, {"data": False}),
    ("step", srv.Step, {"steps": 3}),
    ("reset", Trigger, {}),
    ("inject_fault", srv.InjectFault, {"fault": "encoder"}),
    ("clear_injected_faults", Trigger, {}),
]


@of(BOARD, ROBOT, PART)
def test_time_and_faults_on_demand_are_refused_and_change_nothing(talker: Talker) -> None:
    """B4: with the reason, and the loop continues."""
    for name, kind, request in REQUESTS:
        answer = talker.call(name, kind, **request)
        assert not answer.success, name
        assert REASON in answer.message
        assert "\n" not in answer.message
    still_moves(talker)


@of(BOARD, ROBOT, PART)
def test_an_external_torque_is_ignored_and_reported(talker: Talker, process: BoardProcess) -> None:
    """B4: with the reason in the log."""
    before = len(process.output)

    def reported() -> bool:
        talker.command("external_torque", msg.TorqueCommand(names=[JOINTS[0]], torques=[1.0]))
        return f"external_torque ignored: this board {REASON}" in process.output[before:]

    until(reported)
    still_moves(talker)


@of(BOARD, ROBOT)
def test_other_time_is_refused(talker: Talker) -> None:
    """B4: real_time_factor, with the reason; a part has none."""
    wanted = [Parameter("real_time_factor", value=2.0).to_parameter_msg()]
    (result,) = talker.call("set_parameters", SetParameters, parameters=wanted).results
    assert not result.successful
    assert result.reason.startswith("real_time_factor: 2.0 is not allowed; this board drives")
    assert REASON in result.reason
    still_moves(talker)


@ALONE
def test_cbctl_says_why(process: BoardProcess) -> None:
    with closing(Cbctl(process.environment)) as cbctl:
        for line in ("pause", "resume", "advance", "reset", "inject 0 encoder", "inject --clear"):
            done = cbctl(*line.split())
            assert done.code == 1, line
            assert REASON in done.err
            assert done.err.count("\n") == 1

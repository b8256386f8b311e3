# SPDX-License-Identifier: Apache-2.0
"""The next step of a managed board: the transition of its node."""

from __future__ import annotations

from contextlib import closing

import pytest
from cbctl_process import Cbctl
from lifecycle_msgs.srv import ChangeState
from robots import LOWER, UPPER
from talk import talking_to
from waiting import until

from control_board_ros.cli.text.advice import advice
from control_board_ros.core.terms.reply import Reason, refused
from control_board_ros.testing import board_process


@pytest.mark.parametrize(
    ("code", "manager", "expected"),
    [
        (Reason.NOT_CONFIGURED, "", "configure with: cbctl configure"),
        (
            Reason.NOT_CONFIGURED,
            "/arm",
            "configure with: ros2 lifecycle set /arm configure",
        ),
        (Reason.INACTIVE, "/arm", "activate with: ros2 lifecycle set /arm activate"),
        (Reason.INACTIVE, "", ""),
        (Reason.OTHER_MODE, "/arm", "switch with: cbctl mode all vel"),
    ],
)
def test_the_next_step_by_code(code: Reason, manager: str, expected: str) -> None:
    """As a line to type; a managed board has no other way than a transition."""
    reply = refused("no", ("elbow",), code)
    line = "cbctl {}".format
    assert advice(reply, ["elbow"], line, lambda: manager, "vel") == expected


@pytest.mark.slow
@pytest.mark.ros
def test_a_part_of_a_managed_robot_is_configured_and_activated() -> None:
    """K7: the transitions are those of the robot's node, which the next step names."""
    params = {
        "robot": "iiwa",
        "robot_name": "pair",
        "parts": {"upper": UPPER, "lower": LOWER},
        "physics": "ideal",
        "lifecycle": True,
        "autostart": False,
    }
    with (
        board_process(params, robot="pair") as board,
        talking_to(board) as robot,
        closing(Cbctl(board.environment)) as cbctl,
    ):

        def step(name: str, transition: str) -> None:
            """Wait until the node is discovered, and named."""
            command = f"ros2 lifecycle set /pair/robot {transition}\n"
            until(lambda: cbctl("--board", name, "mode", "pos").err.endswith(command))

        for name, transition in (("/pair/upper", "configure"), ("/pair/robot", "activate")):
            step(name, transition)
            request = ChangeState.Request()
            request.transition.label = transition
            assert robot.call("change_state", ChangeState, transition=request.transition).success
        assert cbctl("--board", "/pair/upper", "mode", "pos").code == 0

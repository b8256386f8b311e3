# SPDX-License-Identifier: Apache-2.0
"""The actions ~/move, ~/go_to_pose and ~/calibrate."""

from __future__ import annotations

from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from control_board_msgs import msg, srv
from control_board_msgs.action import Calibrate, Move
from std_srvs.srv import SetBool
from talk import Talker
from waiting import until

from control_board_ros.testing import BoardProcess

pytestmark = pytest.mark.ros

CALIBRATED = "lbr_iiwa_joint_7"
UNCALIBRATED = "lbr_iiwa_joint_1"


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    calibration = {"type": 3, "required": False, "start": 0.4, "speed": 0.4}
    return {
        "allow_fault_injection": True,
        "real_time_factor": 4.0,
        "control_rate": 250.0,
        "state_rate": 25.0,
        CALIBRATED: {"calibration": calibration},
        UNCALIBRATED: {"calibration": {"type": 0}},
    }


def result(talker: Talker, handle: Any) -> tuple[int, Any]:
    answer = talker.result(handle)
    return answer.status, answer.result


def test_cancelling_a_move_stops_the_joints(talker: Talker) -> None:
    """A cancelled move holds the joints where they are."""
    name = talker.names[3]
    start = talker.state().position[3]
    goal = {"names": [name], "positions": [start + 1.0], "speeds": [0.01]}
    handle = talker.goal("move", Move, **goal)
    talker.state(lambda s: s.position[3] > start + 0.002)
    assert talker.call("pause", SetBool, data=True).success  # however long the rest takes
    there = talker.state().position[3]
    assert talker.answer(talker.within(handle.cancel_goal_async)).goals_canceling
    status, answer = result(talker, handle)
    assert talker.call("pause", SetBool, data=False).success
    assert status == GoalStatus.STATUS_CANCELED
    assert not answer.success
    assert "stopped" in answer.message
    state = talker.state(lambda s: s.motion_done[3] and abs(s.velocity[3]) < 0.01)
    assert state.position[3] == pytest.approx(there, abs=0.05)


def test_another_move_ends_the_first(talker: Talker) -> None:
    """The newest target counts; the action that lost its joint says so."""
    name = talker.names[6]
    handle = talker.goal("move", Move, names=[name], positions=[1.0], speeds=[0.05])
    talker.command("command/position", msg.PositionCommand(names=[name], positions=[-0.1]))
    status, answer = result(talker, handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert "another move" in answer.message


def test_services_answer_during_a_move(talker: Talker) -> None:
    """Waiting for a move does not occupy the node."""
    handle = talker.goal("move", Move, names=talker.names[6:], positions=[0.5], speeds=[0.25])
    for _ in range(20):
        assert talker.call("get_control_mode", srv.GetControlMode).success
    assert result(talker, handle)[1].success


def test_a_paused_move_waits_and_the_log_says_so(talker: Talker, board: BoardProcess) -> None:
    """Paused time ends no move."""
    assert talker.call("pause", SetBool, data=True).success
    handle = talker.goal("move", Move, names=talker.names[6:], positions=[0.1], speeds=[0.5])
    waiting = talker.within(handle.get_result_async)
    board.wait_for_output("move waits: the simulation is paused")
    for _ in range(3):
        talker.state()
    assert not waiting.done()
    assert talker.call("pause", SetBool, data=False).success
    assert talker.answer(waiting).result.success


def test_calibrate_with_feedback(talker: Talker) -> None:
    """K1, K3: CALIBRATING at once, progress up to 1, then the calibrator's mode."""
    feedback: list[Any] = []
    assert talker.call("pause", SetBool, data=True).success  # it cannot end meanwhile
    handle = talker.goal("calibrate", Calibrate, feedback, names=[CALIBRATED])
    assert talker.modes()[6] == "cal"
    refused = talker.set_mode([CALIBRATED], "pos")
    assert not refused.success  # K2
    assert talker.call("pause", SetBool, data=False).success
    status, answer = result(talker, handle)
    assert (status, answer.success, answer.message) == (GoalStatus.STATUS_SUCCEEDED, True, "")
    assert talker.modes()[6] == "pos"
    assert talker.state().position[6] == pytest.approx(0.4, abs=0.03)
    until(lambda: bool(feedback) and feedback[-1].progress[0] == 1.0)
    assert any(one.phase for one in feedback)


def test_cancelling_a_calibration_idles_the_joint(talker: Talker) -> None:
    """K2: FORCE_IDLE aborts it, to IDLE."""
    assert talker.call("pause", SetBool, data=True).success
    handle = talker.goal("calibrate", Calibrate, names=[CALIBRATED])
    assert talker.answer(talker.within(handle.cancel_goal_async)).goals_canceling
    assert talker.call("pause", SetBool, data=False).success
    status, answer = result(talker, handle)
    assert status == GoalStatus.STATUS_CANCELED
    assert "IDLE" in answer.message
    assert talker.modes()[6] == "idl"


def test_calibration_that_cannot_start_says_why(talker: Talker) -> None:
    """A joint without a calibrator fails with the reason."""
    handle = talker.goal("calibrate", Calibrate, names=[UNCALIBRATED])
    status, answer = result(talker, handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert "no calibrator" in answer.message

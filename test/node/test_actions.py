# SPDX-License-Identifier: Apache-2.0
"""The actions ~/move, ~/go_to_pose and ~/calibrate, and ~/joint_trajectory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration, Time
from control_board_msgs import msg, srv
from control_board_msgs.action import Calibrate, GoToPose, Move
from std_srvs.srv import SetBool
from talk import Talker, stamp_of, until
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from control_board_ros.testing import BoardProcess

pytestmark = pytest.mark.ros

CALIBRATED = "lbr_iiwa_joint_7"
UNCALIBRATED = "lbr_iiwa_joint_1"


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    calibration = {"type": 3, "required": False, "start": 0.4, "speed": 0.4}
    return {
        "allow_fault_injection": True,
        "publish_clock": True,  # stamps are simulated time then, exact on a busy machine too
        CALIBRATED: {"calibration": calibration},
        UNCALIBRATED: {"calibration": {"type": 0}},
    }


def result(talker: Talker, handle: Any) -> tuple[int, Any]:
    answer = talker.result(handle)
    return answer.status, answer.result


def test_move_ends_at_its_target_with_feedback(talker: Talker) -> None:
    """~/move succeeds when the joints are there; its remaining time falls to 0."""
    joints = talker.names[5:7]
    feedback: list[Any] = []
    handle = talker.goal(
        "move", Move, feedback, names=joints, positions=[0.6, -0.3], speeds=[0.5, 0.5]
    )
    status, answer = result(talker, handle)
    assert (status, answer.success, answer.message) == (GoalStatus.STATUS_SUCCEEDED, True, "")
    assert talker.state().position[5:7] == pytest.approx([0.6, -0.3], abs=0.02)
    assert list(feedback[0].names) == joints
    remaining = [one.remaining_time for one in feedback]
    assert remaining == sorted(remaining, reverse=True)
    whole = 1.875 * abs(0.6) / 0.5  # s, of the peak speed
    assert 0.0 < remaining[0] <= whole
    assert len(feedback) >= 2


def test_move_of_all_joints(talker: Talker) -> None:
    """Empty names mean all joints."""
    target = [p + 0.05 for p in talker.state().position]
    status, answer = result(talker, talker.goal("move", Move, positions=target))
    assert status == GoalStatus.STATUS_SUCCEEDED, answer.message
    assert list(talker.state().position) == pytest.approx(target, abs=0.02)


def test_cancelling_a_move_stops_the_joints(talker: Talker) -> None:
    """A cancelled move holds the joints where they are."""
    name = talker.names[3]
    start = talker.state().position[3]
    goal = {"names": [name], "positions": [start + 1.0], "speeds": [0.1]}
    handle = talker.goal("move", Move, **goal)
    talker.state(lambda s: s.position[3] > start + 0.02)
    assert talker.answer(talker.within(handle.cancel_goal_async)).goals_canceling
    status, answer = result(talker, handle)
    assert status == GoalStatus.STATUS_CANCELED
    assert not answer.success
    assert "stopped" in answer.message
    state = talker.state(lambda s: s.motion_done[3] and abs(s.velocity[3]) < 0.01)
    assert state.position[3] < start + 0.5


def test_move_fails_when_a_joint_leaves_its_mode(talker: Talker) -> None:
    """A joint that faults during a move ends it with the reason; the others stop."""
    names = talker.names[5:7]
    start = talker.state().position[5]
    goal = {"names": names, "positions": [start + 1.0, 1.0], "speeds": [0.1, 0.1]}
    handle = talker.goal("move", Move, **goal)
    talker.state(lambda s: s.position[5] > start + 0.02)
    assert talker.call("inject_fault", srv.InjectFault, names=names[1:], fault="external").success
    status, answer = result(talker, handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert names[1] in answer.message
    assert "HW_FAULT" in answer.message
    assert "external" in answer.message
    talker.state(lambda s: s.motion_done[5] and s.position[5] < start + 0.6)


def test_move_refused_moves_nothing(talker: Talker) -> None:
    """A move that one joint's mode does not take moves none of the joints."""
    names = talker.names[5:7]
    assert talker.set_mode(names[1:], "vel").success
    before = talker.state().position_reference
    handle = talker.goal("move", Move, names=names, positions=[1.2, 1.0])
    status, answer = result(talker, handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert "VELOCITY" in answer.message
    assert talker.state().position_reference[5] == pytest.approx(before[5], abs=1e-3)
    status, answer = result(talker, talker.goal("move", Move, names=["elbow"], positions=[0.0]))
    assert status == GoalStatus.STATUS_ABORTED
    assert "joint 'elbow' unknown" in answer.message


def test_another_move_ends_the_first(talker: Talker) -> None:
    """The newest target counts; the action that lost its joint says so."""
    name = talker.names[6]
    handle = talker.goal("move", Move, names=[name], positions=[1.0], speeds=[0.2])
    talker.command("command/position", msg.PositionCommand(names=[name], positions=[-0.1]))
    status, answer = result(talker, handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert "another move" in answer.message


def test_go_to_pose_ends_there_with_feedback(talker: Talker) -> None:
    """R5: its feedback is what is left to go, of each joint; it falls to 0."""
    feedback: list[Any] = []
    handle = talker.goal("go_to_pose", GoToPose, feedback, pose="park", speed=0.8)
    status, answer = result(talker, handle)
    assert (status, answer.success) == (GoalStatus.STATUS_SUCCEEDED, True)
    assert list(talker.state().position) == pytest.approx([0.0] * 7, abs=0.02)
    assert list(feedback[0].names) == talker.names
    assert -0.51 < feedback[0].remaining[1] < 0.0
    until(lambda: abs(feedback[-1].remaining[1]) < 0.02)
    left = [abs(one.remaining[1]) for one in feedback]
    assert left == sorted(left, reverse=True)


def test_cancelling_a_pose_stops_the_joints(talker: Talker) -> None:
    """R5: as a move."""
    handle = talker.goal("go_to_pose", GoToPose, pose="park", speed=0.1)
    talker.state(lambda s: s.position[1] < 0.48)
    assert talker.answer(talker.within(handle.cancel_goal_async)).goals_canceling
    status, answer = result(talker, handle)
    assert (status, answer.success) == (GoalStatus.STATUS_CANCELED, False)
    assert "stopped" in answer.message
    assert talker.state(lambda s: s.motion_done[1]).position[1] > 0.1


def test_a_pose_is_refused_whole(talker: Talker) -> None:
    """R5: joints in another mode are all named, nothing moves; an unknown pose has a hint."""
    assert talker.set_mode(talker.names[2:4], "vel", "idl").success
    before = talker.state().position_reference
    status, answer = result(talker, talker.goal("go_to_pose", GoToPose, pose="park"))
    assert status == GoalStatus.STATUS_ABORTED
    assert f"{talker.names[2]} is in VELOCITY" in answer.message
    assert f"{talker.names[3]} is in IDLE" in answer.message
    assert talker.state().position_reference[1] == before[1]
    status, answer = result(talker, talker.goal("go_to_pose", GoToPose, pose="prak"))
    assert status == GoalStatus.STATUS_ABORTED
    assert answer.message == "pose 'prak' unknown; did you mean 'park'?; poses: home, park"


def test_poses_are_listed_and_saved(talker: Talker) -> None:
    """R5: the configuration's, then the user's; as measured, or as given; in the user's file."""
    listed = talker.call("list_poses", srv.ListPoses)
    assert (listed.success, list(listed.poses)) == (True, ["home", "park"])
    assert not listed.names
    home = talker.call("list_poses", srv.ListPoses, name="home")
    assert list(home.names) == talker.names
    assert list(home.positions) == [0.0, 0.5, 0.0, -1.2, 0.0, 0.9, 0.0]
    saved = talker.call("save_pose", srv.SavePose, name="here")
    assert saved.success, saved.message
    assert list(saved.poses) == ["home", "park", "here"]
    assert "control_board_ros/poses/" in saved.message
    here = talker.call("list_poses", srv.ListPoses, name="here")
    assert list(here.positions) == pytest.approx(list(home.positions), abs=0.02)
    wrist = talker.names[6:]
    given = {"names": wrist, "positions": [0.4], "speed": 1.0}
    assert talker.call("save_pose", srv.SavePose, name="turned", **given).success
    assert result(talker, talker.goal("go_to_pose", GoToPose, pose="turned"))[1].success
    assert talker.state().position[6] == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        ({"name": "home"}, "pose 'home' is one of the configuration"),
        ({"name": "../up"}, "is no name"),
        ({"name": "p", "names": ["elbow"]}, "'elbow' unknown"),
        ({"name": "p", "positions": [0.0] * 8}, "8 positions for 7 joints"),
        ({"name": "p", "positions": [0.0] * 6 + [9.0]}, "outside its limits"),
    ],
)
def test_a_pose_that_is_wrong_is_not_saved(
    talker: Talker, request_: dict[str, Any], text: str
) -> None:
    answer = talker.call("save_pose", srv.SavePose, **request_)
    assert not answer.success
    assert text in answer.message
    assert "p" not in talker.call("list_poses", srv.ListPoses).poses


def test_a_broken_pose_file_is_told(talker: Talker, board: BoardProcess) -> None:
    """Those of the configuration are there all the same."""
    folder = Path(board.environment["XDG_CONFIG_HOME"], "control_board_ros", "poses")
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "lbr_iiwa.yaml"
    kept = file.read_text() if file.exists() else ""
    file.write_text("wave: 3\n")
    try:
        listed = talker.call("list_poses", srv.ListPoses)
        assert (listed.success, list(listed.poses)) == (False, ["home", "park"])
        assert listed.message.startswith(f"{file}:1: wave: is no pose")
        handle = talker.goal("go_to_pose", GoToPose, pose="home", speed=1.0)
        assert result(talker, handle)[1].success
    finally:
        file.write_text(kept)


def test_services_answer_during_a_move(talker: Talker) -> None:
    """Waiting for a move does not occupy the node."""
    handle = talker.goal("move", Move, names=talker.names[6:], positions=[0.5], speeds=[0.25])
    for _ in range(20):
        assert talker.call("get_control_mode", srv.GetControlMode).success
    assert result(talker, handle)[1].success


def test_a_paused_move_waits(talker: Talker) -> None:
    """Time that stands still ends no move."""
    handle = talker.goal("move", Move, names=talker.names[6:], positions=[0.3], speeds=[0.5])
    assert talker.call("pause", SetBool, data=True).success
    waiting = talker.within(handle.get_result_async)
    for _ in range(10):
        talker.state()
    assert not waiting.done()
    assert talker.call("pause", SetBool, data=False).success
    assert talker.answer(waiting).result.success


def test_a_goal_of_a_paused_simulation_is_logged(talker: Talker, board: BoardProcess) -> None:
    """It waits, and the log says for what."""
    assert talker.call("pause", SetBool, data=True).success
    handle = talker.goal("move", Move, names=talker.names[6:], positions=[0.1], speeds=[0.5])
    board.wait_for_output("move waits: the simulation is paused")
    assert talker.call("pause", SetBool, data=False).success
    assert result(talker, handle)[1].success


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


def point(seconds: float, positions: list[float], velocities: Any = ()) -> JointTrajectoryPoint:
    whole = int(seconds)
    return JointTrajectoryPoint(
        positions=positions,
        velocities=list(velocities),
        time_from_start=Duration(sec=whole, nanosec=round((seconds - whole) * 1e9)),
    )


def test_trajectory_is_followed(talker: Talker) -> None:
    """~/joint_trajectory: straight lines in POSITION_DIRECT, on time, to the last point."""
    names = talker.names[5:7]
    assert talker.set_mode(names, "posd").success
    start = talker.state().position_reference[5:7]
    points = [point(0.5, [start[0] + 0.2, 0.1]), point(1.0, [start[0] + 0.2, -0.1])]
    first = len(talker.seen["state"])
    talker.command("joint_trajectory", JointTrajectory(joint_names=names, points=points))
    talker.state(lambda s: s.position_reference[5:7] == pytest.approx(points[-1].positions))
    states = talker.seen["state"][first:]
    moving = [s for s in states if start[1] + 1e-6 < s.position_reference[6] < 0.1 - 1e-6]
    begun = stamp_of(moving[0]) + 0.1  # at speed from then on
    rising = [s for s in moving if s.position_reference[5] < start[0] + 0.19]
    rising = [s for s in rising if stamp_of(s) > begun]
    times = [stamp_of(s) - stamp_of(rising[0]) for s in rising]
    moved = [s.position_reference[5] - rising[0].position_reference[5] for s in rising]
    assert len(rising) > 3
    assert moved == pytest.approx([0.4 * t for t in times], abs=0.004)


def test_trajectory_with_velocities_is_smooth(talker: Talker) -> None:
    """With velocities at the points, the reference runs along a cubic: slow at its ends."""
    name = talker.names[6]
    assert talker.set_mode([name], "posd").success
    start = talker.state().position_reference[6]
    message = JointTrajectory(
        joint_names=[name], points=[point(1.0, [start + 0.4], velocities=[0.0])]
    )
    first = len(talker.seen["state"])
    talker.command("joint_trajectory", message)
    talker.state(lambda s: s.position_reference[6] == pytest.approx(start + 0.4))
    speeds = [s.velocity_reference[6] for s in talker.seen["state"][first:]]
    assert max(speeds) == pytest.approx(1.5 * 0.4, abs=0.03)  # and 0.4 along a straight line


def test_trajectory_ends_with_another_reference_or_mode(talker: Talker) -> None:
    """Somebody else's direct position takes over; so does another mode."""
    name = talker.names[6]
    assert talker.set_mode([name], "posd").success
    slow = JointTrajectory(joint_names=[name], points=[point(5.0, [1.0])])
    talker.command("joint_trajectory", slow)
    talker.state(lambda s: s.position_reference[6] > 0.01)
    talker.command(
        "command/position_direct", msg.PositionDirectCommand(names=[name], positions=[0.0])
    )
    talker.state(lambda s: s.position_reference[6] == s.velocity_reference[6] == 0.0)
    for _ in range(10):
        assert talker.state().position_reference[6] == pytest.approx(0.0, abs=1e-3)
    talker.command("joint_trajectory", slow)
    talker.state(lambda s: s.position_reference[6] > 0.01)
    assert talker.set_mode([name], "pos").success
    assert talker.set_mode([name], "posd").success
    held = talker.state(at_rest).position_reference[6]
    for _ in range(10):
        assert talker.state().position_reference[6] == pytest.approx(held, abs=1e-3)


def at_rest(state: msg.BoardState) -> bool:
    """Whether the last joint neither moves nor shall."""
    return bool(state.velocity_reference[6] == 0.0 and abs(state.velocity[6]) < 0.005)


def rejected(talker: Talker, joint: int) -> int:
    return int(talker.state().rejected_commands[joint])


@pytest.mark.parametrize(
    ("points", "text"),
    [
        ([point(0.5, [0.1, 0.2])], "point 0 has 2 positions for 1 joint"),
        ([point(0.5, [float("nan")])], "point 0 has nan in positions"),
        ([point(0.5, [0.1]), point(0.5, [0.2])], "send times that rise"),
        ([point(0.5, [])], "no positions"),
        ([point(0.5, [0.1], [0.0]), point(1.0, [0.2])], "point 1 has no velocities"),
        ([point(0.5, [0.1], [0.1])], "a trajectory ends at rest"),
    ],
)
def test_wrong_trajectories_move_nothing(
    talker: Talker, board: BoardProcess, points: list[Any], text: str
) -> None:
    """M4, P13: wrong lengths, times or numbers are ignored, counted, and the reason is logged."""
    name = talker.names[6]
    assert talker.set_mode([name], "posd").success
    count, before = rejected(talker, 6), talker.state().position_reference[6]
    message = JointTrajectory(joint_names=[name], points=points)
    talker.until_state(
        lambda: talker.command("joint_trajectory", message),
        lambda s: s.rejected_commands[6] > count,
    )
    assert talker.state().position_reference[6] == before
    board.wait_for_output(text)


def test_a_joint_in_another_mode_does_not_keep_the_others(talker: Talker) -> None:
    """M4: it is counted, once; the others are served whole."""
    names = talker.names[5:7]
    assert talker.set_mode(names[:1], "posd").success
    count = rejected(talker, 6)
    points = [point(0.3, [0.1, 0.1]), point(0.6, [0.05, 0.1])]
    talker.command("joint_trajectory", JointTrajectory(joint_names=names, points=points))
    state = talker.state(lambda s: s.position_reference[5] == pytest.approx(0.05))
    assert state.rejected_commands[6] == count + 1
    assert talker.state().position_reference[6] != pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize("way", ["stop", "comp"])
def test_stop_and_interaction_end_a_trajectory(talker: Talker, way: str) -> None:
    """P3, I4: they stop the joints, and nothing goes on afterwards."""
    name = talker.names[6]
    assert talker.set_mode([name], "posd").success
    slow = JointTrajectory(joint_names=[name], points=[point(20.0, [1.0])])
    talker.command("joint_trajectory", slow)
    talker.state(lambda s: s.position_reference[6] > 0.02)
    if way == "stop":
        assert talker.call("stop", srv.Stop, names=[name]).success
    else:
        assert talker.set_interaction([name], "comp").success
    held = talker.state(lambda s: s.velocity_reference[6] == 0.0).position_reference[6]
    assert held < 0.5
    for _ in range(10):
        assert talker.state().position_reference[6] == pytest.approx(held, abs=1e-3)


def test_a_stamp_says_when_a_trajectory_begins(talker: Talker) -> None:
    """T1: one of the past is joined where it is, one that is over refused, one ahead waits."""
    name = talker.names[6]
    assert talker.set_mode([name], "posd").success

    def send(begin: float, *points: JointTrajectoryPoint) -> None:
        message = JointTrajectory(joint_names=[name], points=list(points))
        message.header.stamp = Time(sec=int(begin), nanosec=int(begin % 1.0 * 1e9))
        talker.command("joint_trajectory", message)

    count = rejected(talker, 6)
    send(stamp_of(talker.state()) - 0.5, point(0.2, [0.8]), point(0.4, [-0.8]))
    assert talker.state(lambda s: s.rejected_commands[6] == count + 1).position_reference[6] == (
        pytest.approx(0.0, abs=1e-3)
    )
    assert talker.call("pause", SetBool, data=True).success  # it is sent in time
    begin = stamp_of(talker.state()) + 0.6
    first = len(talker.seen["state"])
    send(begin, point(0.0, [0.0]), point(0.4, [0.2]))
    talker.settle()
    assert talker.call("pause", SetBool, data=False).success
    talker.state(lambda s: s.position_reference[6] == pytest.approx(0.2, abs=1e-3))
    shown = [(stamp_of(s) - begin, s.position_reference[6]) for s in talker.seen["state"][first:]]
    waited = [reference for passed, reference in shown if passed < 0.0]
    assert len(waited) > 3
    assert max(map(abs, waited)) < 1e-3
    on_the_way = [passed for passed, reference in shown if 1e-3 < reference < 0.199]
    assert min(on_the_way) > -0.01
    assert max(on_the_way) < 0.42
    assert all(reference > 0.199 for passed, reference in shown if passed > 0.42)

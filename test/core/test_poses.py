# SPDX-License-Identifier: Apache-2.0
"""R5: poses, the plan of a move to one, and its whole-or-nothing start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rig import Rig, board_config, joint, with_a_slide

from control_board_ros.core.goals.pose import Pose
from control_board_ros.core.goals.pose_moves import (
    made_pose,
    move_to_pose,
    plan_move,
    pose_now,
    start_parking,
)
from control_board_ros.core.goals.tasks import MoveTask, Outcome
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.reply import Reason

READY = Pose("ready", ("a", "b", "c"), (0.5, -1.0, 0.01), 0.4)


@pytest.fixture
def rig() -> Rig:
    return with_a_slide()


def arrivals(rig: Rig, task: MoveTask) -> tuple[Outcome, np.ndarray]:
    """How a task ends, and in which cycle each joint's profile ended."""
    ends = np.full(rig.board.count, -1)
    for cycle in range(10_000):
        rig.tick()
        done = np.array(rig.board.check_motion_done())
        ends[done & (ends < 0)] = cycle
        outcome = task.outcome()
        if outcome is not None:
            return outcome, ends
    raise AssertionError("it does not end")


@pytest.mark.parametrize(("speed", "mean"), [(0.0, 0.4), (0.25, 0.25)])
def test_all_joints_arrive_together_at_the_mean_speed_of_the_slowest(
    rig: Rig, speed: float, mean: float
) -> None:
    """R5, P1: T = |Δ|/v of the joint with the longest way; the speed requested, or the pose's."""
    task = move_to_pose(rig.board, READY, speed)
    assert task.remaining_time() == pytest.approx(1.0 / mean)
    assert task.feedback()["remaining"] == pytest.approx(READY.positions)
    outcome, ends = arrivals(rig, task)
    assert outcome == (True, "")
    assert ends.tolist() == [round(1.0 / mean / rig.board.period) - 1] * 3
    assert rig.board.get_target_position().tolist() == list(READY.positions)
    assert np.abs(task.feedback()["remaining"]).max() < 0.01


def test_without_a_speed_the_slowest_reference_speed_counts(rig: Rig) -> None:
    """P2: the joint that takes longest at its own speed sets the time."""
    rig.board.set_ref_speed(None, [0.1, 1.0, 0.01])
    plan = plan_move(rig.board, Pose("p", READY.joints, READY.positions))
    assert plan.time == pytest.approx(0.5 / 0.1)
    assert not plan.note


def test_a_speed_beyond_the_limits_is_bounded_and_reported(rig: Rig) -> None:
    """P1: what will be done in place of what was requested."""
    task = move_to_pose(rig.board, READY, 50.0)
    outcome, ends = arrivals(rig, task)
    assert outcome.success
    assert outcome.message.startswith("b: 0.625 s at a mean speed of ")  # 1.875/3
    assert "by its limits of speed and acceleration" in outcome.message
    assert len(set(ends.tolist())) == 1


def speeds_within(rig: Rig, task: MoveTask) -> float:
    """Let it end; the greatest step of any velocity reference, rad/s, in a cycle."""
    last, worst = rig.board.snapshot().velocity_reference.copy(), 0.0
    while task.outcome() is None:
        rig.tick()
        now = rig.board.snapshot().velocity_reference
        worst = max(worst, float(np.abs(now - last).max()))
        last = now.copy()
    return worst


@pytest.mark.parametrize("part", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("back", [(0.0, 0.0, 0.0), (0.55, -2.0, 0.0), (0.45, -0.9, 0.02)])
def test_joints_in_motion_arrive_together_too(
    rig: Rig, part: float, back: tuple[float, ...]
) -> None:
    """R5, P1: a pose requested on the way to another one: no jump, one end, within the limits."""
    first = move_to_pose(rig.board, READY)
    rig.run(part * first.remaining_time())
    task = move_to_pose(rig.board, Pose("back", READY.joints, back), 0.5)
    worst = speeds_within(rig, task)
    assert worst <= 1.001 * 20.0 * rig.board.period  # rad/s² of the limits
    assert rig.board.get_encoder() == pytest.approx(back, abs=0.01)
    over = first.outcome()
    assert over is not None
    assert "another move" in over.message
    again = move_to_pose(rig.board, READY)
    rig.run(part * again.remaining_time())
    outcome, ends = arrivals(rig, move_to_pose(rig.board, Pose("back", READY.joints, back), 0.5))
    assert outcome.success
    assert len(set(ends.tolist())) == 1


def test_joints_in_another_mode_refuse_a_pose_whole_and_are_all_named(rig: Rig) -> None:
    """R5, M2: nothing moves or switches; each joint, its mode, and the next step."""
    board = rig.board
    board.set_control_mode("b", "vel")
    board.set_control_mode("c", "idl")
    before = board.snapshot().position_reference
    with pytest.raises(RequestError) as caught:
        move_to_pose(board, READY)
    assert str(caught.value) == (
        "ready is a POSITION move, and b is in VELOCITY, c is in IDLE; "
        "its joints must be in pos or mix"
    )
    assert caught.value.codes == (Reason.TOGETHER, Reason.OTHER_MODE, Reason.OTHER_MODE)
    rig.run(0.5)
    assert board.snapshot().position_reference == pytest.approx(before, abs=1e-9)
    assert [mode.code for mode in board.get_control_mode()] == ["pos", "vel", "idl"]
    assert board.rejected_commands.tolist() == [0, 1, 1]


def test_more_joints_than_a_summary_names_are_all_named() -> None:
    """R5: five joints in another mode."""
    names = tuple("abcde")
    rig = Rig(board_config(*map(joint, names)))
    rig.tick()
    with pytest.raises(RequestError) as caught:
        move_to_pose(rig.board, Pose("far", names, (0.1,) * 5, 0.4))
    assert str(caught.value) == (
        "far is a POSITION move, and a, b, c, d, e are in IDLE; its joints must be in pos or mix"
    )
    assert caught.value.codes == (Reason.OTHER_MODE,) * 5


def test_a_pose_refused_for_another_reason_gives_it(rig: Rig) -> None:
    """R5, P13."""
    with pytest.raises(RequestError, match="a ignored: nan is not a finite number") as caught:
        move_to_pose(rig.board, Pose("odd", ("a", "b"), (float("nan"), 0.1), 0.4))
    assert caught.value.codes == (Reason.NOT_FINITE, Reason.TOGETHER)


def test_a_joint_in_fault_is_reported_with_its_cause(rig: Rig) -> None:
    """R5, F5."""
    rig.plant.inject("a", "external")
    rig.tick(2)
    with pytest.raises(RequestError, match=r"a is in HW_FAULT \(.*external") as caught:
        move_to_pose(rig.board, READY)
    assert caught.value.codes[0] is Reason.IN_FAULT


def test_joints_outside_a_pose_are_unaffected(rig: Rig) -> None:
    """R5: it concerns its joints only."""
    rig.board.set_control_mode("b", "torq")
    task = move_to_pose(rig.board, Pose("one", ("a",), (0.3,), 1.0))
    assert arrivals(rig, task)[0].success
    assert rig.board.get_control_mode("b")[0].code == "torq"


def test_mixed_accepts_a_pose(rig: Rig) -> None:
    """M3: MIXED takes position moves."""
    rig.board.set_control_mode(None, "mix")
    assert arrivals(rig, move_to_pose(rig.board, READY))[0] == (True, "")


def test_cancelling_stops_the_joints(rig: Rig) -> None:
    """As a move."""
    task = move_to_pose(rig.board, READY)
    rig.run(0.5)
    assert task.cancel().startswith("cancelled; a, b, c stopped")
    rig.run(3.0)
    assert abs(rig.board.get_encoder("b")[0]) < 0.9


def test_parking_switches_powered_joints(rig: Rig) -> None:
    """R6, M2: to POSITION; the move is that to any pose."""
    rig.board.set_control_mode("b", "vel")
    task = start_parking(rig.board, READY)
    assert [mode.code for mode in rig.board.get_control_mode()] == ["pos"] * 3
    assert arrivals(rig, task)[0] == (True, "")


@pytest.mark.parametrize("speed", [-0.1, 5e-324, float("nan"), float("inf")])
def test_an_invalid_speed_is_refused(rig: Rig, speed: float) -> None:
    with pytest.raises(RequestError, match=r"speed .* is not valid; 1e-06 or more"):
        move_to_pose(rig.board, READY, speed)
    assert rig.board.check_motion_done() == [True] * 3


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"name": ""}, "is no name"),
    ({"name": "a b"}, "is no name"),
    ({"name": "x" * 65}, "is no name"),
    ({"joints": ["nobody"]}, "'nobody' unknown"),
    ({"joints": ["a", "a"]}, "twice"),
    ({"positions": [0.1]}, "1 position for 3 joints"),
    (
        {"positions": [0.1, 2.1, 0.0]},
        r"b at 120\.3° \(2\.1 rad\) is outside its limits, -114\.6° to 114\.6°",
    ),
    ({"positions": [0.1, float("nan"), 0.0]}, r"b at - \(nan rad\) is outside"),
    ({"speed": -1.0}, "speed -1 is not valid"),
]


@pytest.mark.parametrize(("change", "text"), WRONG)
def test_a_wrong_pose_is_refused(rig: Rig, change: dict[str, Any], text: str) -> None:
    """One line: what, and what is allowed."""
    good: dict[str, Any] = {"name": "p", "joints": [], "positions": [0.0, 0.0, 0.0], "speed": 0.0}
    assert made_pose(rig.board, **good) == Pose("p", ("a", "b", "c"), (0.0, 0.0, 0.0))
    with pytest.raises(RequestError, match=text):
        made_pose(rig.board, **(good | change))


def test_the_present_pose_is_the_measured_one(rig: Rig) -> None:
    """One that is farther beyond a limit than a joint held there is no pose."""
    arrivals(rig, move_to_pose(rig.board, READY))
    assert pose_now(rig.board, "p", ["b", "a"]).joints == ("b", "a")
    assert pose_now(rig.board, "p", ["b", "a"]).speed == 0.0  # as the joints are configured
    assert pose_now(rig.board, "p", []).positions == pytest.approx(READY.positions, abs=0.01)
    rig.board.state.measured[0, 0] = 2.02
    with pytest.raises(RequestError, match="outside its limits"):
        pose_now(rig.board, "p", ["a"])


def test_the_part_of_a_pose() -> None:
    """R1: of a board that has some of its joints."""
    assert READY.of({"c", "a"}) == Pose("ready", ("a", "c"), (0.5, 0.01), 0.4)
    assert READY.of({"elsewhere"}) is None

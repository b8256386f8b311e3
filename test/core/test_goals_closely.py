# SPDX-License-Identifier: Apache-2.0
"""Goals with a duration, looked at closely: moves, poses, calibrations, paths, trajectories.

The boards here drive a plant that is at rest at 0 by default, so that references
and times are exact (SPEC T1 to T3, P3, R5, K1).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from following import Following
from rig import Held, Rig, board_config, held, joint, ready

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import Calibration, joined
from control_board_ros.core.config.parts import Constraints
from control_board_ros.core.goals.path import (
    Path,
    Points,
    Wish,
    braking,
    make_path,
)
from control_board_ros.core.goals.pose import Pose
from control_board_ros.core.goals.pose_moves import made_pose, plan_move, pose_now
from control_board_ros.core.goals.tasks import CalibrationTask, MoveTask, Outcome
from control_board_ros.core.goals.trajectory_goal import Code, TrajectoryGoal, configured
from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.terms.vocabs import ControlMode

NAMES = ("a", "b", "c")
PERIOD = 0.002
#: rad/s², of the joints that brake.
BRAKE = 20.0


def path(joints: str, *points: tuple[float, ...]) -> Path:
    """The same for all joints: (time, position) or with velocity and acceleration as well."""
    count = len(joints)
    fields = [
        [[p[k]] * count if k < len(p) else [] for p in points]  # an empty row: not given
        for k in (1, 2, 3)
    ]
    return make_path(tuple(joints), [p[0] for p in points], *fields)


class Bench(Following):
    """Joints a, b, c at rest, with a follower."""

    def __init__(self) -> None:
        super().__init__((still := held(*(joint(name) for name in NAMES))).config, still.plant)

    def follow(self, joints: str, *points: tuple[float, ...], ahead: float = 0.0) -> Any:
        """A new path for joints, that begins some time from now."""
        made = path(joints, *points)
        return self.follower.follow(list(joints), made, self.board.time + ahead)

    def start(self, joints: str, *points: tuple[float, ...], **how: Any) -> TrajectoryGoal:
        """A new goal for joints, as :meth:`send`."""
        made = path(joints, *points)
        none: list[list[float]] = [[]] * len(points)
        given = Points(
            made.times.tolist(),
            made.positions.tolist(),
            none if made.velocities is None else made.velocities.tolist(),
            none,
        )
        return self.send(given, list(joints), **how)

    def measured(self, name: str, position: float) -> None:
        """From now on a joint is measured there, at rest."""
        self.plant.values[Row.POSITION, NAMES.index(name)] = position


@pytest.fixture
def bench() -> Bench:
    return Bench()


# --- following paths -----------------------------------------------------------------------------


def test_a_newer_path_takes_over_without_a_log_entry(bench: Bench) -> None:
    """T1: a replacement is what the user asked for; only other ends are logged."""
    bench.follow("ab", (1.0, 0.1))
    bench.cycle(10)
    bench.follow("a", (0.1, 0.05))
    assert bench.cycle(60)[0] == pytest.approx(0.05)
    assert bench.events() == []


def test_a_path_that_overflows_ends_with_its_first_refusal(bench: Bench) -> None:
    """P13: its reference is no number; one refusal is counted, and the log has the reason."""
    points = np.array([[1e308]])
    with np.errstate(over="ignore", invalid="ignore"):
        bench.follower.follow(["a"], Path(np.ones(1), points, 0.0 * points), bench.board.time)
        assert bench.cycle(5).tolist() == [0.0, 0.0, 0.0]
    assert bench.board.rejected_commands.tolist() == [1, 0, 0]
    assert not bench.follower.busy
    (text,) = [text for text in bench.events() if text.startswith("trajectory of a ended: ")]
    assert "nan" in text


def test_a_direct_position_before_a_path_does_not_end_it(bench: Bench) -> None:
    """M4, T2: what came before a path is not what takes over from it."""
    assert bench.board.set_position("a", 0.05)
    assert bench.follow("a", (0.1, 0.1))
    assert bench.cycle(60)[0] == pytest.approx(0.1)
    assert bench.events() == []


def test_a_direct_position_ends_the_old_path_also_before_a_new_one_waits(bench: Bench) -> None:
    """T2, M4: 0.07 rad, sent between two cycles, stays until the new path begins."""
    bench.follow("a", (1.0, 0.5))
    bench.cycle(50)
    assert bench.board.set_position("a", 0.07)
    bench.follow("a", (0.1, 0.0), ahead=0.2)
    assert bench.cycle(50)[0] == 0.07
    assert bench.events() == ["trajectory of a ended: replaced by another direct position"]
    assert bench.cycle(150)[0] == pytest.approx(0.0)


def test_two_paths_between_two_cycles_are_both_followed_in_turn(bench: Bench) -> None:
    """T1: the first begins now, 0.5 rad/s, and lasts until the second begins 0.1 s later."""
    bench.follow("a", (1.0, 0.5))
    bench.follow("a", (0.1, 0.0), ahead=0.1)
    assert bench.cycle(40)[0] == pytest.approx(0.5 * 40 * PERIOD)
    assert bench.cycle(100)[0] == pytest.approx(0.0)


def test_a_path_begins_in_the_very_cycle_of_its_start(bench: Bench) -> None:
    """T1: with a first point at 0 s, this cycle sends it, and the one before does not."""
    start = bench.plant.read().time + 10 * PERIOD  # of the eleventh cycle from now
    assert bench.follower.follow("a", path("a", (0.0, 0.02), (0.2, 0.1)), start)
    assert bench.cycle(10)[0] == 0.0
    assert bench.cycle()[0] == pytest.approx(0.02)


def test_a_fault_within_a_cycle_removes_one_joint_from_a_path(bench: Bench) -> None:
    """T2, M4: b goes on to its end, and nothing that is sent for a is counted as ignored."""
    bench.follow("ab", (0.2, 0.1))
    bench.cycle(20)
    bench.plant.values[Row.CURRENT, 0] = 1e3
    bench.cycle(2)
    bench.plant.values[Row.CURRENT, 0] = 0.0
    assert bench.board.get_control_mode("a") == [ControlMode.HW_FAULT]
    assert bench.cycle(100)[1] == pytest.approx(0.1)
    assert bench.board.rejected_commands.tolist() == [0, 0, 0]


def test_an_acceleration_carries_over_to_the_next_path(bench: Bench) -> None:
    """T1: at 0.25 of a quintic over 0.4 rad in 1 s it is 2.25 rad/s², and no step follows."""
    quintic = (1.0, 0.4, 0.0, 0.0)
    bench.follow("a", quintic)
    rows = [bench.cycle()[0] for _ in range(125)]
    bench.follow("a", quintic)
    rows += [bench.cycle()[0] for _ in range(20)]
    bends = np.diff(rows, n=2)[110:] / PERIOD**2
    assert bends[:10] == pytest.approx(2.25, abs=0.1)
    assert np.abs(np.diff(bends)).max() < 0.1


def test_holding_ends_the_velocity_of_a_path_at_once(bench: Bench) -> None:
    """P3: 0.5 rad/s before, 0 in the next cycle, and the position stays."""
    bench.follow("a", (1.0, 0.5))
    here = bench.cycle(50)[0]
    assert bench.board.state.velocity_reference[0] == pytest.approx(0.5)
    bench.follower.hold("a", "a trajectory without points came")
    assert bench.cycle()[0] == here
    assert bench.board.state.velocity_reference[0] == pytest.approx(0.0, abs=1e-9)
    assert bench.events() == ["trajectory of a ended: a trajectory without points came"]


def test_holding_does_not_affect_joints_without_a_path(bench: Bench) -> None:
    """M4: b in POSITION is sent nothing that it would have to ignore, while a is held."""
    assert bench.board.set_control_mode("b", "pos")
    bench.follow("a", (1.0, 0.1))
    bench.cycle(10)
    bench.follower.hold(None, "a trajectory without points came")
    assert bench.board.rejected_commands.tolist() == [0, 0, 0]


# --- paths ---------------------------------------------------------------------------------------


def test_braking_at_rest_is_one_point() -> None:
    """The path of a joint that does not move: there, at once."""
    made = braking(0.5, 0.0, 2.0)
    assert (made.times.tolist(), made.positions.tolist()) == ([0.0], [[0.5]])
    assert made.duration == 0.0


# --- poses ---------------------------------------------------------------------------------------


def at_rest_at(position: float) -> Rig:
    """A rig of one joint ``a`` in POSITION, held at a position."""
    config = board_config(joint("a"))
    plant = Held(config)
    plant.values[Row.POSITION] = position
    rig = ready(config, plant)
    assert rig.board.set_control_mode("a", "pos")
    rig.tick()
    return rig


def test_the_way_to_a_pose_is_from_where_the_joint_is() -> None:
    """R5, P1: 0.2 rad from 0.5 to 0.7, at 20 rad/s² no faster than 47.8°/s on the mean."""
    rig = at_rest_at(0.5)
    assert rig.board.state.position_reference[0] == 0.5
    time, note = plan_move(rig.board, Pose("p", ("a",), (0.7,)), 3.0)
    assert time == pytest.approx(0.24, abs=0.001)
    assert note.startswith("a: 0.24 s at a mean speed of 47.")
    assert "(171.9°/s was requested)" in note


@pytest.mark.parametrize(("shown", "taken"), [(-2.005, -2.0), (2.005, 2.0), (-1.995, -1.995)])
def test_a_joint_at_either_limit_is_within(shown: float, taken: float) -> None:
    """R5: a reading of 5 mrad beyond a limit is the limit."""
    assert pose_now(at_rest_at(shown).board, "p", ["a"]).positions == (taken,)


def test_a_pose_has_no_negative_zero() -> None:
    """It is shown to people and written to files: 0.0, not -0.0."""
    assert repr(made_pose(at_rest_at(0.0).board, "p", ["a"], [-0.0], 0.0).positions) == "(0.0,)"


# --- calibrations --------------------------------------------------------------------------------

QUICK = Calibration(type=3, required=False, start=0.05, speed=1.0)


def test_the_reason_of_a_failed_calibration_is_reported_after_the_fault() -> None:
    """K4: that of its fault, then the text of its status, not the phase "failed"."""
    rig = Rig(board_config(joint("a", calibration=QUICK)))
    rig.tick(2)
    task = CalibrationTask(rig.board, "a")
    rig.tick(5)
    rig.plant.inject("a", "external")
    rig.tick(5)
    cause = rig.board.get_faults("a")[0].text
    failed = Outcome(False, f"a is not calibrated: {cause}")
    assert task.outcome() == failed
    rig.plant.clear_injected()
    rig.tick(2)
    assert rig.board.set_control_mode("a", "fidl")
    rig.tick()
    assert not rig.board.get_faults("a")[0].active
    assert task.outcome() == failed


# --- moves ---------------------------------------------------------------------------------------


@pytest.fixture
def still() -> Rig:
    """Joints a, b, c in POSITION that rest whatever their references are."""
    rig = held(*(joint(name) for name in NAMES))
    assert rig.board.set_control_mode(None, "pos")
    rig.tick()
    return rig


def reference(rig: Rig, name: str) -> float:
    return float(rig.board.state.position_reference[NAMES.index(name)])


def test_where_one_joint_leaves_the_others_of_the_move_stop(still: Rig) -> None:
    """P3: a leaves for VELOCITY, b is stopped, and held where it is, not at 1 rad."""
    move = MoveTask(still.board, ["a", "b"], [1.0, 1.0], [0.5, 0.5])
    still.run(0.5)
    assert still.board.set_control_mode("a", "vel")
    outcome = move.outcome()
    assert outcome == (False, "a left for VELOCITY during the move; the other joints stopped")
    still.run(1.7)
    assert reference(still, "b") == 0.0


def test_a_move_that_another_one_replaced_has_failed(still: Rig) -> None:
    """P1: with both targets in its message."""
    move = MoveTask(still.board, ["a"], [-1.0], [0.5])
    still.run(0.1)
    assert still.board.position_move("a", 0.5)
    assert move.outcome() == (False, "another move commands a to 28.6° instead of -57.3°")


def test_a_move_is_under_way_until_its_slowest_joint_is_there(still: Rig) -> None:
    """P3: a is at its target at once; 2 s later b still moves."""
    move = MoveTask(still.board, ["a", "b"], [0.0, 1.5], [0.5, 0.5])
    for _ in range(20):
        still.run(0.1)
        assert move.outcome() is None
    assert still.board.check_motion_done(["a", "b"]) == [True, False]


def test_no_time_remains_of_a_move_whose_profiles_have_ended(still: Rig) -> None:
    """0.4 s at its start, 0 s after 0.4 s."""
    move = MoveTask(still.board, ["a"], [0.2], [0.5])
    assert move.remaining_time() == pytest.approx(0.4)
    still.run(0.4)
    assert move.remaining_time() == 0.0


def test_a_target_that_is_sent_again_begins_the_second_anew(still: Rig) -> None:
    """P3: no outcome for 1 s after the profile has ended, then that it is away.

    The same target, again on its way: the time to arrive is counted from the later end.
    """
    move = MoveTask(still.board, ["a"], [0.2], [0.5])
    still.run(0.4)
    assert move.outcome() is None
    still.run(0.9)
    for mode in ("comp", "stif"):  # the reference is then at 0, where the joint is
        assert still.board.set_interaction_mode("a", mode)
    assert still.board.position_move("a", 0.2, 0.5)
    still.run(0.2)
    assert move.outcome() is None
    still.run(0.2)
    assert move.outcome() is None
    still.run(0.99)
    assert move.outcome() is None
    still.run(0.01)
    outcome = move.outcome()
    assert outcome is not None
    assert not outcome.success
    assert outcome.message.startswith("a is at 0.0°, 11.5° away from its target 11.5°")


def test_a_joint_that_still_may_arrive_is_not_blamed_for_another(still: Rig) -> None:
    """P3: b was stopped; c, whose profile has just ended, is no part of the message.

    Then a is stopped as well, and held where it is, not at 1 rad.
    """
    move = MoveTask(still.board, NAMES, [1.0, 1.0, 0.05], [0.4, 0.4, 0.5])
    still.run(0.5)
    still.board.stop("b")
    still.run(0.5)
    assert still.board.check_motion_done() == [False, True, True]
    assert move.outcome() == (
        False,
        "b is at 0.0°, not at its target 57.3°: it was stopped during the move; send it again",
    )
    still.run(1.7)
    assert reference(still, "a") == 0.0


def test_one_of_two_that_arrives_is_no_success(still: Rig) -> None:
    """P3: a is there, b is blocked; the message is about b alone, without the remark."""
    move = MoveTask(still.board, ["a", "b"], [0.0, 0.2], time=0.4, note="as fast as it may")
    while (outcome := move.outcome()) is None:
        still.tick(10)
    assert not outcome.success
    assert outcome.message.startswith("b is at 0.0°, 11.5° away from its target 11.5°: ")


# --- trajectories with tolerances ----------------------------------------------------------------


def test_of_several_parts_the_shortest_goal_time_counts() -> None:
    """T1, R3: 0.5 s of the leg, not 2 s of the arm; 0 of the head is no end at all."""
    times = {"arm": 2.0, "leg": 0.5, "head": 0.0}
    board = Board(
        joined(
            {
                name: board_config(joint(f"{name}_a"), constraints=Constraints(goal_time=time))
                for name, time in times.items()
            }
        )
    )
    for joints, expected in ((None, 0.5), (["arm_a", "head_a"], 2.0), (["head_a"], 0.0)):
        assert configured(board, board.selector.select(joints)).goal_time == expected


def test_the_desired_values_of_a_goal_are_its_path_with_accelerations(bench: Bench) -> None:
    """Feedback: at rest while it waits; a quarter on its way to 0.4 rad: 0.9 rad/s, 1.2 rad/s²."""
    goal = bench.start("b", (0.0, 0.0, 0.0), (1.0, 0.4, 0.0), ahead=0.1)
    waiting = goal.desired()
    assert [row.tolist() for row in waiting] == [[0.0, 0.0, 0.0]] * 3
    bench.cycle(50 + 125)
    assert goal.elapsed == pytest.approx(0.25, abs=1.5 * PERIOD)
    s = goal.elapsed
    desired = goal.desired()
    np.testing.assert_allclose(desired.positions, [0.0, 0.4 * s**2 * (3 - 2 * s), 0.0], atol=1e-9)
    np.testing.assert_allclose(desired.velocities, [0.0, 2.4 * s * (1 - s), 0.0], atol=1e-9)
    np.testing.assert_allclose(desired.accelerations, [0.0, 2.4 * (1 - 2 * s), 0.0], atol=1e-9)


def test_a_joint_at_the_speed_of_its_path_is_within_a_velocity_tolerance(bench: Bench) -> None:
    """T2: 0.25 rad/s desired and measured is an error of 0, within 0.3 rad/s."""
    goal = bench.start("a", (4.0, 1.0), path=[Wish("a", 0.0, 0.3)])
    bench.cycle()
    bench.plant.values[Row.VELOCITY, 0] = 0.25
    bench.cycle(5)
    assert goal.outcome is None
    bench.plant.values[Row.VELOCITY, 0] = -0.25
    bench.cycle(2)
    assert goal.outcome is not None
    assert goal.outcome.code is Code.PATH_TOLERANCE_VIOLATED
    assert "a is 0.5 rad/s away from the velocity it should have" in goal.outcome.text


def test_after_the_last_point_the_tolerance_of_the_way_no_longer_counts(bench: Bench) -> None:
    """T2: 0.03 rad away on the way, within 0.05; 0.06 rad away afterwards, it may still arrive."""
    goal = bench.start("a", (0.1, 0.03), path=[Wish("a", 0.05, 0.0)], goal=[Wish("a", 0.01, 0.0)])
    bench.cycle(60)
    assert goal.elapsed > 0.1
    bench.measured("a", -0.03)
    bench.cycle(50)
    assert goal.outcome is None
    for position in (0.0, 0.03):
        bench.measured("a", position)
        bench.cycle(2)
    assert goal.outcome == (Code.SUCCESSFUL, "goal reached")


def test_only_joints_beyond_their_tolerance_stop_where_they_are(bench: Bench) -> None:
    """T2: b at its measured 0; a, which has no tolerance, ahead at its reference, v²/2a on."""
    goal = bench.start("ab", (4.0, 1.0), path=[Wish("b", 0.05, 0.0)])
    while goal.outcome is None:
        bench.cycle()
    assert goal.outcome.code is Code.PATH_TOLERANCE_VIOLATED
    a, b, _ = bench.cycle(50)
    assert a == pytest.approx(0.05 + 0.25**2 / (2 * BRAKE), abs=1e-3)
    assert b == pytest.approx(0.0, abs=1e-9)


def test_a_goal_without_joints_leaves_the_other_path_running(bench: Bench) -> None:
    """T2: the goal has ended; the newer path is followed to its 0.1 rad, not braked."""
    goal = bench.start("a", (4.0, 1.0))
    bench.cycle(50)
    bench.follow("a", (0.5, 0.1))
    assert bench.cycle(260)[0] == pytest.approx(0.1)
    assert goal.outcome == (
        Code.INVALID_GOAL,
        "ended before its time; a: replaced by another trajectory",
    )


# --- groups --------------------------------------------------------------------------------------


def test_the_versions_of_a_part_grow_with_any_of_its_joints() -> None:
    """R3: with the mode of one joint, and with its fault record; not with those of other parts."""
    config = joined({n: board_config(joint(f"{n}_a"), joint(f"{n}_b")) for n in ("arm", "leg")})
    rig = ready(config, Held(config))

    def versions(part: str) -> tuple[int, int]:
        group = rig.board.parts[part]
        return group.modes_version, group.faults_version

    leg = versions("leg")
    for k, name in enumerate(("arm_a", "arm_b")):
        for mode in ("pos", "vel", "pos"):
            modes, faults = versions("arm")
            assert rig.board.set_control_mode(name, mode)
            assert versions("arm") > (modes, faults)
            assert versions("arm")[1] == faults
        rig.plant.values[Row.CURRENT, k] = 1e3
        rig.tick()
        assert versions("arm")[1] > faults
    assert versions("leg") == leg

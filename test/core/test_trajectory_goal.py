# SPDX-License-Identifier: Apache-2.0
"""Trajectories with tolerances, in simulated time (SPEC T1 to T3).

What is expected is what ros2_controllers expects of its joint_trajectory_controller
(test_trajectory_actions.cpp), on a board's plant instead of mirrored commands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from following import Following
from rig import board_config, joint, simulation_config

from control_board_ros.core.config.parts import Constraints, JointConstraints
from control_board_ros.core.goals.path import Wish, make_path
from control_board_ros.core.goals.trajectory_goal import Code, GoalError, Points
from control_board_ros.core.terms.arguments import Array
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.sim.plant import SimulatedPlant

NAMES = ("a", "b")
#: rad/s², of the joints.
BRAKE = 2.0


class Goals(Following):
    """A board that follows goals, used as in the node."""

    def __init__(self, own: JointConstraints | None = None, **board: Any) -> None:
        joints = [
            replace(
                joint(n, limits={"acceleration": BRAKE}), constraints=own or JointConstraints()
            )
            for n in NAMES
        ]
        super().__init__(board_config(*joints, **board))
        self.blocked: list[str] = []

    def cycle(self, count: int = 1) -> Array:
        for name in self.blocked:
            q, rate = self.board.get_encoder(name)[0], self.board.get_encoder_speed(name)[0]
            self.plant.push(name, -1e4 * q - 60.0 * rate)
        return super().cycle(count)

    def cycles(self, seconds: float) -> np.ndarray:
        """Some time; position references of every cycle, shape (cycles, n)."""
        rows = []
        for _ in range(round(seconds / self.period)):
            self.cycle()
            rows.append(self.board.snapshot().position_reference.copy())
        return np.array(rows)

    def end(self, within: float = 5.0) -> tuple[Code, str]:
        """How the goal ends."""
        assert self.goal is not None
        for _ in range(round(within / self.period)):
            if self.goal.outcome is not None:
                return self.goal.outcome
            self.cycle()
        raise AssertionError(f"no outcome within {within} s")

    def block(self, name: str) -> None:
        """From now on a stiff spring holds a joint at 0."""
        self.blocked.append(name)

    def free(self) -> None:
        for name in self.blocked:
            self.plant.push(name, 0.0)
        self.blocked.clear()


@pytest.fixture
def rig() -> Goals:
    return Goals()


def points(*rows: tuple[float, list[float]], velocities: Any = None) -> Points:
    none: list[list[float]] = [[]] * len(rows)
    return Points([t for t, _ in rows], [list(q) for _, q in rows], velocities or none, none)


ONE = points((0.5, [0.2, -0.1]))
SLOW = points((4.0, [1.0, 1.0]))


def test_a_single_point_is_reached(rig: Goals) -> None:
    """test_success_single_point_sendgoal: it succeeds, and the last command stays."""
    rig.send(ONE)
    code, text = rig.end()
    assert (code, text) == (Code.SUCCESSFUL, "goal reached")
    assert rig.board.time < 1.5
    np.testing.assert_allclose(rig.cycles(0.2)[-1], [0.2, -0.1])
    np.testing.assert_allclose(rig.board.get_encoder(), [0.2, -0.1], atol=0.01)
    assert not rig.follower.busy


def test_a_point_at_time_zero_is_a_step(rig: Goals) -> None:
    """The command is the point at once; the joint gets there as fast as it may."""
    rig.send(points((0.0, [0.2, 0.2])))
    assert rig.cycles(2 * rig.period)[-1] == pytest.approx([0.2, 0.2])
    assert rig.end()[0] is Code.SUCCESSFUL


def test_arrived_is_at_rest(rig: Goals) -> None:
    """stopped_velocity_tolerance: success waits until the joint has stopped."""
    rig.send(points((0.0, [0.2, 0.2])))
    rig.end()
    assert np.abs(rig.board.get_encoder_speed()).max() <= 0.01
    rig = Goals(constraints=Constraints(stopped_velocity_tolerance=0.0))
    rig.send(points((0.0, [0.2, 0.2])))
    rig.end()
    assert np.abs(rig.board.get_encoder() - 0.2).min() > 0.1


def test_the_other_joints_of_a_partial_goal_stay(rig: Goals) -> None:
    """T1: partial joints; in another order than the board's; and only if they are allowed."""
    rig.send(points((0.3, [0.1])), ["b"])
    assert rig.end()[0] is Code.SUCCESSFUL
    np.testing.assert_allclose(rig.cycles(0.1)[-1], [0.0, 0.1])
    rig.send(points((0.3, [0.2, -0.2])), ["b", "a"])
    assert rig.end()[0] is Code.SUCCESSFUL
    np.testing.assert_allclose(rig.cycles(0.1)[-1], [-0.2, 0.2])
    whole = Goals(allow_partial_joints_goal=False)
    with pytest.raises(GoalError, match="a missing; send all joints") as refused:
        whole.send(points((0.3, [0.1])), ["b"])
    assert refused.value.code is Code.INVALID_JOINTS


def test_a_stamp_ahead_waits_and_one_behind_is_joined(rig: Goals) -> None:
    """T1: the goal is judged from its start on; what is over is refused."""
    goal = rig.send(ONE, ahead=0.3, path=[Wish("a", 0.05, 0.0)])
    np.testing.assert_array_equal(rig.cycles(0.29), 0.0)
    assert goal.elapsed < 0.0
    assert rig.end()[0] is Code.SUCCESSFUL
    goal = rig.send(points((0.5, [9.0, 9.0]), (1.0, [0.1, 0.1])), ahead=-0.6)
    assert rig.end()[0] is Code.SUCCESSFUL
    assert goal.elapsed < 2.0
    with pytest.raises(GoalError, match=r"was due 0\.5 s ago") as refused:
        rig.send(ONE, ahead=-1.0)
    assert refused.value.code is Code.OLD_HEADER_TIMESTAMP


def test_a_new_goal_preempts_without_a_step(rig: Goals) -> None:
    """preempted_goal_receives_aborted_result: INVALID_GOAL; joints not in the new one stop."""
    first = rig.send(SLOW)
    before = rig.cycles(0.5)[-1]
    rig.send(points((1.0, [0.1])), ["a"])
    assert first.outcome == (Code.INVALID_GOAL, "preempted by a new goal")
    after = rig.cycles(1.0)
    steps = np.abs(np.diff(np.vstack([before, after]), axis=0)).max(axis=0)
    assert (steps <= 0.26 * rig.period).all()
    assert rig.end()[0] is Code.SUCCESSFUL
    stop = before[1] + 0.25**2 / (2 * BRAKE)
    assert after[-1] == pytest.approx([0.1, stop], abs=1e-3)


def test_a_preempted_goal_continues_until_the_new_one_begins(rig: Goals) -> None:
    """T1, trajectory replacement: the old points count until the new start, not longer."""
    rig.send(SLOW)
    rig.cycles(0.5)
    rig.send(points((0.5, [0.0, 0.0])), ahead=0.4)
    moved = rig.cycles(0.39)
    assert moved[-1] == pytest.approx([0.89 / 4, 0.89 / 4], abs=2e-3)
    assert rig.end()[0] is Code.SUCCESSFUL
    assert rig.cycles(0.1)[-1] == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize("twice", [False, True])
def test_cancelling_a_waiting_goal_stops_the_preempted_one(rig: Goals, twice: bool) -> None:
    """T2, T3: the only goal left is cancelled, so nothing moves on; nor is anything kept."""
    rig.send(SLOW)
    before = rig.cycles(0.5)[-1]
    goal = rig.send(ONE, ahead=3.0)
    if twice:
        goal = rig.send(ONE, ahead=2.0)
    goal.cancel()
    after = rig.cycles(1.0)[-1]
    assert after == pytest.approx(before + 0.25**2 / (2 * BRAKE), abs=1e-3)
    assert not rig.follower.busy


def test_a_preempted_goal_ends_where_the_new_one_is_far_ahead(rig: Goals) -> None:
    """T3: it is followed to its last point, and no longer."""
    rig.send(ONE)
    rig.cycles(0.1)
    goal = rig.send(SLOW, ahead=9.0)
    assert rig.cycles(0.6)[-1] == pytest.approx([0.2, -0.1])
    rig.follower.leave(goal._run)
    assert not rig.follower.busy


def test_refused_goals_do_not_affect_the_running_goal(rig: Goals) -> None:
    """T1: only a goal that is right preempts."""
    goal = rig.send(ONE)
    rig.cycles(0.1)
    for bad in (points((0.5, [1.0])), points(), points((0.2, [0.0] * 2), (0.2, [0.0] * 2))):
        with pytest.raises(GoalError) as refused:
            rig.send(bad)
        assert refused.value.code is Code.INVALID_GOAL
    with pytest.raises(GoalError, match="elbow") as refused:
        rig.send(ONE, ["a", "elbow"])
    assert refused.value.code is Code.INVALID_JOINTS
    with pytest.raises(GoalError, match="ends at rest"):
        rig.send(points((0.5, [0.1, 0.1]), velocities=[[0.1, 0.0]]))
    assert rig.goal is goal
    assert rig.end()[0] is Code.SUCCESSFUL


def test_joints_in_another_mode_are_named_with_the_way_out(rig: Goals) -> None:
    """T2, M2, M4: only the user switches modes; it counts, once, and nothing moves."""
    rig.request("set_control_mode", "b", "pos")
    with pytest.raises(
        GoalError, match="for b ignored: mode is POSITION; it is accepted in posd"
    ) as refused:
        rig.send(ONE)
    assert refused.value.code is Code.INVALID_GOAL
    assert not rig.follower.busy
    assert rig.board.snapshot().rejected_commands.tolist() == [0, 1]


def test_beyond_the_path_tolerance_it_aborts_and_stops(rig: Goals) -> None:
    """test_state_tolerances_fail: PATH_TOLERANCE_VIOLATED; the blocked joint is let be."""
    rig.block("a")
    rig.send(SLOW, path=[Wish("a", 0.05, 0.0)])
    code, text = rig.end()
    assert code is Code.PATH_TOLERANCE_VIOLATED
    assert text.startswith("a is 0.05")
    assert "its path tolerance is 0.05 rad" in text
    where = rig.board.get_encoder("a")[0]
    rig.free()
    held = rig.cycles(0.5)[-1]
    assert abs(held[0] - where) < 0.02  # its reference went there, not on
    assert held[1] > 0.04  # that of the other stopped ahead
    np.testing.assert_array_equal(rig.cycles(0.5)[-1], held)


def test_one_point_is_judged_as_a_way_first(rig: Goals) -> None:
    """test_no_time_from_start_state_tolerance_fail."""
    rig.send(points((0.0, [1.0, 1.0])), path=[Wish("a", 1e-4, 0.0)])
    assert rig.end()[0] is Code.PATH_TOLERANCE_VIOLATED


def test_away_from_the_goal_it_aborts_when_the_time_is_over() -> None:
    """test_goal_tolerances_fail, with tolerances from parameters."""
    own = JointConstraints(goal=0.01)
    rig = Goals(own, constraints=Constraints(goal_time=0.2))
    rig.block("a")
    rig.send(ONE)
    code, text = rig.end()
    assert code is Code.GOAL_TOLERANCE_VIOLATED
    assert "its goal tolerance is 0.01 rad" in text
    assert "after the last point" in text
    assert rig.goal is not None
    assert rig.goal.elapsed == pytest.approx(0.5 + 0.2, abs=0.01)


@pytest.mark.parametrize(
    ("wishes", "code"),
    [
        ({}, Code.GOAL_TOLERANCE_VIOLATED),
        ({"goal": [Wish("a", 9.0, 9.0)]}, Code.SUCCESSFUL),
        ({"goal": [Wish("a", -1.0, -1.0)]}, Code.SUCCESSFUL),
        ({"path": [Wish("a", 1e-3, 0.0)]}, Code.PATH_TOLERANCE_VIOLATED),
        ({"goal_time": 0.4}, Code.GOAL_TOLERANCE_VIOLATED),
    ],
)
def test_tolerances_of_a_goal_replace_the_configured_ones(
    wishes: dict[str, Any], code: Code
) -> None:
    """test_tolerances_via_actions: for that goal only."""
    rig = Goals(JointConstraints(goal=0.01), constraints=Constraints(goal_time=0.1))
    rig.block("a")
    rig.send(ONE, **wishes)
    assert rig.end()[0] is code
    rig.send(points((0.1, [0.0, 0.0])))
    rig.send(ONE)
    assert rig.end()[0] is Code.GOAL_TOLERANCE_VIOLATED


def test_a_goal_time_of_none_waits(rig: Goals) -> None:
    """constraints.goal_time 0, or -1 in a goal: it waits for the joints, however long."""
    rig.block("a")
    goal = rig.send(points((0.1, [0.05, 0.05])), goal=[Wish("a", 0.01, 0.0)], goal_time=-1.0)
    rig.cycles(3.0)
    assert goal.outcome is None
    rig.free()
    assert rig.end()[0] is Code.SUCCESSFUL


def test_cancelling_brakes_within_the_acceleration_limit(rig: Goals) -> None:
    """test_cancel_decelerate_to_hold_position: SUCCESSFUL as code; q₀ + v²/2a, no way back."""
    goal = rig.send(points((1.0, [0.5, -0.5])))
    before = rig.cycles(0.5)
    assert not goal.cancelled
    goal.cancel()
    assert goal.cancelled
    assert goal.outcome is not None
    assert goal.outcome.code is Code.SUCCESSFUL
    assert goal.outcome.text == "cancelled; a, b stopped"
    after = rig.cycles(1.0)
    track = np.vstack([before[-2:], after])
    rates = np.diff(track, axis=0) / rig.period
    assert np.abs(np.diff(rates, axis=0)).max() / rig.period <= 1.05 * BRAKE
    assert (rates[:, 0] >= -1e-9).all()
    assert (rates[:, 1] <= 1e-9).all()
    way = 0.5**2 / (2 * BRAKE)
    assert after[-1] == pytest.approx([before[-1, 0] + way, before[-1, 1] - way], abs=2e-3)
    assert not rig.follower.busy


def test_cancelling_a_waiting_goal_moves_nothing(rig: Goals) -> None:
    """T3: nothing of it is kept, and what the joints follow meanwhile goes on."""
    path = make_path(NAMES, [2.0], [[1.0, 1.0]], [[]], [[]])
    rig.follower.follow(None, path, rig.board.time)
    rig.cycles(0.2)
    rig.send(ONE, ahead=0.5).cancel()
    assert rig.cycles(1.0)[-1] == pytest.approx([0.6, 0.6], abs=2e-3)


#: Of all that ends a path (test_follower.py): by a request, by a fault, by a newer path.
ENDS: dict[str, tuple[Callable[[Goals], Any], str]] = {
    "mode": (lambda rig: rig.request("set_control_mode", "a", "pos"), "a is in POSITION"),
    "fault": (lambda rig: rig.request("set_control_mode", "a", "icur"), "a is in HW_FAULT"),
    "topic": (
        lambda rig: rig.follower.follow(
            "a", make_path(("a",), [0.1], [[0.0]], [[]], [[]]), rig.board.time
        ),
        "replaced by another trajectory",
    ),
}


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("way", ENDS)
def test_a_joint_that_leaves_aborts_the_goal(rig: Goals, way: str, late: bool) -> None:
    """T2, T3: on the way and after the last point; with the reason; the others stop."""
    act, text = ENDS[way]
    goal = rig.send(SLOW)
    if late:
        rig.block("b")
        goal = rig.send(points((0.1, [0.05, 0.05])), goal=[Wish("b", 0.01, 0.0)])
    rig.cycles(0.5)
    act(rig)
    rig.cycle()
    rig.cycle()
    assert goal.outcome is not None, "after two cycles"
    assert goal.outcome.code is Code.INVALID_GOAL
    assert goal.outcome.text.startswith("ended before its time; a: ")
    assert text in goal.outcome.text
    rig.cycles(0.5)
    held = rig.cycles(rig.period)[-1]
    assert held[1] < 0.2
    rig.request("set_control_mode", "a", "fidl")
    rig.request("set_control_mode", "a", "posd")
    np.testing.assert_array_equal(rig.cycles(0.5)[-1][1], held[1])
    assert not rig.follower.busy


def test_a_limit_that_cuts_is_reported_at_the_end(rig: Goals) -> None:
    """P9, T1: it is followed up to the limit."""
    rig.send(points((1.0, [2.5, 0.0])), goal=[Wish("a", -1.0, 0.0)])
    code, text = rig.end()
    assert code is Code.SUCCESSFUL
    assert "a stays within -114.6° to 114.6° (point 0 requests 143.2°)" in text


# --- T4: continuous joints ---------------------------------------------------------------------


class Endless(Following):
    """A continuous joint that stands at 6.6 rad, and a revolute one."""

    def __init__(self) -> None:
        wide = {"lower": -1e4, "upper": 1e4, "hard_lower": -1e4, "hard_upper": 1e4}
        turning = joint("a", kind=JointKind.CONTINUOUS, limits=wide)
        config = board_config(turning, joint("b"))
        super().__init__(
            config, SimulatedPlant(config, simulation_config(config, home=[6.6, 0.0]))
        )


@pytest.mark.parametrize("by_topic", [False, True])
def test_a_continuous_joint_is_met_at_the_nearest_turn(by_topic: bool) -> None:
    """T4: 0.32 to 1.0 from 6.6 rad goes on by 0.7 rad, and does not spin back."""
    rig = Endless()
    way = points((0.5, [0.32, 0.0]), (1.5, [1.0, 0.1]))
    if by_topic:
        path = make_path(NAMES, *way)
        assert rig.follower.follow(None, path, rig.board.time)
    else:
        rig.send(way)
    seen = [float(rig.cycle()[0]) for _ in range(round(2.0 / rig.period))]
    assert min(seen) > 6.55
    assert seen[-1] == pytest.approx(1.0 + 2.0 * np.pi)
    assert rig.board.get_ref_position("b")[0] == pytest.approx(0.1)
    if not by_topic:
        assert rig.goal is not None
        assert rig.goal.outcome is not None
        assert rig.goal.outcome.code is Code.SUCCESSFUL


def test_many_turns_in_no_time_are_no_success() -> None:
    """T4, P14: it is reached when the joint is there, or the goal time is over."""
    rig = Endless()
    goal = rig.send(points((0.001, [6.6, 0.0]), (0.002, [60.0, 0.0])), goal_time=1.0)
    rig.cycle(round(1.5 / rig.period))
    assert goal.outcome is not None
    assert goal.outcome.code is Code.GOAL_TOLERANCE_VIOLATED
    patient = rig.send(points((0.001, [6.0, 0.0]), (0.002, [12.0, 0.0])))
    rig.cycle(round(0.3 / rig.period))
    assert patient.outcome is None
    rig.cycle(round(8.0 / rig.period))
    assert patient.outcome is not None
    assert patient.outcome.code is Code.SUCCESSFUL


# --- T5: receding horizon ----------------------------------------------------------------------


@pytest.mark.parametrize("by_topic", [False, True])
@pytest.mark.parametrize("every", [0.02, 0.05, 0.2, 0.5])
@pytest.mark.parametrize("ahead", [0.01, 0.05, 0.2])
def test_goals_ahead_of_time_make_one_path(ahead: float, every: float, by_topic: bool) -> None:
    """T5: each preempts the one before at its own start; the joints stay on the path of all."""
    rig = Goals()

    def at(time: float) -> list[float]:
        return [0.5 * np.sin(2.0 * time), 0.3 * np.sin(2.0 * time)]

    begin = rig.board.time + ahead
    due, worst = rig.board.time, 0.0
    for _ in range(round(3.0 / rig.period)):
        if rig.board.time >= due - 1e-9:
            start = rig.board.time + ahead - begin
            way = points(*((t, at(start + t)) for t in (0.0, *np.arange(0.02, 1.0, 0.02))))
            if by_topic:
                path = make_path(NAMES, *way)
                assert rig.follower.follow(None, path, rig.board.time + ahead)
            else:
                rig.send(way, ahead=ahead)
            due += every
        rig.cycle()
        elapsed = rig.board.time - begin
        if elapsed > 0.0:
            worst = max(worst, float(np.abs(rig.board.get_ref_position() - at(elapsed)).max()))
    assert worst < 0.01


def test_a_cancelled_goal_ends_those_before_it() -> None:
    """T5, T2: of three goals of which two wait, none goes on."""
    rig = Goals()
    rig.send(SLOW)
    rig.cycle(50)
    rig.send(SLOW, ahead=0.1)
    third = rig.send(SLOW, ahead=0.3)
    rig.cycle(100)  # the second runs
    third.cancel()
    rig.cycle(500)
    assert not rig.follower.busy
    before = rig.board.get_encoder()
    rig.cycle(100)
    np.testing.assert_allclose(rig.board.get_encoder(), before, atol=1e-3)

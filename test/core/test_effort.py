# SPDX-License-Identifier: Apache-2.0
"""trajectory.py: moves of joints together take as long as their torques ask for (SPEC P1)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from joint_parts import stand_in, write

from control_board_ros.core.laws.control import Controller
from control_board_ros.core.laws.trajectory import Effort
from control_board_ros.core.state import StateArrays
from control_board_ros.simulation import Simulation


@pytest.fixture
def panda() -> Iterator[Simulation]:
    with Simulation.load("panda") as simulation:
        simulation.run(0.3)
        yield simulation


def ask(panda: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Targets far away, and the speed limits; of the arm's seven joints."""
    limits = [joint.limits for joint in panda.board.config.joints[:7]]
    middle = np.array([0.5 * (one.lower + one.upper) for one in limits])
    span = np.array([one.upper - one.lower for one in limits])
    target = middle + 0.4 * span * [1, -1, 1, -1, 1, -1, 1]
    return target, np.array([one.velocity for one in limits])


def test_all_joints_need_longer_than_each_alone(panda: Simulation) -> None:
    """P1: get_move_time, the move and its reply agree on it; no joint leaves the path."""
    board, joints = panda.board, list(range(7))
    target, speed = ask(panda)
    alone = np.array(
        [board.get_move_time(j, target[j : j + 1], speed[j : j + 1])[0] for j in joints]
    )
    together = board.get_move_time(joints, target, speed)
    factor = together / alone
    assert factor.max() > 1.01  # 1.09 with pybullet's drives, 1.02 with MuJoCo's
    assert factor.min() >= 1.0
    reply = board.position_move(joints, target, speed)
    assert board.get_remaining_time(joints) == pytest.approx(together)
    assert "by the torque limits of the joints that move together" in reply.message
    worst = 0.0
    for _ in range(round(together.max() / board.period) + 200):
        panda.step()
        now = board.snapshot()
        worst = max(worst, float(np.abs(now.position - now.position_reference)[:7].max()))
    assert worst < 2e-3
    assert all(board.check_motion_done(joints))
    assert not [event for event in board.take_events() if event.key == "torque limit"]


def test_moves_amid_others_keep_their_paths(panda: Simulation) -> None:
    """P1: also where all joints are in fast motion, and each new move turns some of them round."""
    board, joints = panda.board, list(range(7))
    limits = [joint.limits for joint in board.config.joints[:7]]
    low, span = np.array([(one.lower, one.upper - one.lower) for one in limits]).T
    speed = np.array([one.velocity for one in limits])
    random = np.random.default_rng(7)
    for _ in range(12):
        target = low + span * random.uniform(0.1, 0.9, 7)
        assert board.position_move(joints, target, speed * random.uniform(0.3, 1.0, 7))
        for _ in range(round(random.uniform(0.05, 0.4) / board.period)):
            panda.step()
            now = board.snapshot()
            assert np.abs(now.position - now.position_reference)[:7].max() < 5e-3
        assert board.get_remaining_time(joints).max() < 12.0


def test_a_torque_at_its_limit_is_reported(panda: Simulation) -> None:
    """A joint that is pushed away in POSITION: one warning with its name, not those of others."""
    board, j = panda.board, 1
    name, limit = board.names[j], board.config.joints[j].limits.torque
    board.take_events()
    panda.plant.push(j, -1.5 * limit)
    panda.run(0.3)
    panda.plant.push(j, 0.0)
    found = [event for event in board.take_events() if event.key == "torque limit"]
    events = [event for event in found if event.joint == name]
    assert len(events) == 1
    assert f"{name}: its torque is at its limit, {limit:.2f} N·m" in events[0].text


def test_no_durations_by_torques_that_are_not_known(panda: Simulation) -> None:
    """G1: of a model that is not trusted, gravity alone is reckoned with."""
    config = panda.board.config
    assert config.model is not None
    doubtful = replace(config, model=replace(config.model, trusted=False))
    for board, known in ((config, True), (doubtful, False)):
        efforts = Controller(board, StateArrays(board.names)).efforts
        assert [one is not None for one in efforts] == [known] * len(efforts)


# --- input of the arm's model, with an arm that only records -------------------------------------


class Listening:
    """An arm whose excess is what the test says, one look after the other."""

    def __init__(self, *excess: float) -> None:
        self.bodies = [SimpleNamespace() for _ in range(3)]
        self.rows = [memoryview(np.zeros(3)) for _ in range(4)]
        self.excesses, self.looks = list(excess), list[int]()

    def excess(self, samples: int) -> float:
        self.looks.append(samples)
        return self.excesses.pop(0) if self.excesses else 0.0


def joint(**changes: Any) -> SimpleNamespace:
    """A joint of the laws, at rest at 0.1 rad."""
    given = {
        "calibrated": True,
        "trajectory.acceleration": 0.0,
        "trajectory.start_acceleration": 0.0,
        "limits.output": 80.0,  # %
        "motor.percent_per_volt": 2.0,  # 40 V
        "motor.torque_per_ampere": 5.0,
        "motor.ohms": 0.5,
        "motor.emf": 4.0,
        "limits.torque": 60.0,
        "reference.lower": -1.0,
        "reference.upper": 2.0,
        "ramp.velocity": 0.0,
        "trajectory.moving": False,
        "reference.position": 0.1,
        "trajectory.velocity": 0.2,
        "clock.period": 0.01,
        "trajectory.cycles": 30.0,
        "trajectory.start": -0.3,
        "trajectory.start_velocity": 0.7,
        "trajectory.target": 0.9,
        "trajectory.time": 1.5,
        "trajectory.brake_time": 0.25,
    }
    made = stand_in(**given)
    for path, value in changes.items():
        write(made, path, value)
    return made


def effort(arm: Listening, *joints: SimpleNamespace, first: int = 0) -> Effort:
    return Effort(arm, joints, first)  # type: ignore[arg-type]


def test_model_input_of_motors_and_running_moves() -> None:
    """0.9 of a motor's torque, falling with its speed; a move at its present time."""
    arm = Listening()
    effort(arm, joint(), joint(trajectory__moving=True), joint(ramp__velocity=0.4)).stretched(
        [], [], lambda _: []
    )
    for body in arm.bodies:
        assert body.limit == pytest.approx(0.9 * 60.0)
        assert body.stall == pytest.approx(0.9 * 40.0 * 10.0)
        assert body.fading == pytest.approx(0.9 * 4.0 * 10.0)
        assert (body.lower, body.upper) == (-1.0, 2.0)
    rest, moves, drifts = arm.bodies
    for body in (rest, drifts):
        assert (body.start, body.target) == (0.1, 0.1)
        assert [body.start_velocity, body.time, body.brake, body.past] == [0.0] * 4
    assert [body.drift for body in arm.bodies] == [0.0, 0.0, 0.4]
    assert (moves.start, moves.start_velocity, moves.target) == (-0.3, 0.7, 0.9)
    assert (moves.time, moves.brake) == (1.5, 0.25)
    assert moves.past == pytest.approx(0.3)


def test_model_input_of_moves_that_begin() -> None:
    """From the reference and its velocity; numbers are the board's."""
    arm = Listening()
    plan = [(2.0, 0.5), (3.0, 0.0)]
    made = effort(arm, joint(), joint(), joint(reference__position=0.6), first=10)
    assert made.stretched([12, 10], [1.0, -1.0], lambda _: plan) == (1.0, plan)
    last, first = arm.bodies[2], arm.bodies[0]
    assert (last.start, last.start_velocity, last.target) == (0.6, 0.2, 1.0)
    assert (last.time, last.brake, last.past) == (2.0, 0.5, 0.0)
    assert (first.start, first.target, first.time, first.brake) == (0.1, -1.0, 3.0, 0.0)
    assert arm.bodies[1].time == 0.0
    assert arm.looks == [14]


def test_moves_are_stretched_until_they_fit() -> None:
    """Torque falls with the square of the factor; at least 2 % at a time."""
    asked = []

    def plan(factor: float) -> list[tuple[float, float]]:
        asked.append(factor)
        return [(2.0 * factor, 0.0)]

    arm = Listening(4.0, 1.01, 1.0)
    factor, moves = effort(arm, *[joint()] * 3).stretched([1], [1.0], plan)
    assert factor == pytest.approx(2.0 * 1.02)
    assert moves == [(2.0 * factor, 0.0)]
    assert asked == pytest.approx([1.0, 2.0, 2.04])
    assert arm.bodies[1].time == pytest.approx(2.0 * 2.04)
    assert arm.looks == [14] * 3


def test_stretching_ends() -> None:
    arm = Listening(*[4.0] * 100)
    factor, _ = effort(arm, *[joint()] * 3).stretched([1], [1.0], lambda f: [(f, 0.0)])
    assert factor == pytest.approx(2.0**16)
    assert len(arm.looks) == 16


@pytest.mark.parametrize("unknown", [0, 1, 2])
def test_an_arm_with_an_unknown_joint_angle_is_not_checked(unknown: int) -> None:
    joints = [joint(calibrated=k != unknown) for k in range(3)]
    arm = Listening(math.inf)
    assert effort(arm, *joints).stretched([1], [1.0], lambda f: [(f, 0.0)]) == (1.0, [(1.0, 0.0)])
    assert arm.looks == []

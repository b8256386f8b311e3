# SPDX-License-Identifier: Apache-2.0
"""trajectory.py: moves of joints together take as long as their torques ask for (SPEC P1)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from control_board_ros.core.laws.control import Controller
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


def test_all_joints_take_longer_than_each_alone(panda: Simulation) -> None:
    """P1: get_move_time, the move and its reply agree on it; nobody leaves the path."""
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


def test_a_torque_at_its_limit_is_told_of(panda: Simulation) -> None:
    """A joint that is pushed away in POSITION: one warning with its name, whoever it drags on."""
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
        efforts = Controller(board, StateArrays(board)).efforts
        assert [one is not None for one in efforts] == [known] * len(efforts)

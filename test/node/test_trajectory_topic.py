# SPDX-License-Identifier: Apache-2.0
"""~/joint_trajectory on a loop that the test steps: what a message sets going (SPEC T1 to T3)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from rig import board_config, joint, simulation_config
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from control_board_ros.core.board import Board
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.node.loop.loop import ControlLoop
from control_board_ros.node.wiring.trajectories import (
    followed,
    start_time,
    trajectory_callback,
)
from control_board_ros.sim.plant import SimulatedPlant

RATES = ["velocities", "accelerations"]


def point(seconds: float, *positions: float, **more: Any) -> JointTrajectoryPoint:
    since = Duration(sec=int(seconds), nanosec=round(seconds % 1.0 * 1e9))
    return JointTrajectoryPoint(positions=positions, time_from_start=since, **more)


class Following:
    """Joints a and b in POSITION_DIRECT, and c in IDLE; simulated time is that of stamps."""

    def __init__(self) -> None:
        config = board_config(*(joint(name) for name in "abc"))
        self.board = Board(config)
        self.plant = SimulatedPlant(config, simulation_config(config))
        self.loop = ControlLoop(self.board, self.plant, real_time_factor=0.0)
        follower = followed(self.loop)
        self.warnings: list[tuple[str, str]] = []
        self._follow = trajectory_callback(
            self.loop.main, follower, lambda *warning: self.warnings.append(warning)
        )
        self.run(0.1)
        assert self.board.set_control_mode(["a", "b"], ControlMode.POSITION_DIRECT)

    def run(self, seconds: float) -> np.ndarray:
        """Pass time; the direct positions of all cycles, shape (m, 3)."""
        rows = []
        for _ in range(round(seconds / self.board.period)):
            measurement = self.plant.read()
            for hook in self.loop.hooks:
                hook(self.board, measurement.time)
            self.plant.write(self.board.tick(measurement))
            rows.append(self.board.get_ref_position())
        return np.array(rows)

    def send(self, names: str, *points: JointTrajectoryPoint, begin: float = 0.0) -> None:
        message = JointTrajectory(joint_names=list(names), points=points)
        message.header.stamp = Time(sec=int(begin), nanosec=round(begin % 1.0 * 1e9))
        self._follow(message)


@pytest.fixture
def rig() -> Following:
    return Following()


@pytest.mark.parametrize(("more", "share"), [(["velocities"], 1.5), (RATES, 1.875), ([], 1.0)])
def test_rates_make_it_smooth(rig: Following, more: list[str], share: float) -> None:
    """The reference runs along a cubic, or a quintic, slow at its ends; else a straight line."""
    rig.send("a", point(1.0, 0.4, **{rate: [0.0] for rate in more}))
    speeds = np.diff(rig.run(1.0)[:, 0]) / rig.board.period
    assert speeds.max() == pytest.approx(share * 0.4, rel=0.02)


def test_the_stamp_sets_the_start_time(rig: Following) -> None:
    """T1: one of the past is joined where it is, one that is over refused, one ahead waits."""
    begin = rig.board.time + 0.2
    rig.send("a", point(0.0, 0.0), point(0.4, 0.2), begin=begin)
    way = rig.run(0.7)[:, 0]
    waited = round(0.2 / rig.board.period)
    assert not way[: waited - 1].any()
    np.testing.assert_allclose(way[2 * waited], 0.1, atol=2e-3)
    assert way[-1] == pytest.approx(0.2)
    rig.send("a", point(0.2, 0.8), point(0.4, -0.8), begin=rig.board.time - 0.5)
    assert rig.board.rejected_commands.tolist() == [1, 0, 0]
    assert rig.run(0.1)[-1, 0] == pytest.approx(0.2)


@pytest.mark.parametrize("ahead", [3e8, -3e8, 3700.0])
def test_a_stamp_of_another_clock_is_refused_with_both_times(rig: Following, ahead: float) -> None:
    """T5: and counted; nothing waits for a time that never comes."""
    here = rig.board.time
    stamp = Time(sec=int(here + 4e8 + ahead))
    base = rig.loop.time_base
    base.offset = 400_000_000 * 10**9
    with pytest.raises(RequestError) as refused:
        start_time(stamp, rig.board, base)
    assert f"it is stamped {stamp.sec}.000 s" in str(refused.value)
    assert f"the board's clock shows {4e8 + here:.3f} s" in str(refused.value)
    rig.send("a", point(0.4, 0.2), begin=float(stamp.sec))
    assert rig.board.rejected_commands.tolist() == [1, 0, 0]
    assert "is stamped" in rig.warnings[-1][0]
    assert not rig.run(1.0).any()


@pytest.mark.parametrize("request_", [False, True])
def test_events_that_end_a_trajectory(rig: Following, request_: bool) -> None:
    """T1, M2: a message without points, or another mode, for no cycle; nothing goes on then."""
    rig.send("a", point(20.0, 1.0))
    rig.run(0.5)
    if request_:
        for mode in ("pos", "posd"):
            with rig.loop.main.exclusive() as board:
                assert board.set_control_mode("a", mode)
    else:
        rig.send("a")
    held = rig.run(0.5)[-1, 0]
    assert 0.0 < held < 0.1
    assert (rig.run(0.5)[:, 0] == held).all()


@pytest.mark.parametrize(
    ("names", "points", "text", "counted"),
    [
        ("a", [point(0.5, 0.1, 0.2)], "refused, point 0 has 2 positions for 1 joint", [1, 0, 0]),
        ("a", [point(0.5, float("nan"))], "point 0 has nan in positions", [1, 0, 0]),
        ("a", [point(0.5, 0.1, effort=[1.0])], "point 0 has effort", [1, 0, 0]),
        ("ax", [point(0.5, 0.1, 0.1)], "joint 'x' unknown", [1, 0, 0]),
        ("c", [point(0.5, 0.1)], "for c ignored: mode is IDLE", [0, 0, 1]),
    ],
)
def test_wrong_messages_move_nothing_and_are_reported(
    rig: Following, names: str, points: list[Any], text: str, counted: list[int]
) -> None:
    """M4, P13: ignored, counted, and the reason is logged."""
    rig.send(names, *points)
    ((warning, what),) = rig.warnings
    assert warning.startswith("trajectory: ")
    assert text in warning
    assert what == "ignored"
    assert rig.board.rejected_commands.tolist() == counted
    assert not rig.run(0.1)[:, :2].any()

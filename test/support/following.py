# SPDX-License-Identifier: Apache-2.0
"""A board that follows paths and trajectories, used as in the node."""

from __future__ import annotations

from typing import Any

from rig import Rig

from control_board_ros.core.config.config import BoardConfig
from control_board_ros.core.goals.follower import Follower
from control_board_ros.core.goals.path import Points, Wishes
from control_board_ros.core.goals.trajectory_goal import TrajectoryGoal, start_goal
from control_board_ros.core.terms.arguments import Array


class Following(Rig):
    """Joints in POSITION_DIRECT, with a follower: a step before ticks, a check after requests."""

    def __init__(self, config: BoardConfig, plant: Any = None) -> None:
        super().__init__(config, plant)
        self.tick(2)
        self.follower = Follower(self.board)
        self.goal: TrajectoryGoal | None = None
        assert self.request("set_control_mode", None, "posd")
        self.tick(2)
        self.board.take_events()

    def request(self, method: str, *arguments: Any) -> Any:
        """A request between two cycles."""
        if method == "stop":
            arguments = (self.board, *arguments)
        asked = self.follower if method == "stop" else self.board
        reply = getattr(asked, method)(*arguments)
        self.follower.check()
        return reply

    def send(
        self, points: Points, joints: Any = None, *, ahead: float = 0.0, **wishes: Any
    ) -> TrajectoryGoal:
        """A new goal, which preempts the old one, as the node does it."""
        start = self.board.time + ahead
        goal = start_goal(self.follower, self.board, joints, points, start, Wishes(**wishes))
        if self.goal is not None:
            goal.take_over(self.goal)
        self.goal = goal
        return goal

    def cycle(self, count: int = 1) -> Array:
        """Some cycles; the last accepted direct positions after them, shape (n,)."""
        for _ in range(count):
            measurement = self.plant.read()
            if self.goal is not None:
                self.goal.check()
            self.follower.step(measurement.time)
            self.plant.write(self.board.tick(measurement))
        return self.board.get_ref_position()

    def events(self) -> list[str]:
        """What the log says since the last call."""
        return [event.text for event in self.board.take_events()]

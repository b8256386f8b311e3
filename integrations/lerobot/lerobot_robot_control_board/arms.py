# SPDX-License-Identifier: Apache-2.0
"""The arm of a device: a running board over ROS, or a simulated one in this process."""

from __future__ import annotations

import logging
from typing import Any, Protocol

from control_board_ros.client.guidance import guide, guiding_damping
from control_board_ros.settings.loading import Settings
from control_board_ros.simulation import Simulation, made_board

#: Control cycles of a simulated board's start.
START_CYCLES = 3


class Arm(Protocol):
    """A board and its time.

    Attributes: board (a client, or the board of a simulation: their methods are the same).
    """

    board: Any

    def pass_time(self, seconds: float) -> None:
        """Advance simulated time; no effect on real time."""

    def send(self, positions: list[float]) -> list[float]:
        """Send direct positions of all joints, rad; returns those in force, NaN if ignored."""

    def be_guided(self) -> None:
        """Make all joints compliant, without stiffness, damped, with gravity compensation.

        All of them, or none: on any error their settings are those of before.
        """

    def close(self) -> None:
        """Disconnect."""


class SimulatedArm:
    """A board and its plant in this process."""

    def __init__(self, settings: Settings) -> None:
        self._simulation = Simulation(made_board(settings), settings.simulation)
        self.board = self._simulation.board
        self._simulation.step(START_CYCLES)

    def pass_time(self, seconds: float) -> None:
        self._simulation.run(seconds)

    def send(self, positions: list[float]) -> list[float]:
        return list(self.board.set_position(None, positions).values)

    def be_guided(self) -> None:
        board = self.board
        _, limits = board.get_max_impedance()
        damping = [
            guiding_damping(joint.inertia_min, joint.inertia_max, limit)
            for joint, limit in zip(board.get_config(), limits.tolist(), strict=True)
        ]
        check(board.set_impedance(None, [0.0] * len(damping), damping))
        check(board.set_interaction_mode(None, "comp"))

    def close(self) -> None:
        self._simulation.close()


class RosArm:
    """A running board, over ROS."""

    def __init__(self, name: str) -> None:
        from control_board_ros.client import connect

        self.board = connect(name)
        self._guidance: Any = None

    def pass_time(self, seconds: float) -> None:
        """Nothing: its time is real."""

    def send(self, positions: list[float]) -> list[float]:
        return list(self.board.set_position(None, positions, answered=True).values)

    def be_guided(self) -> None:
        if self._guidance is None:
            self._guidance = guide(self.board).__enter__()

    def close(self) -> None:
        """Hold the joints, restore the previous settings, disconnect."""
        try:
            if self._guidance is not None:
                self._guidance.__exit__()
                if self._guidance.left:
                    logging.getLogger(__name__).warning("%s", self._guidance.left)
            self.board.stop()
        finally:
            self.board.close()


def check(reply: Any) -> None:
    """Check that a board accepts a request.

    Raises:
        RuntimeError: refused; one line with the reason.
    """
    if not reply:
        raise RuntimeError(str(reply))

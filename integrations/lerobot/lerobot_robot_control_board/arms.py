# SPDX-License-Identifier: Apache-2.0
"""The arm of a device: a running board over ROS, or a simulated one in this process."""

from __future__ import annotations

from typing import Any, Protocol

from control_board_ros.settings.loading import Settings
from control_board_ros.simulation import Simulation, made_board

#: Control cycles of a simulated board's start.
START_CYCLES = 3


class Arm(Protocol):
    """A board and its time.

    Attributes: board (offers the interfaces of ``control_board_ros.protocols``).
    """

    board: Any

    def pass_time(self, seconds: float) -> None:
        """Advance simulated time; no effect on real time."""

    def send(self, positions: list[float]) -> list[float]:
        """Send direct positions of all joints, rad; returns those in force, NaN if ignored."""

    def be_guided(self) -> None:
        """Set all joints COMPLIANT, without stiffness, with gravity compensation."""

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
        check(self.board.set_interaction_mode(None, "comp"))
        check(self.board.set_impedance(None, 0.0, None))
        check(self.board.set_control_mode(None, "posd"))

    def close(self) -> None:
        self._simulation.close()


class RosArm:
    """A running board, over ROS."""

    def __init__(self, name: str) -> None:
        from control_board_ros.client import connect

        self.board = connect(name)
        self._before: tuple[Any, Any, Any] | None = None

    def pass_time(self, seconds: float) -> None:
        """Nothing: its time is real."""

    def send(self, positions: list[float]) -> list[float]:
        return list(self.board.set_position(None, positions, answered=True).values)

    def be_guided(self) -> None:
        on = {f"{name}.gravity_compensation": True for name in self.board.names}
        self._before = (
            self.board.get_parameters(list(on)),
            self.board.get_impedance(),
            self.board.get_interaction_mode(),
        )
        check(self.board.set_parameters(on))
        check(self.board.set_interaction_mode(None, "comp"))
        check(self.board.set_impedance(None, 0.0))
        check(self.board.set_control_mode(None, "posd"))

    def close(self) -> None:
        try:
            if self._before is not None:
                self._hold(*self._before)
            self.board.stop()
        finally:
            self.board.close()

    def _hold(self, compensation: Any, impedance: Any, interaction: Any) -> None:
        """Hold the present positions, then restore the previous settings."""
        check(self.board.set_interaction_mode(None, "stif"))
        check(self.board.set_parameters(compensation))
        check(self.board.set_impedance(None, *impedance))
        check(self.board.set_interaction_mode(None, interaction))


def check(reply: Any) -> None:
    """Check that a board accepts a request.

    Raises:
        RuntimeError: refused; one line with the reason.
    """
    if not reply:
        raise RuntimeError(str(reply))

# SPDX-License-Identifier: Apache-2.0
"""What both devices stand on: a running board over ROS, or one that is simulated here."""

from __future__ import annotations

from typing import Any, Protocol

from control_board_ros.settings.loading import Settings
from control_board_ros.simulation import Simulation, made_board

#: Control cycles until a simulated board is up.
START_CYCLES = 3


class Arm(Protocol):
    """A board, and the passing of its time.

    Attributes: board (has the interfaces of ``control_board_ros.protocols``).
    """

    board: Any

    def pass_time(self, seconds: float) -> None:
        """Let simulated time pass; real time passes by itself."""

    def send(self, positions: list[float]) -> list[float]:
        """Direct positions of all joints, rad; those in force, NaN where none was taken."""

    def be_guided(self) -> None:
        """Give way to a hand, with the load of gravity carried."""

    def close(self) -> None:
        """Let go of it."""


class SimulatedArm:
    """A board and its plant in this process; see Arm."""

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
    """A board that runs, over ROS; see Arm."""

    def __init__(self, name: str) -> None:
        from control_board_ros.client import connect

        self.board = connect(name)
        self._before: tuple[Any, Any, Any] | None = None

    def pass_time(self, seconds: float) -> None:
        """Its time is real."""

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
        """Hold the arm where the hand has left it, then set what was set before."""
        check(self.board.set_interaction_mode(None, "stif"))
        check(self.board.set_parameters(compensation))
        check(self.board.set_impedance(None, *impedance))
        check(self.board.set_interaction_mode(None, interaction))


def check(reply: Any) -> None:
    """Raise where a board refuses.

    Raises:
        RuntimeError: with its reason, one line.
    """
    if not reply:
        raise RuntimeError(str(reply))

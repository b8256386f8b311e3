# SPDX-License-Identifier: Apache-2.0
"""A board and its simulated plant in one process, stepped by the caller.

with Simulation.load("iiwa") as simulation:
    simulation.step()  # configures the board
    simulation.board.position_move("lbr_iiwa_joint_4", -1.0)
    simulation.run(2.0)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Self

from .core.board import Board
from .core.config.config import BoardConfig, joined
from .settings.loading import Settings, load
from .sim.config import SimulationConfig
from .sim.plant import Body, SimulatedPlant


def made_board(settings: Settings) -> Board:
    """The board of settings, with the parts of a robot."""
    if not settings.parts:
        return Board(settings.board)
    parts = {name: settings.part(name).board for name in settings.parts}
    return Board(joined(parts), settings.levels)


class Simulation:
    """A board and its simulated plant; time passes only in ``step`` and ``run``.

    Attributes:
        board: The control board; with the groups of a robot's parts.
        plant: The simulated plant.
        settings: Those that it was loaded from, with its parameters and poses; or None.
        hooks: Called in every cycle before the tick, with the time of the reading, s.
    """

    def __init__(
        self,
        board: BoardConfig | Board,
        simulation: SimulationConfig,
        body: Body | None = None,
        settings: Settings | None = None,
    ) -> None:
        self.settings, self.hooks = settings, list[Callable[[float], None]]()
        self.board = Board(board) if isinstance(board, BoardConfig) else board
        self.plant = SimulatedPlant(self.board.config, simulation, body)
        self._rate = self.board.config.control_rate

    @classmethod
    def load(cls, config: str | None = None, **values: object) -> Self:
        """The simulation of a configuration file, or of a URDF.

        Args:
            config: A YAML file, the name of one that is shipped (``iiwa``, ``panda``, ...), or a
                URDF.
            values: Parameters to set on top, with ``__`` for a dot in the name.

        Raises:
            SettingsError: The file, or a value, is not allowed; one line.
        """
        overrides = {name.replace("__", "."): value for name, value in values.items()}
        loaded = load(config, overrides)
        return cls(made_board(loaded), loaded.simulation, settings=loaded)

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.plant.time

    def step(self, cycles: int = 1) -> None:
        """Run control cycles: read, tick, write.

        Raises:
            PlantGone: the physics server is gone.
        """
        read, tick, write = self.plant.read, self.board.tick, self.plant.write
        for _ in range(cycles):
            reading = read()
            for hook in self.hooks:
                hook(reading.time)
            write(tick(reading))

    def run(self, seconds: float) -> None:
        """Advance simulated time, in whole control cycles."""
        self.step(round(seconds * self._rate))

    def close(self) -> None:
        """Close the plant; safe to call twice."""
        self.plant.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

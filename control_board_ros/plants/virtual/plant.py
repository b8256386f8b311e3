# SPDX-License-Identifier: Apache-2.0
"""A driver in the box with virtual drives at the other end of its bus: ``plant:=virtual/moteus``.

The drives turn the joints of the robot's own simulated body, gravity and friction included.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np

from ...core.config.config import BoardConfig
from ...core.terms.measurement import Array
from ...settings.loading import Settings
from ...sim.config import SimulationConfig
from ...sim.motor import SLIP_SPEED, smoothing_inertia
from ...sim.plant import make_body
from ...text import unknown_word
from ..drives.plant import DrivesPlant, Make
from ..entry_points import DRIVERS, pairs
from ..errors import PlantSettingsError
from .world import STEP, World


def make_virtual(name: str, settings: Settings, arguments: Sequence[str]) -> DrivesPlant:
    """The plant ``virtual/NAME``; it closes its virtual drives with itself.

    Args:
        name: As the user wrote it.
        settings: Of the board and of the body.
        arguments: ``name=value`` each; ``bus`` is ignored.

    Raises:
        PlantSettingsError: the driver is unknown, its library is not installed, or it refuses an
            argument.
    """
    driver = name.removeprefix("virtual/")
    if driver not in DRIVERS:
        known = [f"virtual/{known}" for known in DRIVERS]
        raise PlantSettingsError(unknown_word("plant:", name, known, "known:"))
    options, board = pairs(arguments), settings.board
    options.pop("bus", None)
    options.setdefault("turns", "absolute")  # as its virtual drives keep them
    try:
        far_end = FarEnd(driver, board, settings.simulation, options)
        plant = far_end.make(board.names, options | {"bus": far_end.bus.address})
    except ImportError as error:
        raise PlantSettingsError(
            f"plant: {name!r} needs {error.name}; pip install 'control_board_ros[{driver}]'"
        ) from None
    plant.far_end = far_end
    return plant


class FarEnd:
    """Virtual drives on a bus, and the body that they turn: everything beyond the cable.

    Args:
        driver: Its folder's name, as ``moteus``.
        board: Its joints, in its order.
        simulation: The body that the drives move.
        arguments: Of the user, for the driver; without ``bus``.
        address: Of a bus that other processes reach, interface and channel; empty: one of ours.

    Attributes: make (of the driver), world, bus, drives.
    """

    def __init__(
        self,
        driver: str,
        board: BoardConfig,
        simulation: SimulationConfig,
        arguments: Mapping[str, str],
        address: str = "",
    ) -> None:
        room = f"control_board_ros.plants.{driver}"
        self.make: Make = import_module(f"{room}.driver").make
        virtual = import_module(f"{room}.virtual")
        axes = self.make(board.names, arguments).axes
        self.drives: Sequence[Any] = [
            virtual.virtual_drive(axis, joint)
            for axis, joint in zip(axes, board.joints, strict=True)
        ]
        simulation = replace(simulation, physics_rate=1.0 / STEP)
        body = make_body(board, simulation)
        home = np.array([joint.home for joint in simulation.joints])
        self.world = World(axes, self.drives, body, friction(board, simulation), home)
        body.restore(self.world.state.copy())
        self.bus = virtual.virtual_bus(self.world, self.drives, *([address] if address else []))

    def close(self) -> None:
        """End drives and body; safe to call twice."""
        self.bus.close()
        self.world.body.close()


def friction(board: BoardConfig, simulation: SimulationConfig) -> Array:
    """Friction of a World, as steep as is stable with the smallest inertia of each joint."""
    motors = [joint.motor for joint in simulation.joints]
    dry = np.array([motor.coulomb for motor in motors])
    slip = np.maximum(SLIP_SPEED, 2.0 * STEP * dry / smoothing_inertia(board, simulation))
    return np.array([dry, slip, [motor.viscous for motor in motors]])

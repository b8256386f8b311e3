# SPDX-License-Identifier: Apache-2.0
"""The shipped arm in one process with its board, for tests that need masses and gravity."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from control_board_ros.core.terms.measurement import Array
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.settings.loading import load
from control_board_ros.simulation import Simulation

J1, J2, J4 = (f"lbr_iiwa_joint_{k}" for k in (1, 2, 4))


@contextmanager
def iiwa(**overrides: Any) -> Iterator[Simulation]:
    """The iiwa, configured and at rest; ``overrides`` are parameters, ``__`` for the dots."""
    values = {key.replace("__", "."): value for key, value in overrides.items()}
    settings = load("iiwa", values)
    with Simulation(settings.board, settings.simulation) as simulation:
        simulation.run(0.2)
        yield simulation


def truth(simulation: Simulation) -> Array:
    """Where the joints truly are, whatever the encoders say, shape (n,), rad."""
    plant: Any = simulation.plant
    return plant._motors.position.copy()


def enter(simulation: Simulation, mode: ControlMode | str, joints: Any = None) -> None:
    """Set a mode, from a fault too."""
    assert simulation.board.set_control_mode(joints, ControlMode.FORCE_IDLE)
    reply = simulation.board.set_control_mode(joints, mode)
    assert reply, reply.message

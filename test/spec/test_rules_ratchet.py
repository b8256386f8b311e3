# SPDX-License-Identifier: Apache-2.0
"""SPEC M9, P3, E1: what is repeated does not lower a loaded arm step by step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from control_board_ros.settings.loading import load
from control_board_ros.simulation import Simulation
from control_board_ros.tuning.scenes import with_payload

#: kg at the last link, of which the board's model does not know; repetitions, and s of each.
MASS, TIMES, EACH = 2.0, 20, 0.25
UNCALIBRATED = {"joint_defaults.calibration.required": False}


@pytest.fixture(params=["mujoco", pytest.param("pybullet", marks=[pytest.mark.slow])])
def loaded(request: pytest.FixtureRequest) -> Iterator[Simulation]:
    """The iiwa at rest in POSITION with the load."""
    made = load("iiwa", UNCALIBRATED | {"physics": request.param})
    assert made.simulation.urdf is not None
    urdf = with_payload(made.simulation.urdf, made.board.names, MASS)
    with Simulation(made.board, replace(made.simulation, urdf=urdf)) as simulation:
        simulation.step(3)
        simulation.run(1.0)
        yield simulation


def static_sag(simulation: Simulation) -> np.ndarray:
    """What the load alone bends each joint in COMPLIANT, rad, shape (n,)."""
    board = simulation.board
    with Simulation(board.config, load("iiwa", UNCALIBRATED).simulation) as empty:
        empty.step(3)
        empty.run(1.0)
        unknown = board.state.torque - empty.board.state.torque
    return np.abs(unknown) / board.get_impedance()[0]


def compliant_and_back(simulation: Simulation) -> None:
    for mode in ("comp", "stif"):
        assert simulation.board.set_interaction_mode(None, mode)
        simulation.run(EACH)


def recover(simulation: Simulation) -> None:
    """From an emergency stop of 4 ms, in which the arm falls."""
    board = simulation.board
    for held in (True, False):
        board.emergency_stop(held)
        simulation.step(2)
    assert board.recover()
    simulation.run(EACH)


def stop(simulation: Simulation) -> None:
    assert simulation.board.stop(None)
    simulation.run(EACH)


def stop_in_compliant(simulation: Simulation) -> None:
    assert simulation.board.set_interaction_mode(None, "comp")
    stop(simulation)


@pytest.mark.parametrize("act", [compliant_and_back, recover, stop, stop_in_compliant])
def test_repetitions_lower_a_loaded_arm_by_one_sag_at_most(
    loaded: Simulation, act: Callable[[Simulation], None]
) -> None:
    began = loaded.board.state.position.copy()
    for _ in range(TIMES):
        act(loaded)
    assert {mode.name for mode in loaded.board.get_control_mode()} == {"POSITION"}
    sagged = np.abs(loaded.board.state.position - began)
    sag = static_sag(loaded)
    assert sag.max() > 0.01  # or nothing would be shown
    assert sagged.max() < sag.max()
    assert np.all(sagged < sag + 1e-3)

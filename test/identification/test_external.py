# SPDX-License-Identifier: Apache-2.0
"""Torques from outside over a recording are those that a board would have shown (SPEC X1)."""

from __future__ import annotations

import numpy as np
import pytest

from control_board_ros.core.terms.measurement import Row
from control_board_ros.identification.external import external
from control_board_ros.identification.robot import Robot
from control_board_ros.identification.samples import Record
from control_board_ros.settings.loading import load
from control_board_ros.simulation import Simulation

ROWS = {
    "position": Row.POSITION,
    "velocity": Row.VELOCITY,
    "torque": Row.TORQUE,
    "current": Row.CURRENT,
}


@pytest.mark.parametrize("sensor", [True, False], ids=["sensor", "current"])
def test_the_board_and_the_identification_show_the_same(sensor: bool) -> None:
    """One model: weight, payload, rotors and friction, and one observer, cycle by cycle."""
    values = {"physics": "mujoco", "lbr_iiwa_joint_7.payload.mass": 1.5}
    if not sensor:
        values |= {
            "joint_defaults.torque_sensor": False,
            "joint_defaults.control_modes": ["pos", "idl"],
            "joint_defaults.interaction_modes": ["stif"],
        }
    settings = load("iiwa", values)
    shown, rows = [], []
    with Simulation(settings.board, settings.simulation) as simulation:
        simulation.run(0.5)
        board, plant = simulation.board, simulation.plant
        board.position_move(None, [0.4, -0.6, 0.3, -0.8, 0.5, 0.4, -0.5], [1.0] * 7)
        for _ in range(800):
            measured = plant.read()
            rows.append(measured.values.copy())
            plant.write(board.tick(measured))
            shown.append(board.state.external_torque.copy())
    found = np.array(rows)
    signals = {name: found[:, row] for name, row in ROWS.items()}
    if not sensor:
        signals["torque"] = np.full_like(signals["position"], np.nan)
    record = Record("", {}, settings.board.period * np.arange(len(found)), signals)
    (own,) = external(Robot.of(settings), [record])
    after = np.array(shown)[-len(own.time) :]
    assert np.ptp(after, axis=0).max() > 1.0  # the payload that the plant does not have
    assert own.torque == pytest.approx(after, abs=1e-6)

# SPDX-License-Identifier: Apache-2.0
"""An arm one of whose encoders never spoke: a fault of that joint, and of no other (B7)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from control_board_ros.core.terms.measurement import UNREAD, Measurement, Row
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.simulation import Simulation

pytest.importorskip("pybullet")
SILENT, OTHERS = 2, [0, 1, 3, 4, 5, 6]


def test_a_joint_without_a_reading_faults_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """B7, F1: the arm's weight is not known then; the others hold, also when the joint is back."""
    simulation = Simulation.load("iiwa", physics="pybullet")
    board, reading = simulation.board, simulation.plant.read

    def read() -> Measurement:
        measurement = reading()
        values = measurement.values.copy()
        values[UNREAD, SILENT], values[Row.ENCODER_AGE, SILENT] = np.nan, measurement.time
        return replace(measurement, values=values)

    with monkeypatch.context() as silence:
        silence.setattr(simulation.plant, "read", read)
        simulation.run(0.3)
    assert [j for j, fault in enumerate(board.get_faults()) if fault.active] == [SILENT]
    places = board.get_encoder(OTHERS)
    simulation.run(0.1)
    assert board.recover()
    simulation.run(0.5)
    assert set(board.get_control_mode()) == {ControlMode.POSITION}
    assert board.get_encoder(OTHERS) == pytest.approx(places, abs=0.01)
    simulation.close()

# SPDX-License-Identifier: Apache-2.0
"""One joint of the laws alone: constants, readings in, references and outputs out."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np

from control_board_ros.core import laws

ROWS = (
    "position",
    "velocity",
    "torque",
    "current",
    "position_reference",
    "velocity_reference",
    "torque_reference",
    "output",
)

#: A joint of 1 kg·m² whose drive is its torque, in percent.
CONSTANTS = {
    "period": 0.001,
    "limit_lower": -2.0,
    "limit_upper": 2.0,
    "max_velocity": 3.0,
    "max_acceleration": 20.0,
    "max_torque": 60.0,
    "max_output": 100.0,
    "max_drive": 100.0,
    "inertia_min": 1.0,
    "inertia": 1.0,
    "torque_per_ampere": 1.0,
    "has_torque_sensor": True,
    "per_torque": 1.0,
    "per_feed": 1.0,
    "calibrated": True,
    "feeds": True,
    "lower": -2.0,
    "upper": 2.0,
}


class OneJoint:
    """A joint that is measured to be where ``set`` says; ``module`` holds the laws."""

    def __init__(self, module: Any = laws, **constants: Any) -> None:
        self.joint = module.Joint()
        for name, value in (CONSTANTS | constants).items():
            setattr(self.joint, name, value)
        self.rows = {name: array("d", [0.0]) for name in ROWS}
        self.done = array("B", [1])
        views = [memoryview(row) for row in self.rows.values()]
        self._laws = module.Laws([self.joint], views, memoryview(self.done))

    def set(self, **measured: float) -> None:
        """What is measured from now on."""
        for name, value in measured.items():
            self.rows[name][0] = value

    def step(self, cycles: int = 1) -> None:
        """Some control cycles."""
        for _ in range(cycles):
            self._laws.step()

    def get(self, name: str) -> float:
        """The last value of a row."""
        return self.rows[name][0]

    def record(self, cycles: int, *attributes: str) -> np.ndarray:
        """Attributes of the joint after each cycle, shape (cycles, k)."""
        rows = []
        for _ in range(cycles):
            self.step()
            rows.append([getattr(self.joint, name) for name in attributes])
        return np.array(rows, dtype=float)

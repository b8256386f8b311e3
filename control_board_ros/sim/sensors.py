# SPDX-License-Identifier: Apache-2.0
"""Joint sensors: encoder with resolution and zero, torque, motor current, temperature."""

from __future__ import annotations

import numpy as np

from ..core.terms.faults import FaultCode
from ..core.terms.measurement import ROWS, Row
from .config import SimulationConfig
from .drive import Sampler
from .motor import Motors


class Sensors:
    """What undamaged sensors say.

    Attributes:
        values: Readings, shape (ROWS, n), reused from sample to sample.
        sample: Reads encoders, torque sensors, speeds and currents.
    """

    def __init__(self, simulation: SimulationConfig, motors: Motors) -> None:
        encoders = [joint.encoder for joint in simulation.joints]
        self._motors = motors
        self.values = np.zeros((ROWS, len(encoders)))
        self._alarm = self.values[Row.ALARM]
        zero = np.array([encoder.zero for encoder in encoders])
        resolution = np.array([encoder.resolution for encoder in encoders])
        counts = 1.0 / np.where(resolution > 0.0, resolution, 1.0)
        truth = (motors.position, motors.velocity, motors.torque, motors.current)
        rows = [self.values[row] for row in (Row.POSITION, Row.VELOCITY, Row.TORQUE, Row.CURRENT)]
        self.sample = Sampler(
            [row.data for row in truth],
            [row.data for row in rows],
            [row.data for row in (zero, counts, resolution)],
        ).sample

    def sample_temperature(self) -> None:
        """Read the windings."""
        self.values[Row.TEMPERATURE] = self._motors.temperature

    def alarm(self, code: FaultCode | None) -> None:
        """Raise an alarm of the hardware on every joint, or none."""
        self._alarm.fill(0.0 if code is None else 1.0 + code)

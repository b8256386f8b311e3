# SPDX-License-Identifier: Apache-2.0
"""Joint sensors: encoder with resolution and zero, torque, motor current, temperature."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core.faults import FaultCode
from ..core.measurement import ROWS, Row
from .config import SimulationConfig
from .motor import Motors


class Sensors:
    """What undamaged sensors say.

    Attributes:
        values: Readings, shape (ROWS, n), reused from sample to sample.
    """

    def __init__(self, simulation: SimulationConfig) -> None:
        encoders = [joint.encoder for joint in simulation.joints]
        self.values = np.zeros((ROWS, len(encoders)))
        self._torque = self.values[Row.TORQUE]
        self._position = self.values[Row.POSITION]
        self._rates = self.values[Row.VELOCITY : Row.CURRENT + 1]
        self._alarm = self.values[Row.ALARM]
        self._zero = np.array([encoder.zero for encoder in encoders])
        resolution = np.array([encoder.resolution for encoder in encoders])
        quantised = resolution > 0.0
        self._resolution = np.where(quantised, resolution, 1.0)
        self._counts = 1.0 / self._resolution
        self._shifted, self._coarse = bool(self._zero.any()), bool(quantised.any())
        self._some: NDArray[np.bool_] | None = None if quantised.all() else quantised
        self._rounded = np.zeros(len(encoders))

    def sample(self, motors: Motors) -> None:
        """Read encoders, torque sensors, speeds and currents."""
        position = self._position
        if self._shifted:
            np.add(motors.position, self._zero, position)
        else:
            position[...] = motors.position
        if self._coarse:
            rounded = self._rounded
            np.multiply(position, self._counts, rounded)
            np.rint(rounded, rounded)
            if self._some is None:
                np.multiply(rounded, self._resolution, position)
            else:
                np.multiply(rounded, self._resolution, position, where=self._some)
        self._torque[...] = motors.torque
        self._rates[...] = motors.rates

    def sample_temperature(self, motors: Motors) -> None:
        """Read the windings."""
        self.values[Row.TEMPERATURE] = motors.temperature

    def alarm(self, code: FaultCode | None) -> None:
        """Raise an alarm of the hardware on every joint, or none."""
        self._alarm.fill(0.0 if code is None else 1.0 + code)

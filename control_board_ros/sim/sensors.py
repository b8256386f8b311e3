# SPDX-License-Identifier: Apache-2.0
"""Joint sensors: encoder with resolution and zero, torque, motor current, temperature."""

from __future__ import annotations

import numpy as np

from ..core.config.config import BoardConfig
from ..core.terms.faults import FaultCode
from ..core.terms.measurement import MOTOR_ROWS, ROWS, Motor, Row
from .config import SimulationConfig
from .drive import Sampler
from .motor import Motors


class Shafts:
    """What is measured at motors: their shafts, as the gearbox turns them, and their supply.

    Attributes: values (rows of Motor, shape (MOTOR_ROWS, n), reused from sample to sample).
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig, motors: Motors) -> None:
        self._motors = motors
        self.values = np.zeros((MOTOR_ROWS, len(board.joints)))
        self.values[Motor.SUPPLY] = [joint.motor.supply_voltage for joint in board.joints]
        self._ratio = np.array(
            [
                joint.motor.gear_ratio if there.encoder.motor else np.nan
                for joint, there in zip(board.joints, simulation.joints, strict=True)
            ]
        )
        self.turning = self.values[Motor.POSITION : Motor.VELOCITY + 1]
        self.sample()

    def sample(self) -> None:
        """Read the shafts."""
        self._motors.turn_shafts()
        np.multiply(self._motors.shafts, self._ratio, self.turning)


class Sensors:
    """Readings of faultless sensors.

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
        self.values[Row.TEMPERATURE] = self._motors.temperature

    def alarm(self, code: FaultCode | None) -> None:
        """Set a hardware alarm on every joint, or clear it (None)."""
        self._alarm.fill(0.0 if code is None else 1.0 + code)

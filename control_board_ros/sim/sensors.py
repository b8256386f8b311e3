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


class Sensors:
    """Readings of faultless sensors.

    Attributes:
        values: Readings, shape (ROWS, n), reused from sample to sample.
        motors: What is measured at motors, their shafts before the gears and their supply, shape
            (MOTOR_ROWS, n), likewise.
        sample: Reads encoders, torque sensors, speeds, currents and shafts.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig, motors: Motors) -> None:
        constants = [joint.motor for joint in board.joints]
        encoders = [joint.encoder for joint in simulation.joints]
        self._motors = motors
        self.values = np.zeros((ROWS, len(encoders)))
        self.motors = np.zeros((MOTOR_ROWS, len(encoders)))
        self.motors[Motor.SUPPLY] = [motor.supply_voltage for motor in constants]
        self._alarm = self.values[Row.ALARM]
        zero = np.array([encoder.zero for encoder in encoders])
        resolution = np.array([encoder.resolution for encoder in encoders])
        counts = 1.0 / np.where(resolution > 0.0, resolution, 1.0)
        ratio = np.array(
            [
                motor.gear_ratio if encoder.motor else np.nan
                for motor, encoder in zip(constants, encoders, strict=True)
            ],
            dtype=np.float64,
        )
        truth = (motors.position, motors.velocity, motors.torque, motors.current, *motors.shafts)
        rows = [self.values[row] for row in (Row.POSITION, Row.VELOCITY, Row.TORQUE, Row.CURRENT)]
        rows += [self.motors[row] for row in (Motor.POSITION, Motor.VELOCITY)]
        self.sample = self._sample = Sampler(
            [row.data for row in truth],
            [row.data for row in rows],
            [row.data for row in (zero, counts, resolution)],
            ratio.data,
        ).sample
        if board.motor_coupling is not None:
            self.sample = self._sample_coupled

    def _sample_coupled(self) -> None:
        self._motors.turn_shafts()
        self._sample()

    def sample_temperature(self) -> None:
        self.values[Row.TEMPERATURE] = self._motors.temperature

    def alarm(self, code: FaultCode | None) -> None:
        """Set a hardware alarm on every joint, or clear it (None)."""
        self._alarm.fill(0.0 if code is None else 1.0 + code)

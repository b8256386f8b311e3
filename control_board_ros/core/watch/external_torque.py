# SPDX-License-Identifier: Apache-2.0
"""Joint torques from outside the board: computed, or measured by another program (SPEC Y5).

A joint whose torques are missing has no torque sensor (I7) until they arrive again.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..config.config import BoardConfig, JointConfig
from ..state import StateArrays
from ..terms.arguments import Array
from ..terms.measurement import Measurement, Row
from ..terms.modes import INITIAL_INTERACTION, SENSE_TORQUE, UNPOWERED, Law, law_of

#: Laws that follow a torque: without one, the joint is in fault.
FOLLOWS_TORQUE = frozenset({Law.TORQUE, Law.IMPEDANCE})
#: Age of the torque before the first one, s.
UNRECEIVED_AGE = 1e3


class ExternalTorques:
    """The last torques of joints that receive them from outside.

    Args:
        config: of the board.
        state: whose modes determine what needs a torque.

    Attributes: joints (numbers of those that receive one), known (which joints have a torque now,
    sensed or received, shape (n,)).
    """

    def __init__(self, config: BoardConfig, state: StateArrays) -> None:
        self._state = state
        self._torques, self._stamps = np.zeros(state.n), np.full(state.n, -UNRECEIVED_AGE)
        self.known = np.array([joint.torque_sensor for joint in config.joints])
        self.reconfigure(config)
        self.known[self.joints] = False

    def reconfigure(self, config: BoardConfig) -> None:
        """Set new timeouts; joints with a torque keep it."""
        self._config = config
        self.joints = [j for j, joint in enumerate(config.joints) if joint.external_torque]
        self._timeouts = [config.joints[j].timeouts.torque_sensor for j in self.joints]
        self._without = {j: without_torque(config.joints[j]) for j in self.joints}
        self._per_ampere = np.array([joint.motor.torque_per_ampere for joint in config.joints])

    def take(self, j: int, torque: float) -> None:
        """Set the torque of a joint, N·m."""
        self._torques[j], self._stamps[j] = torque, self._state.time

    def joint(self, j: int) -> JointConfig:
        """The present configuration of a joint: without a torque, without TORQUE and COMPLIANT."""
        if j in self._without and not self.known[j]:
            return self._without[j]
        return self._config.joints[j]

    def fill(self, measurement: Measurement) -> Measurement:
        """A reading with the torques received; the others from the currents of the motors.

        A torque that is too old ages only where a law follows it: there it is a fault.
        """
        values: Array = measurement.values.copy()
        modes, interactions = self._state.control_modes, self._state.interaction_modes
        for j, timeout in zip(self.joints, self._timeouts, strict=True):
            age = measurement.time - self._stamps[j]
            self.known[j] = 0.0 <= age <= timeout
            follows = law_of(modes[j], interactions[j]) in FOLLOWS_TORQUE
            values[Row.TORQUE_AGE, j] = age if follows else 0.0
            values[Row.TORQUE, j] = (
                self._torques[j] if self.known[j] else values[Row.CURRENT, j] * self._per_ampere[j]
            )
        return replace(measurement, values=values)


def without_torque(joint: JointConfig) -> JointConfig:
    """The configuration of a joint without a torque sensor (I7)."""
    calibration = joint.calibration
    if calibration is not None:
        calibration = replace(
            calibration, control_mode=UNPOWERED, interaction_mode=INITIAL_INTERACTION
        )
    return replace(
        joint,
        torque_sensor=False,
        external_torque=False,
        control_modes=tuple(m for m in joint.control_modes if m not in SENSE_TORQUE),
        interaction_modes=tuple(m for m in joint.interaction_modes if m not in SENSE_TORQUE),
        startup_interaction=INITIAL_INTERACTION,
        calibration=calibration,
    )

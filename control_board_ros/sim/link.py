# SPDX-License-Identifier: Apache-2.0
"""The link of a board to simulated drives that close loops of their own (SPEC S7)."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from ..core.config.config import BoardConfig
from ..core.terms.measurement import VALUES, Actuation, Array, SetPoints, Value
from .config import SimulationConfig
from .motor import Motors
from .watchdogs import Watchdogs


class DriveLink:
    """Passes set-points to simulated drives, with the delay and the steps of their models.

    Args:
        board: With the delay of each drive, whole control cycles of which count.
        simulation: With the model of each drive.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig) -> None:
        models = [joint.drive_model for joint in simulation.joints]
        n = len(models)
        self._everybody = np.arange(n)
        self._watchdogs = Watchdogs(board, simulation)
        delays = [round(joint.drive_delay * board.control_rate) for joint in board.joints]
        self._delays = np.array(delays)
        self._past = [SetPoints.off(n)] * (1 + int(self._delays.max()))
        self._steps = np.zeros((VALUES, n))
        self._steps[Value.POSITION] = [model.resolution for model in models]
        self._steps[Value.TORQUE] = [model.torque_resolution for model in models]

    @property
    def reasons(self) -> Mapping[int, str]:
        """What each drive whose watchdog struck reports, by joint."""
        return self._watchdogs.reasons

    def pass_on(self, actuation: Actuation, motors: Motors, deaf: Collection[int]) -> Actuation:
        """Give the drives what reaches them in this cycle; PWM and power of it.

        Args:
            actuation: Of the board.
            motors: That follow.
            deaf: Joints whose drive receives nothing.
        """
        self._past = [actuation.set_points(), *self._past[:-1]]
        now = self._watchdogs.pass_on(self._arriving(), deaf, motors.position)
        motors.follow(now.kinds.tolist(), self._in_steps(now.values).T.tolist())
        return Actuation(now.pwm, now.powered.astype(np.float64), brakes=actuation.brakes)

    def _arriving(self) -> SetPoints:
        if not self._delays.any():
            return self._past[0]
        kinds = np.array([past.kinds for past in self._past])[self._delays, self._everybody]
        values = np.array([past.values for past in self._past])[self._delays, :, self._everybody]
        return SetPoints(kinds, values.T, (kinds != 0).astype(np.float64))

    def _in_steps(self, values: Array) -> Array:
        """Values as whole multiples of their steps, where they have one."""
        if not self._steps.any():
            return values
        steps = np.where(self._steps > 0.0, self._steps, 1.0)
        rounded: Array = np.where(self._steps > 0.0, np.rint(values / steps) * steps, values)
        return rounded

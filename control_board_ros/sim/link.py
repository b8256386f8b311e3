# SPDX-License-Identifier: Apache-2.0
"""The link of a board to simulated drives that close loops of their own (SPEC S7).

Their watchdogs are here: what each drive does without commands (S5).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np

from ..core.config.config import BoardConfig
from ..core.terms.drives import OnSilence, SetPoint
from ..core.terms.measurement import VALUES, Actuation, Array, SetPoints, Value
from .config import SimulationConfig
from .motor import Motors
from .wire import Wire

#: What a drive follows when its watchdog strikes: braked, the position of that cycle.
STRUCK = {
    OnSilence.FREE: SetPoint.OFF,
    OnSilence.DAMPED: SetPoint.PWM,  # of 0: the windings are shorted
    OnSilence.BRAKED: SetPoint.POSITION,
}


class Watchdogs:
    """The last set-points that each drive received, and the time since.

    Args:
        board: With the reaction of each joint to missing commands.
        simulation: With the time of each watchdog.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig) -> None:
        seconds = [joint.drive_model.watchdog for joint in simulation.joints]
        self._cycles = [math.ceil(s * board.control_rate) if s else math.inf for s in seconds]
        self._then = [STRUCK[joint.on_silence] for joint in board.joints]
        self._texts = [f"watchdog: no command for {1e3 * s:.0f} ms" for s in seconds]
        self._last_received = SetPoints.off(len(seconds))
        self._silent = [0] * len(seconds)
        self._struck: dict[int, float] = {}

    @property
    def reasons(self) -> Mapping[int, str]:
        """The reports of drives whose watchdog struck, by joint, until they receive OFF twice."""
        return {joint: self._texts[joint] for joint in self._struck}

    def pass_on(self, arriving: SetPoints, deaf: Collection[int], position: Array) -> SetPoints:
        """What the drives follow in this cycle.

        Args:
            arriving: The set-points that arrive.
            deaf: Joints whose drive receives nothing.
            position: Of the joints, shape (n,).
        """
        if not deaf and not self._struck:
            self._last_received = arriving
            self._silent = [0] * len(self._silent)
            return arriving
        kinds, values = arriving.kinds.copy(), arriving.values.copy()
        released = arriving.released.copy()
        for j in range(len(kinds)):
            if j not in deaf:
                self._silent[j] = 0
                if kinds[j] == SetPoint.OFF and self._last_received.kinds[j] == SetPoint.OFF:
                    self._struck.pop(j, None)
                continue
            kinds[j], values[:, j] = self._last_received.kinds[j], self._last_received.values[:, j]
            released[j] = self._last_received.released[j]
            self._silent[j] += 1
            if self._silent[j] > self._cycles[j] and kinds[j] != SetPoint.OFF:
                self._struck.setdefault(j, float(position[j]))
        self._last_received = SetPoints(kinds.copy(), values.copy(), released.copy())
        for j, place in self._struck.items():
            kinds[j], values[:, j] = self._then[j], 0.0
            if kinds[j] == SetPoint.POSITION:
                values[Value.POSITION, j] = place
        return SetPoints(kinds, values, released)


class DriveLink:
    """Passes set-points to simulated drives, with the delay and the steps of their models.

    Args:
        board: With the delay of each drive, whole control cycles of which count.
        simulation: With the model of each drive.
        wire: On which set-points are late or lost; None: on none.
    """

    def __init__(
        self, board: BoardConfig, simulation: SimulationConfig, wire: Wire | None = None
    ) -> None:
        self._wire, self._cycle = wire, 0
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
        """The reports of drives whose watchdog struck, by joint."""
        return self._watchdogs.reasons

    def pass_on(self, actuation: Actuation, motors: Motors, deaf: Collection[int]) -> Actuation:
        """Pass on the set-points that arrive in this cycle; returns their PWM and power.

        Args:
            actuation: Of the board.
            motors: That follow.
            deaf: Joints whose drive receives nothing.
        """
        self._past = [actuation.set_points(), *self._past[:-1]]
        arriving = self._arriving()
        if self._wire is not None:
            arriving, missed = self._wire.to_drives(self._cycle, arriving)
            deaf = missed.union(deaf)
            self._cycle += 1
        now = self._watchdogs.pass_on(arriving, deaf, motors.position)
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

# SPDX-License-Identifier: Apache-2.0
"""The watchdogs of simulated drives: what each does without commands (SPEC S5, S7)."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

from ..core.config.config import BoardConfig
from ..core.terms.drives import OnSilence, SetPoint
from ..core.terms.measurement import Array, SetPoints, Value
from .config import SimulationConfig

#: What a drive follows when its watchdog strikes: braked, the position of that cycle.
STRUCK = {
    OnSilence.FREE: SetPoint.OFF,
    OnSilence.DAMPED: SetPoint.PWM,  # of 0: the windings are shorted
    OnSilence.BRAKED: SetPoint.POSITION,
}


class Watchdogs:
    """The last set-points that each drive received, and the time since.

    Args:
        board: With what each joint does in silence.
        simulation: With the time of each watchdog.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig) -> None:
        seconds = [joint.drive_model.watchdog for joint in simulation.joints]
        self._cycles = [math.ceil(s * board.control_rate) if s else math.inf for s in seconds]
        self._then = [STRUCK[joint.on_silence] for joint in board.joints]
        self._texts = [f"watchdog: no command for {1e3 * s:.0f} ms" for s in seconds]
        self._heard = SetPoints.off(len(seconds))
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
            self._heard = arriving
            return arriving
        kinds, values, released = (
            arriving.kinds.copy(),
            arriving.values.copy(),
            arriving.released.copy(),
        )
        for j in range(len(kinds)):
            if j not in deaf:
                self._silent[j] = 0
                if kinds[j] == SetPoint.OFF and self._heard.kinds[j] == SetPoint.OFF:
                    self._struck.pop(j, None)
                continue
            kinds[j], values[:, j] = self._heard.kinds[j], self._heard.values[:, j]
            released[j] = self._heard.released[j]
            self._silent[j] += 1
            if self._silent[j] > self._cycles[j] and kinds[j] != SetPoint.OFF:
                self._struck.setdefault(j, float(position[j]))
        self._heard = SetPoints(kinds.copy(), values.copy(), released.copy())
        for j, place in self._struck.items():
            kinds[j], values[:, j] = self._then[j], 0.0
            if kinds[j] == SetPoint.POSITION:
                values[Value.POSITION, j] = place
        return SetPoints(kinds, values, released)

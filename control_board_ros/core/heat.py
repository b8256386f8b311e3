# SPDX-License-Identifier: Apache-2.0
"""The heat of the motors: I²t, the warnings before a fault, and the time to wait after one (F6).

I²t adds up what a powered motor's current has above its nominal one and lets go what it has
below; a motor without power heats nothing, whatever its current sensor says::

    s' = max(0, s + (p i² − i_nom²) Δt)     p: 1 with power, 0 without;  A² s
    fault at s > S = (i_peak² − i_nom²) · overload_time; clear again, and warned, at 0.8 S
    time to wait without power: (s − 0.8 S) / i_nom²

A winding without power cools as T(t) = T_amb + (T_0 − T_amb) exp(−t/τ); the time until T_c is
τ ln((T_0 − T_amb)/(T_c − T_amb)). τ is ``motor.thermal_time``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .config import BoardConfig
from .measurement import Array

#: Part of the I²t budget that is warned of, and below which an I²t fault can be cleared.
STRAINED = 0.8
#: K below the temperature limit that are warned of.
HOT = 10.0
#: How far below a warning its cause must fall until it is warned of again: budget, K.
RELIEF = np.array([[0.1], [2.0]])


class Heat:
    """I²t and warnings of n motors.

    Attributes: strained (who is warned of, I²t and temperature, flags, shape (2, n)), news (it
    has changed since somebody has set this to false).
    """

    def __init__(self, config: BoardConfig, overload: Array) -> None:
        n = len(overload)
        self._overload = overload
        self._warn = np.zeros((2, n))
        self._now = np.zeros((2, n))
        self.strained: NDArray[np.bool_] = np.zeros((2, n), dtype=np.bool_)
        self.news = False
        self.reconfigure(config)

    def reconfigure(self, config: BoardConfig) -> None:
        """Take new limits; what has been heated so far is kept."""
        limits = [joint.limits for joint in config.joints]
        self._motors = [joint.motor for joint in config.joints]
        self._nominal = np.array([limit.nominal_current for limit in limits]) ** 2
        peak = np.array([limit.peak_current for limit in limits]) ** 2
        self.budget = (peak - self._nominal) * [limit.overload_time for limit in limits]
        self._warn[0] = STRAINED
        self._warn[1] = [limit.temperature - HOT for limit in limits]

    def look(self, current: Array, live: Array, temperature: Array, period: float) -> None:
        """Let some time pass, s, at a current; shape (n,) each, live: 1 with power, 0 without."""
        overload = self._overload
        overload += (current**2 * live - self._nominal) * period
        np.maximum(overload, 0.0, out=overload)
        np.divide(overload, self.budget, out=self._now[0])
        self._now[1] = temperature
        strained = self._now > np.where(self.strained, self._warn - RELIEF, self._warn)
        if strained.tobytes() != self.strained.tobytes():
            self.strained, self.news = strained, True

    @property
    def used(self) -> Array:
        """The part of the I²t budget that is used up, shape (n,); a fault above 1."""
        used: Array = self._now[0].copy()
        return used

    def warnings(self, j: int, before: NDArray[np.bool_]) -> list[tuple[str, str]]:
        """What to warn of, that was not before: keys and texts.

        Args:
            j: the joint.
            before: ``strained`` when this was last asked.
        """
        limits = self._warn[1, j] + HOT
        texts = (
            ("I2t", f"at {100.0 * self._now[0, j]:.0f} % of its I2t limit; take load away"),
            (
                "temperature",
                f"winding at {self._now[1, j]:.0f} °C, its limit is {limits:.0f} °C; "
                "take load away",
            ),
        )
        fresh = self.strained[:, j] & ~before[:, j]
        return [text for text, new in zip(texts, fresh, strict=True) if new]

    def overload_advice(self, j: int, period: float) -> str:
        """What to do until an I²t fault can be cleared; period: from one look to the next, s."""
        above = float(self._overload[j]) - STRAINED * float(self.budget[j])
        wait = max(above, 0.0) / float(self._nominal[j]) + 2.0 * period
        return f"wait {_tenths(wait)} s; no power heats it meanwhile"

    def cooling_advice(self, j: int, temperature: float, until: float) -> str:
        """What to do until an over-temperature fault can be cleared; °C."""
        motor = self._motors[j]
        start, end = temperature - motor.ambient, until - motor.ambient
        if motor.thermal_time == 0.0 or not math.isfinite(start) or end <= 0.0:
            return f"wait until it is below {until:.0f} °C"
        wait = motor.thermal_time * math.log(max(start / end, 1.0))
        return f"wait {_tenths(wait + 0.1)} s, until it is below {until:.0f} °C"


def _tenths(seconds: float) -> str:
    """Rounded up: who waits that long has waited long enough."""
    return f"{math.ceil(10.0 * seconds) / 10.0:.1f}"

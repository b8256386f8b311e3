# SPDX-License-Identifier: Apache-2.0
"""The heat of the motors: the warnings before a fault, and the time to wait after one (F6).

I²t integrates a powered motor's current above its nominal one and decays below it; an unpowered
motor does not heat, whatever its current sensor reports (``monitor``)::

    s' = max(0, s + (p i² − i_nom²) Δt)     p: 1 with power, 0 without;  A² s
    fault at s > S = (i_peak² − i_nom²) · overload_time; clear again, and warned, at 0.8 S
    time to wait without power: (s − 0.8 S) / i_nom²

A winding without power cools as T(t) = T_amb + (T_0 − T_amb) exp(−t/τ); the time until T_c is
τ ln((T_0 − T_amb)/(T_c − T_amb)). τ is ``motor.thermal_time``.
"""

from __future__ import annotations

import math

from ..config.parts import Limits, Motor
from .monitor import JointMonitor

#: Part of the I²t budget that is warned of, and below which an I²t fault can be cleared.
STRAINED = 0.8
#: K below the temperature limit that are warned of.
HOT = 10.0


def heat_constants(limits: Limits) -> dict[str, float]:
    """The limits of a joint for its monitor; attributes of JointMonitor."""
    nominal = limits.nominal_current**2
    return {
        "nominal_squared": nominal,
        "budget": (limits.peak_current**2 - nominal) * limits.overload_time,
        "warn_used": STRAINED,
        "warn_temperature": limits.temperature - HOT,
    }


def warnings(monitor: JointMonitor) -> dict[str, str]:
    """What to warn of, as the last look found it: keys and texts."""
    found = {}
    if monitor.strained:
        found["I2t"] = f"at {100.0 * monitor.used:.0f} % of its I2t limit; reduce its load"
    if monitor.hot:
        found["temperature"] = (
            f"winding at {monitor.temperature:.0f} °C, its limit is "
            f"{monitor.warn_temperature + HOT:.0f} °C; reduce its load"
        )
    return found


def overload_time(monitor: JointMonitor, period: float) -> float:
    """How long until an I²t fault can be cleared, s; period: from one look to the next, s."""
    above = monitor.overload - STRAINED * monitor.budget
    return float(max(above, 0.0) / monitor.nominal_squared) + 2.0 * period


def cooling_time(motor: Motor, temperature: float, until: float) -> float:
    """How long until an over-temperature fault can be cleared, s; 0: not known; °C."""
    start, end = temperature - motor.ambient, until - motor.ambient
    if motor.thermal_time == 0.0 or not math.isfinite(start) or end <= 0.0:
        return 0.0
    return motor.thermal_time * math.log(max(start / end, 1.0)) + 0.1


def cooling_advice(wait: float, until: float) -> str:
    """What to do until an over-temperature fault can be cleared; s, °C."""
    if wait == 0.0:
        return f"wait until it is below {until:.0f} °C"
    return f"wait {tenths(wait)} s, until it is below {until:.0f} °C"


def tenths(seconds: float) -> str:
    """Rounded up: who waits that long has waited long enough."""
    return f"{math.ceil(10.0 * seconds) / 10.0:.1f}"

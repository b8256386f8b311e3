# SPDX-License-Identifier: Apache-2.0
"""Causes of faults in words, and how long until they can be gone (SPEC F3, F6).

I²t integrates a powered motor's current above its nominal one and decays below it; an unpowered
motor does not heat, whatever its current sensor reports (F6)::

    s' = max(0, s + (p i² − i_nom²) Δt)     p: 1 with power, 0 without;  A² s
    fault at s > S = (i_peak² − i_nom²) · overload_time; clear again, and warned, at 0.8 S
    time to wait without power: (s − 0.8 S) / i_nom²

A winding without power cools as T(t) = T_amb + (T_0 − T_amb) exp(−t/τ); the time until T_c is
τ ln((T_0 − T_amb)/(T_c − T_amb)). τ is ``motor.thermal_time``.
"""

from __future__ import annotations

import math
from enum import IntEnum

from ..config.config import JointConfig
from ..config.parts import Limits, Motor
from ..terms.faults import Cause, FaultCode
from ..terms.measurement import CREDIBLE, Row
from .monitor import JointMonitor

#: Part of the I²t budget that raises a warning, and below which an I²t fault can be cleared.
I2T_WARNING_SHARE = 0.8
#: Distance to the temperature limit that raises a warning, K.
HEAT_MARGIN = 10.0


def heat_constants(limits: Limits) -> dict[str, float]:
    """The limits of a joint for its monitor; attributes of JointMonitor."""
    nominal = limits.nominal_current**2
    return {
        "nominal_squared": nominal,
        "budget": (limits.peak_current**2 - nominal) * limits.overload_time,
        "warn_used": I2T_WARNING_SHARE,
        "warn_temperature": limits.temperature - HEAT_MARGIN,
    }


def warnings(monitor: JointMonitor) -> dict[str, str]:
    """The warnings of the last check: texts by key."""
    texts = {}
    if monitor.strained:
        texts["I2t"] = f"at {100.0 * monitor.used:.0f} % of its I2t limit; reduce its load"
    if monitor.hot:
        texts["temperature"] = (
            f"winding at {monitor.temperature:.0f} °C, its limit is "
            f"{monitor.warn_temperature + HEAT_MARGIN:.0f} °C; reduce its load"
        )
    return texts


def overload_time(monitor: JointMonitor, period: float) -> float:
    """Time until an I²t fault can be cleared, s; period: of the slow checks, s."""
    above = monitor.overload - I2T_WARNING_SHARE * monitor.budget
    return float(max(above, 0.0) / monitor.nominal_squared) + 2.0 * period


def cooling_time(motor: Motor, temperature: float, until: float) -> float:
    """Time until an over-temperature fault can be cleared, s; 0: not known; °C."""
    start, end = temperature - motor.ambient, until - motor.ambient
    if motor.thermal_time == 0.0 or not math.isfinite(start) or end <= 0.0:
        return 0.0
    return motor.thermal_time * math.log(max(start / end, 1.0)) + 0.1


def cooling_advice(wait: float, until: float) -> str:
    """The remedy of an over-temperature fault; s, °C."""
    if wait == 0.0:
        return f"wait until it is below {until:.0f} °C"
    return f"wait {tenths(wait)} s, until it is below {until:.0f} °C"


def tenths(seconds: float) -> str:
    """A time with one digit, rounded up, s."""
    return f"{math.ceil(10.0 * seconds) / 10.0:.1f}"


class Check(IntEnum):
    """The checks of the monitor, in the order of its search for a cause; ``code``: its fault's."""

    code: FaultCode

    def __new__(cls, number: int, code: FaultCode = FaultCode.EXTERNAL) -> Check:
        """A check by its number in the monitor and the code of its fault."""
        check = int.__new__(cls, number)
        check._value_, check.code = number, code
        return check

    ALARM = 1, FaultCode.EXTERNAL
    CURRENT = 2, FaultCode.OVERCURRENT
    ENCODER_AGE = 3, FaultCode.ENCODER_SILENT
    POSITION = 4, FaultCode.ENCODER_SPIKE
    VELOCITY = 5, FaultCode.ENCODER_INVALID
    TORQUE_AGE = 6, FaultCode.TORQUE_SENSOR
    TORQUE = 7, FaultCode.TORQUE_SENSOR
    TEMPERATURE = 8, FaultCode.OVERHEATING
    TRAVEL = 9, FaultCode.ENCODER_MISMATCH
    OVERRUN = 10, FaultCode.HARD_LIMIT
    OVERLOAD = 11, FaultCode.I2T
    OVERSPEED = 12, FaultCode.OVERSPEED


def bound_cause(check: Check, monitor: JointMonitor, joint: JointConfig, value: float) -> Cause:
    """The cause when a reading has passed a bound.

    Args:
        check: Which bound, of a row of the same name.
        monitor: Of the joint.
        joint: Its configuration.
        value: The reading.
    """
    if not abs(value) <= CREDIBLE:
        code = FaultCode.ENCODER_INVALID if check is Check.POSITION else check.code
        reads = f"reads {value:.3g}, which no sensor does"
        return Cause(code, reads if math.isfinite(value) else "the reading is not a number")
    if check is Check.ALARM:
        return alarm_cause(value)
    unit, torque_unit = joint.kind.unit, joint.kind.force_unit
    hottest = monitor.max_temperature
    jump = f"{monitor.max_jump:.3g} {unit}"
    late = f"no sample for {value * 1e3:.0f} ms > "
    texts = {
        Check.CURRENT: f"{abs(value):.3g} A > {monitor.max_current:.3g} A",
        Check.ENCODER_AGE: f"{late}{monitor.max_encoder_age * 1e3:.0f} ms",
        Check.POSITION: f"the reading jumped by more than {jump} off its motion in a cycle",
        Check.TORQUE_AGE: f"{late}{monitor.max_torque_age * 1e3:.0f} ms",
        Check.TORQUE: f"reads {value:.3g} {torque_unit}, out of its range",
        Check.TEMPERATURE: f"winding at {value:.0f} °C > {hottest:.0f} °C",
    }
    if check is Check.TEMPERATURE:
        wait = cooling_time(joint.motor, value, hottest)
        return Cause(check.code, texts[check], cooling_advice(wait, hottest), wait)
    return Cause(check.code, texts[check])


def slow_cause(check: Check, monitor: JointMonitor, joint: JointConfig, period: float) -> Cause:
    """The cause when a slow check has failed; period: of the slow checks, s."""
    code, limits = check.code, joint.limits
    unit = joint.kind.unit
    if check is Check.TRAVEL:
        return Cause(
            code,
            f"encoder and motor disagree by {abs(monitor.travel):.3g} {unit} > "
            f"{monitor.max_travel:.3g} {unit}: frozen, slipping or reversed",
        )
    if check is Check.OVERRUN:
        past = abs(monitor.overrun) - monitor.max_overrun + limits.hard_margin
        return Cause(
            code,
            f"{past:.3g} {unit} beyond the hard stop > {limits.hard_margin:.3g} {unit}",
        )
    if check is Check.OVERSPEED:
        return Cause(
            code,
            f"faster than {monitor.max_velocity:.3g} {joint.kind.unit}/s, 1.5 times its limit",
            "check sign, encoder and gains of its drive",
        )
    wait = overload_time(monitor, period)
    return Cause(
        code,
        f"more than {limits.nominal_current:.3g} A nominal for too long "
        f"(I2t: {limits.overload_time:.3g} s at peak)",
        f"wait {tenths(wait)} s; without power it does not heat up",
        wait,
    )


def alarm_cause(value: float) -> Cause:
    """The cause of an ALARM of the hardware: 1 + a fault code."""
    alarm = int(value) - 1 if math.isfinite(value) else 0
    code = FaultCode(alarm) if alarm in set(FaultCode) else FaultCode.EXTERNAL
    texts = {
        FaultCode.EXTERNAL: "the external fault line is active (emergency stop)",
        FaultCode.EMERGENCY_STOP: "requested",
        FaultCode.DIVERGED: "the simulation diverged; its last good state is back",
    }
    return Cause(code, texts.get(code, "raised by the hardware"))


#: The row of a reading that each bound is for.
ROWS_OF = {check: Row[check.name] for check in Check if check < Check.TRAVEL}

# SPDX-License-Identifier: Apache-2.0
"""Why a joint must be in HW_FAULT, in words (SPEC F3)."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from ..config.config import JointConfig
from ..terms.faults import FaultCode
from ..terms.measurement import CREDIBLE, Row
from .heat import cooling_advice, cooling_time, overload_time, tenths
from .monitor import JointMonitor


class Check(IntEnum):
    """What the monitor checks, in the order in which it looks for a cause."""

    ALARM = 1
    CURRENT = 2
    ENCODER_AGE = 3
    POSITION = 4
    VELOCITY = 5
    TORQUE_AGE = 6
    TORQUE = 7
    TEMPERATURE = 8
    TRAVEL = 9
    OVERRUN = 10
    OVERLOAD = 11


CODES = {
    Check.ALARM: FaultCode.EXTERNAL,
    Check.CURRENT: FaultCode.OVERCURRENT,
    Check.ENCODER_AGE: FaultCode.ENCODER_SILENT,
    Check.POSITION: FaultCode.ENCODER_SPIKE,
    Check.VELOCITY: FaultCode.ENCODER_INVALID,
    Check.TORQUE_AGE: FaultCode.TORQUE_SENSOR,
    Check.TORQUE: FaultCode.TORQUE_SENSOR,
    Check.TEMPERATURE: FaultCode.OVERHEATING,
    Check.TRAVEL: FaultCode.ENCODER_MISMATCH,
    Check.OVERRUN: FaultCode.HARD_LIMIT,
    Check.OVERLOAD: FaultCode.I2T,
}


class Cause(NamedTuple):
    """Why a joint must be in HW_FAULT: the code, what was measured against what, the way out.

    ``wait``: until it can be gone, s; 0 where time alone does not help.
    """

    code: FaultCode
    text: str
    advice: str = "remove it"
    wait: float = 0.0


def bound_cause(check: Check, monitor: JointMonitor, joint: JointConfig, value: float) -> Cause:
    """The cause when a reading has passed a bound.

    Args:
        check: Which bound, of a row of the same name.
        monitor: Of the joint.
        joint: Its configuration.
        value: The reading.
    """
    if not abs(value) <= CREDIBLE:
        code = FaultCode.ENCODER_INVALID if check is Check.POSITION else CODES[check]
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
        return Cause(CODES[check], texts[check], cooling_advice(wait, hottest), wait)
    return Cause(CODES[check], texts[check])


def slow_cause(check: Check, monitor: JointMonitor, joint: JointConfig, period: float) -> Cause:
    """The cause when a slow check has failed; period: from one look to the next, s."""
    code, limits = CODES[check], joint.limits
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
    wait = overload_time(monitor, period)
    return Cause(
        code,
        f"more than {limits.nominal_current:.3g} A nominal for too long "
        f"(I2t: {limits.overload_time:.3g} s at peak)",
        f"wait {tenths(wait)} s; no power heats it meanwhile",
        wait,
    )


def alarm_cause(value: float) -> Cause:
    """What the hardware raises by itself: 1 + a fault code."""
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

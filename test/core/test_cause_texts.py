# SPDX-License-Identifier: Apache-2.0
"""Causes of faults in words, and how long until they can be gone (SPEC F3, F6)."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from rig import LIMITS, MOTOR, joint

from control_board_ros.core.terms.faults import Cause, FaultCode
from control_board_ros.core.watch.causes import (
    ROWS_OF,
    Check,
    alarm_cause,
    bound_cause,
    cooling_advice,
    cooling_time,
    heat_constants,
    overload_time,
    slow_cause,
    tenths,
    warnings,
)
from control_board_ros.core.watch.monitor import JointMonitor

#: 5 A nominal, 10 A peak, 2 s: a budget of 150 A² s; 120 °C.
HEATED = replace(LIMITS, nominal_current=5.0, peak_current=10.0, overload_time=2.0)


def monitor(**values: float) -> JointMonitor:
    made = JointMonitor()
    made.set(heat_constants(HEATED) | values)
    return made


def test_constants_of_heat() -> None:
    assert heat_constants(HEATED) == {
        "nominal_squared": 25.0,
        "budget": 150.0,
        "warn_used": 0.8,
        "warn_temperature": 110.0,
    }


@pytest.mark.parametrize(
    ("check", "value", "code", "text"),
    [
        (Check.CURRENT, -12.5, FaultCode.OVERCURRENT, "12.5 A > 10 A"),
        (Check.ENCODER_AGE, 0.031, FaultCode.ENCODER_SILENT, "no sample for 31 ms > 20 ms"),
        (
            Check.POSITION,
            3.0,
            FaultCode.ENCODER_SPIKE,
            "the reading jumped by more than 0.0321 rad off its motion in a cycle",
        ),
        (Check.TORQUE_AGE, 0.052, FaultCode.TORQUE_SENSOR, "no sample for 52 ms > 40 ms"),
        (Check.TORQUE, -6100.0, FaultCode.TORQUE_SENSOR, "reads -6.1e+03 N·m, out of its range"),
        (Check.POSITION, 2e9, FaultCode.ENCODER_INVALID, "reads 2e+09, which no sensor does"),
        (Check.POSITION, math.nan, FaultCode.ENCODER_INVALID, "the reading is not a number"),
        (Check.VELOCITY, math.inf, FaultCode.ENCODER_INVALID, "the reading is not a number"),
        (Check.CURRENT, -2e9, FaultCode.OVERCURRENT, "reads -2e+09, which no sensor does"),
        (Check.TORQUE, math.nan, FaultCode.TORQUE_SENSOR, "the reading is not a number"),
        (Check.ALARM, 2e9, FaultCode.EXTERNAL, "reads 2e+09, which no sensor does"),
    ],
)
def test_a_reading_beyond_its_bound(
    check: Check, value: float, code: FaultCode, text: str
) -> None:
    """F3: in the unit of the joint, which turns or slides."""
    own = monitor(
        max_current=10.0,
        max_encoder_age=0.02,
        max_jump=0.0321,
        max_torque_age=0.04,
        max_torque=6000.0,
    )
    assert bound_cause(check, own, joint("j"), value) == Cause(code, text)
    slides = text.replace(" rad ", " m ").replace("N·m", "N")
    assert bound_cause(check, own, joint("j", kind="prismatic"), value) == Cause(code, slides)


def test_a_hot_winding() -> None:
    """τ ln((T − T_amb)/(T_c − T_amb)), and a tenth of a second."""
    motor = replace(MOTOR, thermal_time=100.0, ambient=20.0)
    own = monitor(max_temperature=110.0)
    wait = 100.0 * math.log(105.0 / 90.0) + 0.1
    cause = bound_cause(Check.TEMPERATURE, own, joint("j", motor=motor), 125.0)
    assert cause.code is FaultCode.OVERHEATING
    assert cause.text == "winding at 125 °C > 110 °C"
    assert cause.advice == "wait 15.6 s, until it is below 110 °C"
    assert cause.wait == pytest.approx(wait)
    unknown = bound_cause(Check.TEMPERATURE, own, joint("j"), 125.0)
    assert unknown[2:] == ("wait until it is below 110 °C", 0.0)


@pytest.mark.parametrize(
    ("time", "temperature", "until", "wait"),
    [
        (0.0, 125.0, 110.0, 0.0),
        (100.0, math.inf, 110.0, 0.0),
        (100.0, 125.0, 20.0, 0.0),  # it never gets colder than what is around it
        (100.0, 125.0, 19.0, 0.0),
        (100.0, 20.0 + 0.5 * math.e, 20.5, 100.1),  # half a kelvin above it is enough
        (100.0, 100.0, 110.0, 0.1),  # it is cold enough by now
        (100.0, 20.0 + 90.0 * math.e, 110.0, 100.1),
    ],
)
def test_time_to_cool(time: float, temperature: float, until: float, wait: float) -> None:
    motor = replace(MOTOR, thermal_time=time, ambient=20.0)
    assert cooling_time(motor, temperature, until) == pytest.approx(wait)
    assert cooling_advice(0.0, 109.6) == "wait until it is below 110 °C"


def test_times_are_rounded_up() -> None:
    assert [tenths(s) for s in (0.0, 0.01, 1.0, 1.01, 12.34)] == [
        "0.0", "0.1", "1.0", "1.1", "12.4",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("value", "code", "text"),
    [
        (1.0 + 0, FaultCode.EXTERNAL, "the external fault line is active (emergency stop)"),
        (1.0 + FaultCode.EMERGENCY_STOP, FaultCode.EMERGENCY_STOP, "requested"),
        (
            1.0 + FaultCode.DIVERGED,
            FaultCode.DIVERGED,
            "the simulation diverged; its last good state is back",
        ),
        (1.0 + FaultCode.DRIVE, FaultCode.DRIVE, "raised by the hardware"),
        (1.0 + FaultCode.PLANT, FaultCode.PLANT, "raised by the hardware"),
        (99.0, FaultCode.EXTERNAL, "the external fault line is active (emergency stop)"),
        (math.nan, FaultCode.EXTERNAL, "the external fault line is active (emergency stop)"),
        (math.inf, FaultCode.EXTERNAL, "the external fault line is active (emergency stop)"),
    ],
)
def test_causes_raised_by_the_hardware(value: float, code: FaultCode, text: str) -> None:
    assert alarm_cause(value) == Cause(code, text)
    if value < 90.0:
        assert bound_cause(Check.ALARM, monitor(), joint("j"), value) == Cause(code, text)


@pytest.mark.parametrize(("kind", "unit"), [("revolute", "rad"), ("prismatic", "m")])
def test_causes_found_by_a_slow_check(kind: str, unit: str) -> None:
    one = joint("j", kind=kind, limits={"hard_margin": 0.05})
    travelled = monitor(max_travel=0.04)
    travelled.travel = -0.0512
    assert slow_cause(Check.TRAVEL, travelled, one, 0.016) == Cause(
        FaultCode.ENCODER_MISMATCH,
        f"encoder and motor disagree by 0.0512 {unit} > 0.04 {unit}: frozen, slipping or reversed",
    )
    overrun = monitor(max_overrun=2.25)
    overrun.overrun = -2.27
    assert slow_cause(Check.OVERRUN, overrun, one, 0.016) == Cause(
        FaultCode.HARD_LIMIT, f"0.07 {unit} beyond the hard stop > 0.05 {unit}"
    )


def test_an_overload() -> None:
    """The budget decays by i_nom² without power, to 80 %; and two looks."""
    one = replace(joint("j"), limits=HEATED)
    own = monitor()
    own.overload = 151.0
    wait = (151.0 - 120.0) / 25.0 + 2.0 * 0.016
    assert overload_time(own, 0.016) == pytest.approx(wait)
    code, text, advice, until = slow_cause(Check.OVERLOAD, own, one, 0.016)
    assert code is FaultCode.I2T
    assert text == "more than 5 A nominal for too long (I2t: 2 s at peak)"
    assert advice == "wait 1.3 s; without power it does not heat up"
    assert until == pytest.approx(wait)
    own.overload = 100.0
    assert overload_time(own, 0.016) == pytest.approx(2.0 * 0.016)


def test_warnings_of_heat() -> None:
    own = monitor()
    own.strained = own.hot = False
    assert warnings(own) == {}
    own.overload, own.used, own.strained = 129.0, 0.86, True
    assert warnings(own) == {"I2t": "at 86 % of its I2t limit; reduce its load"}
    own.strained, own.hot, own.temperature = False, True, 113.4
    assert warnings(own) == {
        "temperature": "winding at 113 °C, its limit is 120 °C; reduce its load"
    }


def test_each_bound_has_its_row() -> None:
    assert list(ROWS_OF) == [check for check in Check if check < Check.TRAVEL]
    assert all(check.name == row.name for check, row in ROWS_OF.items())

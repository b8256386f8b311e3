# SPDX-License-Identifier: Apache-2.0
"""What crosses between board and plant: readings, and what drives follow (SPEC S1, S3, B3)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.measurement import (
    HAS,
    ROWS,
    VALUES,
    Actuation,
    Intake,
    Measurement,
    Row,
    SetPoints,
    Value,
)

S = SetPoint
PERIOD = 0.01


def reading(time: float = 5.0, count: int = 2) -> Measurement:
    return Measurement(time, np.arange(ROWS * count, dtype=np.float64).reshape(ROWS, count))


def test_a_reading_is_copied_unchanged() -> None:
    given = reading()
    assert Intake(2, PERIOD).take(given) is given
    assert Intake(2, PERIOD).take(reading(-1e9)).time == -1e9


@pytest.mark.parametrize("time", [math.nan, math.inf, -math.inf, 1.1e9, -1.1e9])
def test_a_reading_without_a_time_is_an_alarm_of_all_joints(time: float) -> None:
    """B3: one period after the last reading."""
    intake = Intake(2, PERIOD)
    intake.take(reading(5.0))
    for k in (1, 2):
        found = intake.take(reading(time))
        assert found.time == pytest.approx(5.0 + k * PERIOD)
        assert found.values.shape == (ROWS, 2)
        assert found.values[Row.ALARM].tolist() == [1.0 + FaultCode.PLANT] * 2
        assert np.isnan(np.delete(found.values, Row.ALARM, axis=0)).all()
        assert found.reasons == dict.fromkeys((0, 1), f"its reading is stamped {time:g} s")


@pytest.mark.parametrize(
    ("values", "what"),
    [
        (np.zeros((ROWS, 3)), f"float64 of shape ({ROWS}, 3)"),
        (np.zeros((ROWS, 2), dtype=np.float32), f"float32 of shape ({ROWS}, 2)"),
        ([[0.0, 0.0]] * ROWS, f"list of shape ({ROWS}, 2)"),
        (None, "NoneType of shape ()"),
    ],
)
def test_a_reading_of_another_shape_is_an_alarm_of_all_joints(values: Any, what: str) -> None:
    found = Intake(2, PERIOD).take(Measurement(3.0, values))
    assert found.time == PERIOD
    why = f"its reading is {what}; float64 of ({ROWS}, 2) is wanted"
    assert found.reasons == {0: why, 1: why}


def test_time_continues_from_the_last_reading() -> None:
    intake = Intake(2, PERIOD)
    intake.take(Measurement(3.0, None))  # type: ignore[arg-type]
    assert intake.take(reading(7.0)).time == 7.0
    assert intake.take(reading(math.nan)).time == pytest.approx(7.0 + PERIOD)


def test_set_points_of_drives_that_accept_pwm_only() -> None:
    pwm, powered = np.array([1.0, 2.0]), np.array([1.0, 0.0])
    found = Actuation(pwm, powered).set_points()
    assert found.kinds.tolist() == [S.PWM, S.OFF]
    assert found.kinds.dtype == np.int8
    assert found.pwm.tolist() == [1.0, 0.0]
    assert found.values.shape == (VALUES, 2)
    assert not found.values[1:].any()
    assert found.released.tolist() == [1.0, 0.0]
    assert found.powered.tolist() == [True, False]
    pwm[0] = powered[1] = 9.0
    assert (found.pwm[0], found.released[1]) == (1.0, 0.0)


def test_each_kind_has_its_own_values() -> None:
    """S1: what a kind does not have is 0; brakes as they are asked for."""
    kinds = np.array([S.PWM, S.CURRENT, S.TORQUE, S.VELOCITY, S.POSITION, S.IMPEDANCE, S.POSITION])
    powered = np.array([1.0] * 6 + [0.0])
    values = np.full((VALUES, 7), 5.0)
    brakes = np.array([0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0])
    found = Actuation(np.full(7, 3.0), powered, kinds.astype(np.int8), values, brakes).set_points()
    assert found.kinds.tolist() == [*range(1, 7), S.OFF]
    assert found.released.tolist() == (1.0 - brakes).tolist()
    expected = {
        "pwm": [3.0, 0, 0, 0, 0, 0, 0],
        "current": [0, 5.0, 0, 0, 0, 0, 0],
        "torque": [0, 0, 5.0, 5.0, 5.0, 5.0, 0],
        "velocity": [0, 0, 0, 5.0, 5.0, 5.0, 0],
        "position": [0, 0, 0, 0, 5.0, 5.0, 0],
        "stiffness": [0, 0, 0, 0, 0, 5.0, 0],
        "damping": [0, 0, 0, 0, 0, 5.0, 0],
    }
    for name, row in expected.items():
        assert getattr(found, name).tolist() == row, name
        assert found.values[Value[name.upper()]].tolist() == row
    assert (values == 5.0).all()  # the board's own array stays as it is
    assert HAS.sum(axis=1).tolist() == [0, 1, 1, 1, 2, 3, 5]


def test_no_joint_has_power() -> None:
    off = SetPoints.off(3)
    assert not off.powered.any()
    assert not off.values.any()
    assert not off.released.any()
    assert off.values.shape == (VALUES, 3)
    for array in (off.kinds, off.values, off.released):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 1


@pytest.mark.parametrize(
    ("name", "value", "shape"),
    [
        ("applied", np.zeros(3), "(3,); (2,)"),
        ("brakes", np.zeros((1, 2)), "(1, 2); (2,)"),
        ("motors", np.zeros((2, 2)), "(2, 2); (3, 2)"),
    ],
)
def test_a_reading_with_a_row_of_another_shape_is_an_alarm(
    name: str, value: Any, shape: str
) -> None:
    """B3: of what a plant may leave out, too."""
    found = replace(reading(5.0), **{name: value})
    taken = Intake(2, PERIOD).take(found)
    why = f"its reading has {name} of shape {shape} is wanted"
    assert taken.reasons == {0: why, 1: why}
    assert taken.applied is taken.brakes is taken.motors is None

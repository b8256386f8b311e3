# SPDX-License-Identifier: Apache-2.0
"""calibration.py: types of one's own."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest
from rig import joint

from control_board_ros.core.calibration import calibration
from control_board_ros.core.calibration.calibration import AbsoluteSensor, HardStop, register
from control_board_ros.core.config.config import Calibration


@pytest.fixture(autouse=True)
def _own_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Types entered by a test are gone after it."""
    for table in ("TYPES", "CALIBRATION_TYPES"):
        monkeypatch.setattr(calibration, table, dict(getattr(calibration, table)))


@pytest.mark.parametrize("number", [-1, 0, 3, 5, 12, 13])
def test_a_number_that_no_type_may_have(number: int) -> None:
    """K: 1 to 12, and not taken; nothing is entered."""
    before = dict(calibration.TYPES)
    with pytest.raises(ValueError, match=f"calibration type {number}: choose a free one"):
        register(number, "my own")
    assert before == calibration.TYPES


@pytest.mark.parametrize("number", [1, 2, 11])
def test_a_free_number_is_entered_with_its_text(number: int) -> None:
    """K: the decorated class is that type from then on, and no other class is."""
    assert register(number, "my own")(AbsoluteSensor) is AbsoluteSensor
    assert calibration.TYPES[number] is AbsoluteSensor
    assert calibration.CALIBRATION_TYPES[number] == "my own"
    with pytest.raises(ValueError, match="choose a free one"):
        register(number, "another")


def test_a_freed_top_number_may_be_taken() -> None:
    """K: 12 is the last number, not the first beyond."""
    del calibration.TYPES[12]
    register(12, "my own")(AbsoluteSensor)
    assert calibration.TYPES[12] is AbsoluteSensor


@pytest.mark.parametrize("cycles", [1, 4])
def test_a_stall_lasts_as_long_as_is_asked(cycles: int) -> None:
    """K5, type 5: the set control cycles without a motion of encoder and motor, no fewer."""
    config = joint("a")
    stall = Calibration(type=5, required=True, output=10.0, stall_time=0.25 * cycles, stop=0.0)
    still = SimpleNamespace(
        joint=config,
        reading=1.0,
        travelled=1.0,
        current=config.motor.stall_current(10.0),
        drive=lambda _: None,
    )
    course = HardStop(stall, cast("Any", still), 0.25)._meet("driving", 0.1)
    assert list(course) == ["driving"] * cycles

# SPDX-License-Identifier: Apache-2.0
"""SPEC F7: a joint with power that is measured much faster than its limit is in fault."""

from __future__ import annotations

import pytest
from rig import LIMITS, M, Rig, held

from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.measurement import Row

#: Readings in a row that are a fault; the velocity above which they count.
READINGS, FASTEST = 5, 1.5 * LIMITS.velocity


def measured(rig: Rig, velocity: float, cycles: int) -> M:
    """The left joint's mode after some readings of a velocity."""
    rig.plant.values[Row.VELOCITY, 0] = velocity
    rig.tick(cycles)
    return rig.modes()[0]


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("mode", ["pos", "vel", "open"])
def test_five_readings_beyond_half_as_much_again_are_a_fault(mode: str, way: float) -> None:
    """F7: either way round, in any mode with power; of that joint only."""
    rig = held()
    rig.enter(mode)
    assert measured(rig, 1.01 * way * FASTEST, READINGS - 1) is not M.HW_FAULT
    assert measured(rig, 1.01 * way * FASTEST, 1) is M.HW_FAULT
    assert rig.board.get_faults("left")[0].code == FaultCode.OVERSPEED
    assert M.HW_FAULT not in rig.modes()[1:]


def test_fewer_or_slower_readings_are_none() -> None:
    """F7: a slower one between begins the count anew."""
    rig = held()
    rig.enter("pos")
    for _ in range(3):
        assert measured(rig, 1.01 * FASTEST, READINGS - 1) is M.POSITION
        assert measured(rig, 0.99 * FASTEST, 1) is M.POSITION
    assert measured(rig, 0.99 * FASTEST, 10 * READINGS) is M.POSITION


def test_a_joint_without_power_may_be_moved_faster() -> None:
    """F7: somebody pushes it."""
    rig = held()
    rig.enter("idle")
    assert measured(rig, 2.0 * FASTEST, 10 * READINGS) is M.IDLE


def test_one_reading_that_is_kept_is_counted_once() -> None:
    """F7: a drive that is silent for some cycles has not been measured again."""
    rig = held()
    rig.enter("pos")
    rig.tick(10)
    rig.plant.values[Row.VELOCITY, 0] = 1.01 * FASTEST
    rig.tick()
    rig.plant.values[Row.ENCODER_AGE, 0] = rig.period
    for _ in range(READINGS):
        rig.tick()
        rig.plant.values[Row.ENCODER_AGE, 0] += rig.period
    assert rig.modes()[0] is M.POSITION

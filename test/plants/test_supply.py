# SPDX-License-Identifier: Apache-2.0
"""Drives whose supply sags, and servos that store what they are told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from drive_bench import Bench

from control_board_ros.core.terms.drives import SetPoint

#: Most s that a page of flash takes to erase; see dynamixel's control_table.
ERASING = 0.04
OFF, POSITION, VELOCITY = SetPoint.OFF, SetPoint.POSITION, SetPoint.VELOCITY
#: By driver: how its drive gets a supply, V; those at which it works, and does not; its fault.
Feed = Callable[[Any, float], object]
SUPPLIES: dict[str, tuple[Feed, float, float, str]] = {
    "moteus": (lambda drive, volts: setattr(drive, "supply", volts), 24.0, 3.0, "under voltage"),
    "mit_can": (
        lambda drive, volts: drive.registers.update({60: volts}), 24.0, 14.0, "under-voltage",
    ),
    "odrive_can": (
        lambda drive, volts: setattr(drive, "supply", volts), 24.0, 10.0, "DC bus under voltage",
    ),
    "cia402": (
        lambda drive, volts: setattr(drive, "supply", volts), 48.0, 17.0,
        "DC link under-voltage",
    ),
    "dynamixel": (
        lambda drive, volts: setattr(drive.motor, "supply", volts), 12.0, 9.0, "input voltage",
    ),
    "feetech": (
        lambda drive, volts: setattr(drive.motor, "supply", volts), 7.4, 3.8, "input voltage",
    ),
}  # fmt: skip


@pytest.mark.parametrize("make", SUPPLIES)
def test_a_supply_that_sags_is_a_fault_until_it_is_back(make: str) -> None:
    """Two of the makes keep their torque, as delivered: the board takes it."""
    feed, enough, little, name = SUPPLIES[make]
    kind = SetPoint.IMPEDANCE if make == "mit_can" else POSITION
    with Bench(make) as bench:
        bench.connect()
        bench.follow(kind, 40)
        feed(bench.drives[0], little)
        found = bench.until(lambda found: bool(found.faults[0]), kind)
        assert name in str(found.faults[0])
        assert not found.faults[1]
        bench.follow(OFF, 20)
        assert bench.drives[0].torque == 0.0
        bench.plant.clear_fault(0)
        bench.follow(OFF, 60)
        bench.until(lambda found: bool(found.faults[0]), kind)
        feed(bench.drives[0], enough)
        for _ in range(5):
            bench.plant.clear_fault(0)
            found = bench.follow(OFF, 60)
        assert not any(found.faults)
        bench.follow(kind, 60)
        assert not any(bench.follow(kind, 60).faults)


@pytest.mark.parametrize("make", ["dynamixel", "feetech"])
def test_a_servo_that_is_deaf_while_it_stores_changes_its_mode(make: str) -> None:
    """A page of flash takes up to 40 ms; what comes meanwhile is lost."""
    options = {"unwatched": "1"} if make == "feetech" else {}
    with Bench(make, options=options) as bench:
        for drive in bench.drives:
            drive.storing = ERASING
        bench.connect()
        for kind in (POSITION, VELOCITY, POSITION):
            values = {"velocity": 0.3} if kind is VELOCITY else {"position": 0.2}
            for _ in range(300):
                found = bench.follow(kind, **values)
                assert not any(found.faults)
        assert np.abs(found.position - 0.2).max() < 5e-3

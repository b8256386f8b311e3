# SPDX-License-Identifier: Apache-2.0
"""Virtual drives, operated by the buses of LeRobot."""

from __future__ import annotations

import pytest
from apart import run_apart

SERVOS = ["is found", "is calibrated", "moves", "is cleared", "has another id"]
#: By driver: what its program says in the end, errors of the servos aside.
DONE = {
    "feetech": SERVOS,
    "dynamixel": SERVOS,
    "mit_can": ["is found", "moves", "is without torque", "has another zero"],
}


@pytest.mark.slow
@pytest.mark.parametrize("driver", DONE)
def test_lerobot_operates_its_motors(driver: str) -> None:
    """Find, configure, calibrate, move, read, hear of a fault, clear it, and set up another id."""
    said = run_apart("lerobot", "lerobot_buses.py", driver)
    errors = [line for line in said if line not in DONE[driver]]
    assert [line for line in said if line not in errors] == DONE[driver]
    assert len(errors) == (driver != "mit_can"), errors

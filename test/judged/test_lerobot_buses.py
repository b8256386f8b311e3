# SPDX-License-Identifier: Apache-2.0
"""Virtual drives, operated by the buses of LeRobot."""

from __future__ import annotations

import pytest
from apart import run_apart

SERVOS = ["is found", "is calibrated", "moves", "is cleared", "has another id"]
MOTORS = ["is without torque", "has another zero"]
#: By make: what its program says in the end, errors of the servos aside.
DONE = {
    "feetech": SERVOS,
    "dynamixel": SERVOS,
    "damiao": ["is found", "moves", *MOTORS],
    "robstride": ["is found", "moves", "is cleared", *MOTORS],
}


@pytest.mark.slow
@pytest.mark.parametrize("make", DONE)
def test_lerobot_operates_its_motors(make: str) -> None:
    """Find, configure, calibrate, move, read, hear of a fault, clear it, and set up another id."""
    said = run_apart("lerobot", "lerobot_buses.py", make)
    errors = [line for line in said if line not in DONE[make]]
    assert [line for line in said if line not in errors] == DONE[make]
    assert len(errors) == (DONE[make] is SERVOS), errors

# SPDX-License-Identifier: Apache-2.0
"""Who judged a driver's virtual drives: clients of others that operate them (test/judged)."""

from __future__ import annotations

#: When the versions below last ran.
JUDGED = "2026-11-27"
#: By driver; a device side of another hand under the driver has "(device)".
JUDGES: dict[str, tuple[str, ...]] = {
    "moteus": ("moteus and moteus_tool 1.1.1",),
    "mit_can": (
        "damiao-motor 1.0.6",
        "motorbridge 0.5.6",
        "LeRobot 0.4.4",
        "robstride-dynamics 0.0.1",
    ),
    "dynamixel": ("dynamixel-sdk 4.1.0", "dynamixel-python 0.0.8", "LeRobot 0.4.4"),
    "cia402": ("canopen 2.4.1", "durand 0.5.0 (device)"),
    "odrive_can": ("odrive-can 2.1.0",),
    "feetech": (
        "feetech-cli 0.1.8",
        "st3215-bus 0.1.1",
        "ftservo-python-sdk 2.0.1",
        "LeRobot 0.4.4",
        "feetech-cli's SimulatedBus (device)",
    ),
}


def judgement(driver: str) -> str:
    """What is known of a driver in the box, in one line."""
    by = ", ".join(JUDGES[driver])
    return f"{driver}: judged by {by} on {JUDGED}; it has run on no motor yet"

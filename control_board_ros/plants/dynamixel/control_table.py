# SPDX-License-Identifier: Apache-2.0
"""The control table of an XM430-W350 under the maker's names, as it leaves the factory.

Addresses and sizes: ``xm430_w350.model`` of the maker's dynamixel-sdk 4.1.0. Access, values at
delivery and ranges: e-manual, DYNAMIXEL X, XM430-W350, sections "Control Table of EEPROM Area" and
"Control Table of RAM Area" (emanual.robotis.com/docs/en/dxl/x/xm430-w350).
"""

from __future__ import annotations

from typing import NamedTuple

from ..drives.serial_line import Item
from ..virtual.servo import Table
from . import table as t


class Row(NamedTuple):
    """An item of the table.

    Attributes:
        item: Its place.
        value: At delivery, or after each start.
        low, high: Least and largest value that it accepts; equal ones: it is read only.
    """

    item: Item
    value: int = 0
    low: int = 0
    high: int = 0

    @property
    def writable(self) -> bool:
        return self.low != self.high

    def parse(self, data: bytes) -> int:
        return int.from_bytes(data, "little", signed=self.low < 0)


#: N·m/A and Ω at 12 V: stall at 4.1 N·m and 2.3 A (the same page, "Specifications"); its friction
#: is not published.
MOTOR = (4.1 / 2.3, 12.0 / 2.3, 12.0)
#: Most s that its processor takes to erase a page of flash (data sheet of the STM32F103, "Flash
#: memory characteristics"); what the servo takes to store a value is not published.
ERASING = 0.04
#: Where RAM begins; what is before it is kept without power, and locked with torque on.
RAM = 64
SIZE = 1024
PROFILE = 32767
ROWS = {
    "Model Number": Row(t.MODEL, 1020),
    "Model Information": Row(Item(2, 4)),
    "Firmware Version": Row(t.FIRMWARE, 45),
    "ID": Row(t.ID, 1, 0, 252),
    "Baud Rate": Row(Item(8, 1), 1, 0, 7),
    "Return Delay Time": Row(Item(9, 1), 250, 0, 254),
    "Drive Mode": Row(Item(10, 1), 0, 0, 13),
    "Operating Mode": Row(t.MODE, t.POSITION_MODE, 0, 16),
    "Secondary(Shadow) ID": Row(Item(12, 1), 255, 0, 255),
    "Protocol Type": Row(Item(13, 1), 2, 1, 2),
    "Homing Offset": Row(Item(20, 4), 0, -1_044_479, 1_044_479),
    "Moving Threshold": Row(Item(24, 4), 10, 0, 1023),
    "Temperature Limit": Row(Item(31, 1), 80, 0, 100),
    "Max Voltage Limit": Row(Item(32, 2), 160, 95, 160),
    "Min Voltage Limit": Row(Item(34, 2), 95, 95, 160),
    "PWM Limit": Row(t.PWM_LIMIT, t.FULL_PWM, 0, t.FULL_PWM),
    "Current Limit": Row(t.CURRENT_LIMIT, 1193, 0, 1193),
    "Velocity Limit": Row(t.VELOCITY_LIMIT, 200, 0, 1023),
    "Max Position Limit": Row(t.MAX_POSITION, 4095, 0, 4095),
    "Min Position Limit": Row(t.MIN_POSITION, 0, 0, 4095),
    "Shutdown": Row(Item(63, 1), 52, 0, 61),
    "Torque Enable": Row(t.TORQUE, 0, 0, 1),
    "LED": Row(Item(65, 1), 0, 0, 1),
    "Status Return Level": Row(Item(68, 1), 2, 0, 2),
    "Registered Instruction": Row(Item(69, 1)),
    "Hardware Error Status": Row(t.ERROR),
    "Velocity I Gain": Row(Item(76, 2), 1920, 0, 16383),
    "Velocity P Gain": Row(Item(78, 2), 100, 0, 16383),
    "Position D Gain": Row(Item(80, 2), 0, 0, 16383),
    "Position I Gain": Row(Item(82, 2), 0, 0, 16383),
    "Position P Gain": Row(Item(84, 2), 800, 0, 16383),
    "Feedforward 2nd Gain": Row(Item(88, 2), 0, 0, 16383),
    "Feedforward 1st Gain": Row(Item(90, 2), 0, 0, 16383),
    "Bus Watchdog": Row(t.WATCHDOG, 0, 0, 127),
    "Goal PWM": Row(t.GOAL_PWM, t.FULL_PWM, -t.FULL_PWM, t.FULL_PWM),
    "Goal Current": Row(t.GOAL_CURRENT, 1193, -1193, 1193),
    "Goal Velocity": Row(t.GOAL_VELOCITY, 0, -1023, 1023),
    "Profile Acceleration": Row(Item(108, 4), 0, 0, PROFILE),
    "Profile Velocity": Row(Item(112, 4), 0, 0, PROFILE),
    "Goal Position": Row(t.GOAL_POSITION, 0, -1_048_575, 1_048_575),
    "Realtime Tick": Row(Item(120, 2)),
    "Moving": Row(Item(122, 1)),
    "Moving Status": Row(Item(123, 1)),
    "Present PWM": Row(Item(124, 2)),
    "Present Current": Row(t.CURRENT),
    "Present Velocity": Row(t.VELOCITY),
    "Present Position": Row(t.POSITION),
    "Velocity Trajectory": Row(Item(136, 4)),
    "Position Trajectory": Row(Item(140, 4)),
    "Present Input Voltage": Row(t.VOLTAGE),
    "Present Temperature": Row(t.TEMPERATURE),
}
(BAUD_RATE, DRIVE_MODE, HOMING, MAX_VOLTAGE, MIN_VOLTAGE, SHUTDOWN, RETURN_LEVEL, REGISTERED,
 PROFILE_VELOCITY, PRESENT_PWM) = (
    ROWS[name].item
    for name in ("Baud Rate", "Drive Mode", "Homing Offset", "Max Voltage Limit",
                 "Min Voltage Limit", "Shutdown", "Status Return Level", "Registered Instruction",
                 "Profile Velocity", "Present PWM")
)  # fmt: skip
BAUDRATES = (9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
MODES = (t.CURRENT_MODE, t.VELOCITY_MODE, t.POSITION_MODE, t.EXTENDED, 5, t.PWM_MODE)
#: Items that a change of mode resets (the same page, "Operating Mode(11)").
OF_MODE = [row for name, row in ROWS.items() if "Gain" in name or name.startswith("Profile ")]
#: Items whose value is bounded by that of another, either way.
BOUNDS = {t.GOAL_PWM: t.PWM_LIMIT, t.GOAL_CURRENT: t.CURRENT_LIMIT,
          t.GOAL_VELOCITY: t.VELOCITY_LIMIT}  # fmt: skip
#: Indirect addresses and their data: two blocks of 28.
BLOCKS = ((t.INDIRECT, t.DATA), (578, 634))
COUNT = 28
#: Items by their first address, those of indirect addresses with them.
AT = {row.item.address: row for row in ROWS.values()} | {
    addresses + 2 * k: Row(Item(addresses + 2 * k, 2), data + k, RAM, SIZE - 1)
    for addresses, data in BLOCKS
    for k in range(COUNT)
}
#: The item of each byte.
OF = {row.item.address + k: row for row in AT.values() for k in range(row.item.length)}
#: The indirect address of each byte of indirect data.
POINTERS = {
    data + k: Item(addresses + 2 * k, 2) for addresses, data in BLOCKS for k in range(COUNT)
}
#: P, I and D of its loops and by what their items are divided, per count, or per unit of velocity,
#: and ms (the same page, "Position PID Gain(80, 82, 84)", "Velocity PI Gain(76, 78)"); they make
#: PWM of FULL_PWM. An MX-64's P is right so (Rhoban's BAM at 1b5a1ce, dynamixel/actuator.py: full
#: duty at 198 mrad by oscilloscope, 205 by this); an XL330's is half of it there.
POSITION_GAINS = (
    (ROWS["Position P Gain"].item, t.POSITION_P_STEP),
    (ROWS["Position I Gain"].item, 65536),
    (ROWS["Position D Gain"].item, 16),
)
VELOCITY_GAINS = ((ROWS["Velocity P Gain"].item, 128), (ROWS["Velocity I Gain"].item, 65536))


def gains(table: Table, items: tuple[tuple[Item, int], ...]) -> list[float]:
    """The gains of a loop, as shares of the supply."""
    return [table.get(item) / divisor / t.FULL_PWM for item, divisor in items]

# SPDX-License-Identifier: Apache-2.0
"""The memory table of an STS3215 under the maker's names, as it leaves the factory.

Addresses, values at delivery and ranges: the maker's memory table of the STS3215 (STS series,
protocol of 2022), as feetech-cli 0.1.8 (registers.py) and LeRobot 0.4.4 (motors/feetech/tables.py)
have it too. What is before TORQUE is kept without power where it is written with the lock open;
else it acts until the next start.
"""

from __future__ import annotations

from ..drives.serial_line import Item
from . import table as t

#: Item and value; those that are not here begin with 0.
DELIVERED = {
    "Firmware_Version": (t.FIRMWARE, 3 | 10 << 8),
    "Model_Number": (t.MODEL, 777),
    "ID": (t.ID, 1),
    "Baud_Rate": (Item(6, 1), 0),
    "Return_Delay_Time": (Item(7, 1), 0),
    "Response_Status_Level": (Item(8, 1), 1),
    "Min_Position_Limit": (t.MIN_POSITION, 0),
    "Max_Position_Limit": (t.MAX_POSITION, 4095),
    "Max_Temperature_Limit": (Item(13, 1), 70),
    "Max_Voltage_Limit": (Item(14, 1), 80),
    "Min_Voltage_Limit": (Item(15, 1), 40),
    "Max_Torque_Limit": (Item(16, 2), 1000),
    "Phase": (t.PHASE, 12),
    "Unloading_Condition": (Item(19, 1), 44),
    "LED_Alarm_Condition": (Item(20, 1), 47),
    "P_Coefficient": (t.P, 32),
    "D_Coefficient": (Item(22, 1), 32),
    "I_Coefficient": (Item(23, 1), 0),
    "Minimum_Startup_Force": (Item(24, 2), 16),
    "CW_Dead_Zone": (Item(26, 1), 1),
    "CCW_Dead_Zone": (Item(27, 1), 1),
    "Protection_Current": (t.CURRENT_LIMIT, 500),
    "Angular_Resolution": (t.ANGULAR_RESOLUTION, 1),
    "Homing_Offset": (t.HOMING, 0),
    "Operating_Mode": (t.MODE, 0),
    "Protective_Torque": (Item(34, 1), 20),
    "Protection_Time": (Item(35, 1), 200),
    "Overload_Torque": (Item(36, 1), 80),
    "Velocity_closed_loop_P_proportional_coefficient": (Item(37, 1), 10),
    "Over_Current_Protection_Time": (Item(38, 1), 200),
    "Velocity_closed_loop_I_integral_coefficient": (Item(39, 1), 200),
    "Torque_Limit": (t.TORQUE_LIMIT, 1000),
    "Maximum_Velocity_Limit": (t.SPEED_LIMIT, 254),
}
(BAUD_RATE, RETURN_LEVEL, MAX_VOLTAGE, MIN_VOLTAGE, MAX_TORQUE, UNLOADING, VELOCITY_P,
 VELOCITY_I) = (
    DELIVERED[name][0]
    for name in ("Baud_Rate", "Response_Status_Level", "Max_Voltage_Limit", "Min_Voltage_Limit",
                 "Max_Torque_Limit", "Unloading_Condition",
                 "Velocity_closed_loop_P_proportional_coefficient",
                 "Velocity_closed_loop_I_integral_coefficient")
)  # fmt: skip
BAUDRATES = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)
LOAD, REGISTERED, MOVING = Item(60, 2), Item(64, 1), Item(66, 1)
#: Bytes that a write changes; the others are read only.
WRITABLE = {*range(5, 56), *range(80, 87)}
#: Where RAM begins.
RAM = 40
#: Written to Torque_Enable: the present position becomes the middle of the turn.
CALIBRATE = 128

# SPDX-License-Identifier: Apache-2.0
"""The control table of the X series as published: addresses, lengths, units, models."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..drives.serial_line import Item, Library

MODEL, FIRMWARE, ID, MODE = Item(0, 2), Item(6, 1), Item(7, 1), Item(11, 1)
PWM_LIMIT, CURRENT_LIMIT, VELOCITY_LIMIT = Item(36, 2), Item(38, 2), Item(44, 4)
MAX_POSITION, MIN_POSITION = Item(48, 4), Item(52, 4)
TORQUE, ERROR, WATCHDOG = Item(64, 1), Item(70, 1), Item(98, 1)
POSITION_GAINS = Item(80, 6)  # D, I and P
GOAL_PWM, GOAL_CURRENT = Item(100, 2), Item(102, 2)
GOAL_VELOCITY, GOAL_POSITION = Item(104, 4), Item(116, 4)
CURRENT, VELOCITY, POSITION = Item(126, 2), Item(128, 4), Item(132, 4)
VOLTAGE, TEMPERATURE = Item(144, 2), Item(146, 1)
#: Indirect addresses; their data, which begin at DATA, or in firmware with fewer before it.
INDIRECT, DATA, DATA_OF_FEWER, LAST_FEWER = 168, 224, 208, 52
#: What is read in each exchange, one after the other in the indirect data.
READ = (TORQUE, ERROR, WATCHDOG, CURRENT, VELOCITY, POSITION, VOLTAGE, TEMPERATURE)
READ_LENGTH = sum(item.length for item in READ)
READ_FORMAT = "<BBBhiiHB"

CURRENT_MODE, VELOCITY_MODE, POSITION_MODE, EXTENDED, PWM_MODE = 0, 1, 3, 4, 16
MODES = {
    CURRENT_MODE: "current",
    VELOCITY_MODE: "velocity",
    POSITION_MODE: "position",
    EXTENDED: "extended position",
    5: "current-based position",
    PWM_MODE: "PWM",
}
LIBRARY = Library(
    "dynamixel_sdk",
    "dynamixel-sdk",
    "dynamixel",
    2.0,
    (False,),
    9,
    2,
    4,
    0x7F,
    MODEL,
    TORQUE,
    tuple(Item(0, length) for length in (3, 5, 7, 9)),
)
COUNT = 2.0 * math.pi / 4096.0  # rad
CENTRE = 2048
SPEED = 0.229 * 2.0 * math.pi / 60.0  # rad/s
FULL_PWM = 885
#: Counts of PWM per count of position that Position P Gain is divided by (e-manual, XM430-W350,
#: "Position PID Gain(80, 82, 84)").
POSITION_P_STEP = 128
VOLT = 0.1
WATCHDOG_STEP = 0.02  # s
TRIPPED = 255
ERRORS = {
    1: "input voltage",
    4: "overheating",
    8: "motor encoder",
    16: "electrical shock",
    32: "overload",
}


class Model(NamedTuple):
    """A model: its name, and A per count of current (0: it has no current control).

    Attributes: fewer (its firmware up to LAST_FEWER has 20 indirect addresses, not 28).
    """

    name: str
    ampere: float
    fewer: bool = False

    def data(self, firmware: int) -> int:
        """Where its indirect data begin."""
        return DATA_OF_FEWER if self.fewer and firmware <= LAST_FEWER else DATA


MODELS = {
    1000: Model("XH430-W350", 2.69e-3),
    1001: Model("XD430-T350", 2.69e-3),
    1010: Model("XH430-W210", 2.69e-3),
    1011: Model("XD430-T210", 2.69e-3),
    1020: Model("XM430-W350", 2.69e-3),
    1030: Model("XM430-W210", 2.69e-3),
    1040: Model("XH430-V350", 1.34e-3),
    1050: Model("XH430-V210", 1.34e-3),
    1060: Model("XL430-W250", 0.0),
    1070: Model("XC430-W150", 0.0),
    1080: Model("XC430-W240", 0.0),
    1090: Model("2XL430-W250", 0.0),
    1100: Model("XH540-W270", 2.69e-3),
    1101: Model("XD540-T270", 2.69e-3),
    1110: Model("XH540-W150", 2.69e-3),
    1111: Model("XD540-T150", 2.69e-3),
    1120: Model("XM540-W270", 2.69e-3),
    1130: Model("XM540-W150", 2.69e-3),
    1140: Model("XH540-V270", 1.34e-3),
    1150: Model("XH540-V150", 1.34e-3),
    1160: Model("2XC430-W250", 0.0),
    1170: Model("XW540-T260", 2.69e-3),
    1180: Model("XW540-T140", 2.69e-3),
    1190: Model("XL330-M077", 1e-3, fewer=True),
    1200: Model("XL330-M288", 1e-3, fewer=True),
    1210: Model("XC330-T181", 1e-3, fewer=True),
    1220: Model("XC330-T288", 1e-3, fewer=True),
    1230: Model("XC330-M181", 1e-3, fewer=True),
    1240: Model("XC330-M288", 1e-3, fewer=True),
    1270: Model("XW430-T333", 2.69e-3),
    1280: Model("XW430-T200", 2.69e-3),
    1310: Model("XW540-H260", 1.34e-3),
}

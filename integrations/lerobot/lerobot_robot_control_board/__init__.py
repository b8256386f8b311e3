# SPDX-License-Identifier: Apache-2.0
"""A control board as a robot and a teleoperator of LeRobot; importing it registers both."""

from .devices import (
    ControlBoardHand,
    ControlBoardHandConfig,
    ControlBoardRobot,
    ControlBoardRobotConfig,
)

__all__ = [
    "ControlBoardHand",
    "ControlBoardHandConfig",
    "ControlBoardRobot",
    "ControlBoardRobotConfig",
]

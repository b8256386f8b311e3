# SPDX-License-Identifier: Apache-2.0
"""Third-party plants: real motors, or another simulation, behind the same board (SPEC B).

An author writes a class with the methods of ``interface.DrivePlant``, or of ``RobotPlant`` where
the motors accept PWM only, and names what makes one in
the entry-point group ``control_board_ros.plants``; users choose it by ``plant:=name``.
"""

from ..core.terms.drives import DriveReport, OnSilence, SetPoint
from ..core.terms.measurement import SetPoints
from .interface import (
    Clock,
    Description,
    DriveFault,
    DriveLimits,
    DrivePlant,
    JointDescription,
    Readings,
    RobotPlant,
    Setup,
)

__all__ = [
    "Clock",
    "Description",
    "DriveFault",
    "DriveLimits",
    "DrivePlant",
    "DriveReport",
    "JointDescription",
    "OnSilence",
    "Readings",
    "RobotPlant",
    "SetPoint",
    "SetPoints",
    "Setup",
]

# SPDX-License-Identifier: Apache-2.0
"""Plants of somebody else: real motors, or another simulation, behind the same board (SPEC B).

An author writes a class with the methods of ``interface.RobotPlant``, and names what makes one in
the entry-point group ``control_board_ros.plants``; users choose it by ``plant:=name``.
"""

from .interface import Clock, Description, JointDescription, Readings, RobotPlant

__all__ = ["Clock", "Description", "JointDescription", "Readings", "RobotPlant"]

# SPDX-License-Identifier: Apache-2.0
"""CiA 402 drives on a CAN bus as a plant of control_board_ros, and simulated ones to try it."""

from .plant import CanopenPlant, make

__all__ = ["CanopenPlant", "make"]

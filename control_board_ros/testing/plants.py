# SPDX-License-Identifier: Apache-2.0
"""The name of ``plant_contract`` in version 0.x before it had a package of its own."""

from .plant_contract import board_for, plant_contract, setup_for
from .plant_contract import set_points as asked

__all__ = ["asked", "board_for", "plant_contract", "setup_for"]

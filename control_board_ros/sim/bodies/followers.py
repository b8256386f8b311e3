# SPDX-License-Identifier: Apache-2.0
"""Joints that follow joints of the board: multiplier · leader + offset."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.measurement import Array
from ...description.urdf import Mimic


class Followers:
    """Where the followers belong; nothing here knows the physics.

    Attributes:
        joints: Their names.
    """

    def __init__(self, mimics: Sequence[Mimic], board_names: Sequence[str]) -> None:
        self.joints = [mimic.follower for mimic in mimics]
        self._leaders = [board_names.index(mimic.leader) for mimic in mimics]
        self._multipliers = np.array([mimic.multiplier for mimic in mimics])
        self._offsets = np.array([mimic.offset for mimic in mimics])

    def targets(self, state: Array) -> tuple[list[float], list[float]]:
        """Their positions and velocities for those of the board's joints, shape (2, n)."""
        positions, velocities = state[:, self._leaders] * self._multipliers
        return (positions + self._offsets).tolist(), velocities.tolist()

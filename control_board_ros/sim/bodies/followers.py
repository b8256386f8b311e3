# SPDX-License-Identifier: Apache-2.0
"""Followers of the board's joints: multiplier · leader + offset."""

from __future__ import annotations

from collections.abc import Sequence

from ...core.terms.measurement import Array
from ...description.urdf import Mimic


class Followers:
    """Targets of the followers, independent of the physics; attribute ``joints``: their names."""

    def __init__(self, mimics: Sequence[Mimic], board_names: Sequence[str]) -> None:
        self.joints = [mimic.follower for mimic in mimics]
        self._followed = [
            (board_names.index(mimic.leader), mimic.multiplier, mimic.offset) for mimic in mimics
        ]

    def targets(self, state: Array) -> tuple[list[float], list[float]]:
        """Target positions and velocities for a state of the board's joints, shape (2, n)."""
        positions, velocities = state.tolist()
        return (
            [multiplier * positions[j] + offset for j, multiplier, offset in self._followed],
            [multiplier * velocities[j] for j, multiplier, _ in self._followed],
        )

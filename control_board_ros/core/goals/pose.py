# SPDX-License-Identifier: Apache-2.0
"""Poses: named joint positions (SPEC R5)."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, replace

#: Poses that every robot has.
HOME, PARK = "home", "park"
#: Names of poses.
NAME = re.compile(r"[A-Za-z0-9_]{1,64}")
#: Positions and speeds of poses are below it, in requests and in files, rad or m, per second.
MAX_VALUE = 1e9


@dataclass(frozen=True, slots=True)
class Pose:
    """Named joint positions.

    Attributes: name, joints (names), positions (one per joint, rad or m), speed (mean speed of
    the slowest joint, rad/s or m/s; 0: the reference speeds that are set).
    """

    name: str
    joints: tuple[str, ...]
    positions: tuple[float, ...]
    speed: float = 0.0

    def of(self, names: Collection[str]) -> Pose | None:
        """The pose of those of its joints that are in ``names``; None where there are none."""
        kept = self.besides([joint for joint in self.joints if joint not in names])
        return kept if kept.joints else None

    def besides(self, names: Collection[str]) -> Pose:
        """The pose without these joints."""
        kept = [k for k, joint in enumerate(self.joints) if joint not in names]
        return replace(
            self,
            joints=tuple(self.joints[k] for k in kept),
            positions=tuple(self.positions[k] for k in kept),
        )

    def joined(self, other: Pose) -> Pose:
        """The joints of both; name and speed are the other's."""
        return replace(
            other,
            joints=(*self.joints, *other.joints),
            positions=(*self.positions, *other.positions),
        )

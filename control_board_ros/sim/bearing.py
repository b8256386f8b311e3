# SPDX-License-Identifier: Apache-2.0
"""Stiction of the bearings, beyond the torque sensors: what holds a joint that is nearly balanced.

Most of a joint's Coulomb friction is the gearbox's (see ``motor``), before the torque sensor: a
torque loop makes up for it. The bearing has a little of it, beyond: a bristle that bends until it
slips (Dahl, 1968; with damping as LuGre has it), so that a joint at rest does not creep. Its
equations are in ``drive``; these are their constants.

B = min(0.02 % of the torque limit, 10 % of coulomb), σ = B/z with the bend z at which it slips.
z and the damping c keep the explicit integration stable at the least inertia M, and c damps the
largest one::

    z ≥ h² B/(0.05 M),    c = min(√(M_max σ), M/(2 h))
"""

from __future__ import annotations

import math

from ..core.config import JointConfig
from .config import MotorModel

OF_TORQUE, OF_COULOMB = 2e-4, 0.1
BEND, BEND_METRES = 1e-4, 1e-5


def bearing(
    joint: JointConfig, model: MotorModel, inertia: float, step: float
) -> tuple[float, float, float]:
    """B (N·m), σ h (N·m·s/rad) and c (N·m·s/rad) of a joint's bearing.

    Args:
        joint: Its configuration.
        model: Of its motor and gearbox.
        inertia: The least that the joint moves, kg·m².
        step: The physics step h, s.
    """
    slip = min(OF_TORQUE * joint.limits.torque, OF_COULOMB * model.coulomb)
    bend = BEND_METRES if joint.kind == "prismatic" else BEND
    bend = max(bend, step**2 * slip / (0.05 * inertia))
    stiffness = slip / bend
    largest = max(inertia, joint.inertia_max)
    damping = min(math.sqrt(largest * stiffness), inertia / (2.0 * step))
    return slip, stiffness * step, damping

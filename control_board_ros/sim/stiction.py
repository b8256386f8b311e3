# SPDX-License-Identifier: Apache-2.0
"""Stiction of a joint's bearing: the friction beyond the torque sensor that holds it at rest.

Most of a joint's Coulomb friction is the gearbox's (see ``motor``), before the torque sensor and
compensated by a torque loop. The bearing has a small part beyond: a bristle that bends until it
slips (Dahl, 1968; damped as in LuGre), so that a nearly balanced joint does not creep. Its
equations are in ``drive``; these are their constants.

B = min(0.02 % of the torque limit, 10 % of coulomb), σ = B/z with the deflection z at which it
slips. z and the damping c keep the explicit integration stable at the least inertia M, and c damps
the largest one::

    z ≥ h² B/(0.05 M),    c = min(√(M_max σ), M/(2 h))
"""

from __future__ import annotations

import math

from ..core.config.config import JointConfig
from .config import MotorModel

TORQUE_SHARE, COULOMB_SHARE = 2e-4, 0.1
SLIP_ANGLE, SLIP_DISTANCE = 1e-4, 1e-5  # z, rad and m


def bristle_constants(
    joint: JointConfig, model: MotorModel, inertia: float, step: float
) -> tuple[float, float, float]:
    """B (N·m), σ h (N·m·s/rad) and c (N·m·s/rad) of a joint's bearing.

    Args:
        joint: Its configuration.
        model: Of its motor and gearbox.
        inertia: Minimum moved inertia, kg·m².
        step: The physics step h, s.
    """
    torque = min(TORQUE_SHARE * joint.limits.torque, COULOMB_SHARE * model.coulomb)
    deflection = joint.kind.choose(SLIP_ANGLE, SLIP_DISTANCE)
    deflection = max(deflection, step**2 * torque / (0.05 * inertia))
    stiffness = torque / deflection
    largest = max(inertia, joint.inertia_max)
    damping = min(math.sqrt(largest * stiffness), inertia / (2.0 * step))
    return torque, stiffness * step, damping

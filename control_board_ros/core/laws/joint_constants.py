# SPDX-License-Identifier: Apache-2.0
"""What the laws know of a joint before it moves: its limits and its motor; ``control`` sets them.

Units: rad, rad/s, N·m, A, s; m and N for prismatic joints.
"""

from __future__ import annotations

from ... import nocython as cython
from .formulas import clamp


@cython.final
@cython.cclass
class Limits:
    """Limits of a joint: of the references, of the motor, and where the arm ends."""

    lower = upper = cython.declare(cython.double, visibility="public")
    edge = cython.declare(cython.double, visibility="public")  # hysteresis of on_limit
    velocity = acceleration = cython.declare(cython.double, visibility="public")
    jerk = cython.declare(cython.double, visibility="public")  # of moves and stops; 0: none
    torque = cython.declare(cython.double, visibility="public")
    output = cython.declare(cython.double, visibility="public")  # PWM, percent


@cython.final
@cython.cclass
class Motor:
    """Model of a joint's motor, gear and friction, seen from the joint."""

    inertia_min = inertia = cython.declare(cython.double, visibility="public")
    # by which the protection makes speed, and reduces it
    light_inertia = heavy_inertia = cython.declare(cython.double, visibility="public")
    # friction of motion in positive and in negative direction, N·m, N·m·s/rad, and the speed
    # from which on the dry part is whole, rad/s
    coulomb = coulomb_negative = cython.declare(cython.double, visibility="public")
    viscous = viscous_negative = cython.declare(cython.double, visibility="public")
    slip = cython.declare(cython.double, visibility="public")
    torque_per_ampere = cython.declare(cython.double, visibility="public")
    has_torque_sensor = cython.declare(cython.bint, visibility="public")
    ohms = cython.declare(cython.double, visibility="public")
    emf = cython.declare(cython.double, visibility="public")  # V·s/rad
    percent_per_volt = cython.declare(cython.double, visibility="public")
    lead = cython.declare(cython.double, visibility="public")  # a/(1 − a), a = exp(−T R/L)
    lag = cython.declare(cython.double, visibility="public")  # L/(T R) − a/(1 − a)

    @cython.cfunc
    def friction(self, velocity: cython.double) -> cython.double:
        """Friction at a velocity: clip(F_c v/v_slip, ± F_c) + F_v v, with F of its direction."""
        ahead: cython.bint = velocity >= 0.0
        dry = self.coulomb if ahead else self.coulomb_negative
        wet = self.viscous if ahead else self.viscous_negative
        if dry == 0.0:
            return wet * velocity
        return dry * clamp(velocity / self.slip, -1.0, 1.0) + wet * velocity

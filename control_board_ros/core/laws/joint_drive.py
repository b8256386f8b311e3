# SPDX-License-Identifier: Apache-2.0
"""How the drive of a joint takes what the laws give: its set-point, and what that is made with.

Units: rad, rad/s, N·m, A, s; m and N for prismatic joints.
"""

from __future__ import annotations

from ... import nocython as cython

#: Set-points of drives; drives.SetPoint gives them names.
AS_PWM = cython.declare(cython.int, 1)
AS_CURRENT = cython.declare(cython.int, 2)
AS_TORQUE = cython.declare(cython.int, 3)
AS_VELOCITY = cython.declare(cython.int, 4)
AS_POSITION = cython.declare(cython.int, 5)
AS_IMPEDANCE = cython.declare(cython.int, 6)


@cython.final
@cython.cclass
class Drive:
    """Which set-point a drive takes, and what turns the laws' torque into it; ``control`` sets it.

    The drive's value is a PWM in percent, a current in A, or a torque in N·m.
    """

    kind = cython.declare(cython.int, visibility="public")  # AS_...
    in_amps = cython.declare(cython.bint, visibility="public")  # the value is a current
    max = cython.declare(cython.double, visibility="public")  # of the value, as the laws give it
    delay = cython.declare(cython.double, visibility="public")  # beyond a period, s
    pursuit = cython.declare(cython.double, visibility="public")  # velocity per error, 1/s
    per_torque = cython.declare(cython.double, visibility="public")  # value per N·m
    per_speed = cython.declare(cython.double, visibility="public")  # value per rad/s: back-EMF
    compensation = cython.declare(cython.double, visibility="public")  # compensated part of it
    per_feed = cython.declare(cython.double, visibility="public")  # value per percent of u_ff

    def __init__(self) -> None:
        self.kind = AS_PWM


@cython.final
@cython.cclass
class SetPoint:
    """What a drive is given that takes no PWM, by the law of the last cycle."""

    current = torque = velocity = cython.declare(cython.double, visibility="public")
    position = stiffness = damping = cython.declare(cython.double, visibility="public")
    request = cython.declare(cython.double, visibility="public")  # value for the torque alone
    sag = cython.declare(cython.double, visibility="public")  # beyond goal or reference
    trail = cython.declare(cython.double, visibility="public")  # of a stop, fading, likewise

    @cython.cfunc
    def total(self) -> cython.double:
        """The sum of its values: finite where all of them are."""
        return (
            self.current
            + self.torque
            + self.velocity
            + self.position
            + self.stiffness
            + self.damping
        )

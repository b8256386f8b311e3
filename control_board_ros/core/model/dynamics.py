# SPDX-License-Identifier: Apache-2.0
"""The dynamics of an arm: the torques of a motion (recursive Newton-Euler).

τ = M(q) q̈ + c(q, q̇) + g(q), by two passes over the tree of the joints, with axes z and
R_i = E_i Rot_z(q_i), the link's spin ω, its rate α, and the acceleration a of its origin::

    outwards  ω_i = R_iᵀ ω + z q̇_i,   α_i = R_iᵀ α + R_iᵀ ω × z q̇_i + z q̈_i
              a_i = R_iᵀ (a + α × p_i + ω × (ω × p_i)),   a_0 = −gravity
              f_i = m a_i + α_i × h_i + ω_i × (ω_i × h_i)
              n_i = I_i α_i + ω_i × I_i ω_i + h_i × a_i
    inwards   f += R_i f_i,   n += R_i n_i + p_i × R_i f_i,   τ_i = z·n_i + J_i q̈_i

h = m c and I are about the link's origin; where a joint slides, p_i grows by q_i along its axis,
a_i gets z q̈_i + 2 R_iᵀ ω × z q̇_i, and τ_i = z·f_i (Featherstone, Rigid Body Dynamics Algorithms,
2008, ch. 5). Plain Python in Cython's pure mode, as the laws are. Units: rad, N·m, kg, m, s; m and
N where joints slide.
"""

from __future__ import annotations

from math import cos, fabs, sin
from typing import Any

from ... import nocython as cython

#: Least part of a torque limit that is left for motion, whatever the load.
MIN_ROOM = cython.declare(cython.double, 0.1)


@cython.cclass
class Body:
    """A link in the passes: constants, state of its joint, results, and its move."""

    carrier: Body
    slides = cython.declare(cython.bint, visibility="public")
    # constants
    e0 = e1 = e2 = e3 = e4 = e5 = e6 = e7 = e8 = cython.declare(cython.double, visibility="public")
    px = py = pz = cython.declare(cython.double, visibility="public")
    mass = cython.declare(cython.double, visibility="public")
    hx = hy = hz = cython.declare(cython.double, visibility="public")
    ixx = iyy = izz = ixy = ixz = iyz = cython.declare(cython.double, visibility="public")
    rotor = coulomb = viscous = cython.declare(cython.double, visibility="public")
    # state: position, velocity, acceleration
    q = dq = ddq = cython.declare(cython.double, visibility="public")
    # found: R, the position that it is of, way to the origin, ω, α, a, f, n, torque
    turned = cython.declare(cython.double, visibility="public")
    r0 = r1 = r2 = r3 = r4 = r5 = r6 = r7 = r8 = cython.declare(cython.double, visibility="public")
    ox = oy = oz = cython.declare(cython.double, visibility="public")
    wx = wy = wz = cython.declare(cython.double, visibility="public")
    lx = ly = lz = cython.declare(cython.double, visibility="public")
    ax = ay = az = cython.declare(cython.double, visibility="public")
    fx = fy = fz = cython.declare(cython.double, visibility="public")
    nx = ny = nz = cython.declare(cython.double, visibility="public")
    torque = cython.declare(cython.double, visibility="public")
    whole = cython.declare(cython.double, visibility="public")
    # a move: start, its velocity and acceleration, target, T, T_b, time past; drift; bounds
    start = cython.declare(cython.double, visibility="public")
    start_velocity = start_acceleration = cython.declare(cython.double, visibility="public")
    target = time = brake = past = drift = cython.declare(cython.double, visibility="public")
    lower = upper = cython.declare(cython.double, visibility="public")
    # torque limit; torque at stall, and how much less per rad/s
    limit = stall = fading = cython.declare(cython.double, visibility="public")

    def __init__(self) -> None:
        self.turned = float("nan")

    @cython.ccall
    def hang(self, carrier: Body) -> cython.void:
        """Attach the body to the one that carries it."""
        self.carrier = carrier


@cython.cfunc
def outwards(b: Body) -> cython.void:
    """Motion of a link, and its force and torque."""
    u: Body = b.carrier
    turn(b)
    # a + α × p + ω × (ω × p), in the carrier's axes
    x, y, z = u.wy * b.oz - u.wz * b.oy, u.wz * b.ox - u.wx * b.oz, u.wx * b.oy - u.wy * b.ox
    ax = u.ax + u.ly * b.oz - u.lz * b.oy + u.wy * z - u.wz * y
    ay = u.ay + u.lz * b.ox - u.lx * b.oz + u.wz * x - u.wx * z
    az = u.az + u.lx * b.oy - u.ly * b.ox + u.wx * y - u.wy * x
    b.ax = b.r0 * ax + b.r3 * ay + b.r6 * az
    b.ay = b.r1 * ax + b.r4 * ay + b.r7 * az
    b.az = b.r2 * ax + b.r5 * ay + b.r8 * az
    b.wx = b.r0 * u.wx + b.r3 * u.wy + b.r6 * u.wz
    b.wy = b.r1 * u.wx + b.r4 * u.wy + b.r7 * u.wz
    b.wz = b.r2 * u.wx + b.r5 * u.wy + b.r8 * u.wz
    b.lx = b.r0 * u.lx + b.r3 * u.ly + b.r6 * u.lz
    b.ly = b.r1 * u.lx + b.r4 * u.ly + b.r7 * u.lz
    b.lz = b.r2 * u.lx + b.r5 * u.ly + b.r8 * u.lz
    if b.slides:
        b.ax += 2.0 * b.wy * b.dq
        b.ay -= 2.0 * b.wx * b.dq
        b.az += b.ddq
    else:
        b.lx += b.wy * b.dq
        b.ly -= b.wx * b.dq
        b.lz += b.ddq
        b.wz += b.dq
    x, y, z = b.wy * b.hz - b.wz * b.hy, b.wz * b.hx - b.wx * b.hz, b.wx * b.hy - b.wy * b.hx
    b.fx = b.mass * b.ax + b.ly * b.hz - b.lz * b.hy + b.wy * z - b.wz * y
    b.fy = b.mass * b.ay + b.lz * b.hx - b.lx * b.hz + b.wz * x - b.wx * z
    b.fz = b.mass * b.az + b.lx * b.hy - b.ly * b.hx + b.wx * y - b.wy * x
    x = b.ixx * b.wx + b.ixy * b.wy + b.ixz * b.wz
    y = b.ixy * b.wx + b.iyy * b.wy + b.iyz * b.wz
    z = b.ixz * b.wx + b.iyz * b.wy + b.izz * b.wz
    b.nx = b.ixx * b.lx + b.ixy * b.ly + b.ixz * b.lz + b.wy * z - b.wz * y
    b.ny = b.ixy * b.lx + b.iyy * b.ly + b.iyz * b.lz + b.wz * x - b.wx * z
    b.nz = b.ixz * b.lx + b.iyz * b.ly + b.izz * b.lz + b.wx * y - b.wy * x
    b.nx += b.hy * b.az - b.hz * b.ay
    b.ny += b.hz * b.ax - b.hx * b.az
    b.nz += b.hx * b.ay - b.hy * b.ax


@cython.cfunc
def turn(b: Body) -> cython.void:
    """R = E Rot_z(q), and the way to the origin, at the joint's position."""
    c = 1.0
    s = 0.0
    if b.q == b.turned:
        return
    b.turned = b.q
    b.ox, b.oy, b.oz = b.px, b.py, b.pz
    if b.slides:
        b.ox += b.e2 * b.q
        b.oy += b.e5 * b.q
        b.oz += b.e8 * b.q
    else:
        c, s = cos(b.q), sin(b.q)
    b.r0, b.r1, b.r2 = b.e0 * c + b.e1 * s, b.e1 * c - b.e0 * s, b.e2
    b.r3, b.r4, b.r5 = b.e3 * c + b.e4 * s, b.e4 * c - b.e3 * s, b.e5
    b.r6, b.r7, b.r8 = b.e6 * c + b.e7 * s, b.e7 * c - b.e6 * s, b.e8


@cython.cfunc
def inwards(b: Body) -> cython.void:
    """The torque of a joint; force and torque of its link act on the link that carries it, too."""
    u: Body = b.carrier
    b.torque = (b.fz if b.slides else b.nz) + b.rotor * b.ddq
    fx = b.r0 * b.fx + b.r1 * b.fy + b.r2 * b.fz
    fy = b.r3 * b.fx + b.r4 * b.fy + b.r5 * b.fz
    fz = b.r6 * b.fx + b.r7 * b.fy + b.r8 * b.fz
    u.fx += fx
    u.fy += fy
    u.fz += fz
    u.nx += b.r0 * b.nx + b.r1 * b.ny + b.r2 * b.nz + b.oy * fz - b.oz * fy
    u.ny += b.r3 * b.nx + b.r4 * b.ny + b.r5 * b.nz + b.oz * fx - b.ox * fz
    u.nz += b.r6 * b.nx + b.r7 * b.ny + b.r8 * b.nz + b.ox * fy - b.oy * fx


@cython.final
@cython.cclass
class Arm:
    """Evaluates the dynamics of n joints; made by ``ArmModel.arm``.

    Args:
        base: what carries the first bodies.
        bodies: one per joint, in the board's order.
        ordered: the same, each after the one that carries it.
        gravity: in the base's axes, m/s².
        rows: position, velocity, acceleration and torque of the joints: n doubles each.

    Attributes: bodies, rows.
    """

    bodies = cython.declare(list, visibility="public")
    rows = cython.declare(list, visibility="public")
    ordered: list[Body]
    base: Body
    gx: cython.double
    gy: cython.double
    gz: cython.double
    position = velocity = acceleration = torque = cython.declare(cython.double[::1])

    def __init__(
        self,
        base: Body,
        bodies: list[Body],
        ordered: list[Body],
        gravity: tuple[float, float, float],
        rows: list[Any],
    ) -> None:
        self.base, self.bodies, self.ordered = base, bodies, ordered
        self.gx, self.gy, self.gz = gravity
        self.rows = rows
        self.position, self.velocity, self.acceleration, self.torque = rows

    @cython.ccall
    def inverse(self, weight: cython.double) -> cython.void:
        """Write the torques of the motion in the rows into the row of torques.

        Args:
            weight: of gravity: 1, or 0 for the torques of the motion alone.
        """
        b: Body
        for k in range(len(self.bodies)):
            b = self.bodies[k]
            b.q, b.dq, b.ddq = self.position[k], self.velocity[k], self.acceleration[k]
        self.solve(weight)
        for k in range(len(self.bodies)):
            b = self.bodies[k]
            self.torque[k] = b.torque

    @cython.cfunc
    def solve(self, weight: cython.double) -> cython.void:
        """Both passes, from q, dq, ddq of the bodies to their torques."""
        n = len(self.ordered)
        b: Body
        base: Body = self.base
        base.ax, base.ay, base.az = -weight * self.gx, -weight * self.gy, -weight * self.gz
        for k in range(n):
            b = self.ordered[k]
            outwards(b)
        for k in range(n - 1, -1, -1):
            b = self.ordered[k]
            inwards(b)

    @cython.ccall
    def excess(self, samples: cython.int) -> cython.double:
        """Torque of moves in relation to what loads and friction leave; above 1: too much.

        max over time and joints of |τ_motion| / (τ_limit − τ_static), where τ exceeds τ_limit; 0
        where it never does. Moves of k times the duration need 1/k² of it.

        Args:
            samples: in each joint's own move; twice as many in the longest, and three where a
                joint brakes.
        """
        peak = 0.0
        longest = 0.0
        b: Body
        for b in self.ordered:
            longest = max(longest, ending(b))
        for k in range(2 * samples + 1):
            peak = max(peak, self.taken(longest * k / (2 * samples)))
        for b in self.ordered:
            end = ending(b)
            if 0.0 < end < 0.9 * longest:
                for k in range(1, samples):
                    peak = max(peak, self.taken(end * k / samples))
            end = b.brake - b.past
            if end > 0.0:
                for k in range(1, 4):
                    peak = max(peak, self.taken(0.25 * k * end))
        return peak

    @cython.cfunc
    def taken(self, time: cython.double) -> cython.double:
        """``excess`` at a time from now, s."""
        peak = 0.0
        strained: cython.bint = False
        b: Body
        for b in self.ordered:
            place(b, time)
        self.solve(1.0)
        for b in self.ordered:
            b.whole = b.torque
            strained = strained or beyond(b) > 0.0
        if not strained:
            return 0.0
        self.solve(0.0)
        for b in self.ordered:
            if beyond(b) > 0.0:
                peak = max(peak, share(b))
        return peak


@cython.cfunc
def ending(b: Body) -> cython.double:
    """Time until the move of a joint ends, s."""
    return max(b.time, b.brake) - b.past


@cython.cfunc
def rubbed(b: Body) -> cython.double:
    """Friction of a joint, N·m."""
    if b.dq == 0.0:
        return 0.0
    return b.viscous * b.dq + (b.coulomb if b.dq > 0.0 else -b.coulomb)


@cython.cfunc
def bound(b: Body, sign: cython.double) -> cython.double:
    """The torque that a motor has in a direction; driving, it loses that of the back-EMF."""
    if b.dq * sign > 0.0:
        return min(b.limit, b.stall - b.fading * fabs(b.dq))
    return b.limit


@cython.cfunc
def beyond(b: Body) -> cython.double:
    """Torque of a joint beyond that of its motor; below 0 where it suffices."""
    torque = b.whole + rubbed(b)
    return fabs(torque) - bound(b, torque)


@cython.cfunc
def share(b: Body) -> cython.double:
    """|τ_motion| / (τ_limit − τ_static) of a joint whose motion alone is in ``torque``."""
    sign = 1.0 if b.whole + rubbed(b) >= 0.0 else -1.0
    static = sign * (b.whole - b.torque + rubbed(b))
    return fabs(b.torque) / max(bound(b, sign) - static, MIN_ROOM * b.limit)


@cython.cfunc
def place(b: Body, time: cython.double) -> cython.void:
    """State of a joint in its move, as in ``laws.advance_move``."""
    run = 0.0
    bend = b.start_acceleration * b.brake
    elapsed = time + b.past
    reach = b.target - b.start
    b.q, b.dq, b.ddq = b.start + b.drift * time, b.drift, 0.0
    if b.brake > 0.0:
        u = min(elapsed / b.brake, 1.0)
        reach -= 0.5 * b.start_velocity * b.brake + bend * b.brake / 12.0
        b.q += b.start_velocity * b.brake * u * (1.0 + u * u * (0.5 * u - 1.0))
        b.q += bend * b.brake * u * u * (0.5 + u * (0.25 * u - 2.0 / 3.0))
        b.dq += b.start_velocity * (1.0 + u * u * (2.0 * u - 3.0))
        b.dq += bend * u * (1.0 - u) * (1.0 - u)
        b.ddq = 6.0 * b.start_velocity * u * (u - 1.0) / b.brake
        b.ddq += b.start_acceleration * (1.0 + u * (3.0 * u - 4.0)) if u < 1.0 else 0.0
        bend = 0.0
    else:
        run = b.start_velocity * b.time
        bend = 0.5 * b.start_acceleration * b.time * b.time
    if elapsed >= b.time:
        b.q += reach
    else:
        s = elapsed / b.time
        x = 10.0 * reach - 6.0 * run - 3.0 * bend
        y = 8.0 * run - 15.0 * reach + 3.0 * bend
        z = 6.0 * reach - 3.0 * run - bend
        b.q += s * (run + s * s * (x + s * (y + s * z))) + s * s * bend
        b.dq += (run + s * s * (3.0 * x + s * (4.0 * y + s * 5.0 * z)) + 2.0 * s * bend) / b.time
        b.ddq += 2.0 * bend / b.time / b.time
        b.ddq += s * (6.0 * x + s * (12.0 * y + s * 20.0 * z)) / b.time / b.time
    if not b.lower <= b.q <= b.upper:
        b.q, b.dq, b.ddq = min(max(b.q, b.lower), b.upper), 0.0, 0.0

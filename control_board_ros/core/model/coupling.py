# SPDX-License-Identifier: Apache-2.0
"""Couplings of a board's axes with physical joints, or with motors (SPEC Y3).

With the matrix R of shape (m, n), m joints or motors and n axes, and a function f of the joints
that have one::

    q_joints   = f(x),  x = R q_axes + offset     J = f'(x) R
    dq_joints  = J dq_axes                        ddq_joints = J ddq_axes + f''(x) (R dq_axes)²
    τ_axes     = Jᵀ τ_joints                      (equal power on both sides)

The way back is the least-squares one: exact where the joints are on the coupling, and for torques
the smallest ones that make those of the axes. Positions go back by the rows without a function.

A planar four-bar linkage turns a finger's next joint by its first. The ground link joins two
pivots; the crank a turns about the first by θ, the rocker c about the second by ψ, and the coupler
b joins their ends. With e the distance from the crank's end to the second pivot, in the direction
δ::

    cos(ψ − δ) = (b² − e² − c²)/(2 e c)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..terms.arguments import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class FourBar:
    """The rocker's turn for the crank's, rad; 0 for 0.

    Args:
        ground: distance of the pivots; all lengths in the same unit.
        crank: length of the link that is turned.
        coupler: length of the link between crank and rocker.
        rocker: length of the link that follows.
        zero: angle of the crank at 0, from the direction of the second pivot, rad.
    """

    ground: float
    crank: float
    coupler: float
    rocker: float
    zero: float

    def value(self, x: Array) -> Array:
        """The rocker's turn; NaN where the links do not reach each other."""
        turn = self._rocker(x) - self._rocker(np.zeros(1))
        wrapped: Array = (turn + math.pi) % (2.0 * math.pi) - math.pi
        return wrapped

    def slope(self, x: Array) -> Array:
        """dψ/dθ."""
        theta, psi = x + self.zero, self._rocker(x)
        tip = self.crank * np.array([np.cos(theta), np.sin(theta)])
        arm = self.rocker * np.array([np.cos(psi), np.sin(psi)])
        path = arm - tip
        path[0] += self.ground
        ratio: Array = _dot(path, _quarter(tip)) / _dot(path, _quarter(arm))
        return ratio

    def _rocker(self, x: Array) -> Array:
        """ψ, rad."""
        theta = x + self.zero
        across = self.ground - self.crank * np.cos(theta)
        down = -self.crank * np.sin(theta)
        reach = np.hypot(across, down)
        cosine = (self.coupler**2 - reach**2 - self.rocker**2) / (2.0 * reach * self.rocker)
        with np.errstate(invalid="ignore"):
            angle: Array = np.arctan2(down, across) + np.arccos(cosine)
        return angle


def _quarter(vectors: Array) -> Array:
    """Turned by a quarter turn, shape (2, …)."""
    return np.array([-vectors[1], vectors[0]])


def _dot(a: Array, b: Array) -> Array:
    product: Array = a[0] * b[0] + a[1] * b[1]
    return product


#: The functions of couplings, by name.
FUNCTIONS = {"four_bar": FourBar}
ARGUMENTS = {name: tuple(item.name for item in fields(made)) for name, made in FUNCTIONS.items()}


#: A matrix whose condition number is beyond this is singular.
SINGULAR = 1e9


class Gear(NamedTuple):
    """A joint that another one drives along: f(ratio · leader + offset), rad or m."""

    follower: str
    leader: str
    ratio: float
    offset: float
    function: FourBar | None

    def place(self, leader: float) -> tuple[float, float]:
        """Position of the follower at a position of its leader, and the derivative."""
        x = self.ratio * leader + self.offset
        if self.function is None:
            return x, self.ratio
        at = np.array([x])
        return float(self.function.value(at)[0]), self.ratio * float(self.function.slope(at)[0])


@dataclass(frozen=True)
class Coupling:
    """A coupling.

    Args:
        axes: names of the n axes, the board's joints.
        physical_joints: names of the m physical joints, or of the motors.
        rows: of the matrix, one for each physical joint.
        offsets: of the positions of the physical joints, rad or m; empty: zeros.
        functions: of the physical joints, None where there is none; empty: none at all.

    Raises:
        ValueError: sizes that do not fit, or a singular matrix; a one-line message.
    """

    axes: tuple[str, ...]
    physical_joints: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]
    offsets: tuple[float, ...] = ()
    functions: tuple[FourBar | None, ...] = ()

    def __post_init__(self) -> None:
        n, m = len(self.axes), len(self.physical_joints)
        widths = {len(row) for row in self.rows}
        if len(self.rows) != m or not widths <= {n}:
            numbers = sum(len(row) for row in self.rows)
            raise ValueError(
                f"{m * n} numbers: {m} rows of {n}, one for each axis; it has {numbers}"
            )
        for name, some in (("offsets", self.offsets), ("functions", self.functions)):
            if some and len(some) != m:
                raise ValueError(f"{m} {name}, one for each joint; it has {len(some)}")
        plain = self.matrix[self._plain]
        finite = bool(np.isfinite(plain).all())
        if not finite or len(plain) < n or not np.linalg.cond(plain) < SINGULAR:
            raise ValueError(
                "a matrix that is not singular: every motion of the axes moves joints, also "
                "without those that have a function"
            )

    @classmethod
    def plain(cls, axes: Sequence[str]) -> Coupling:
        """Each axis is a physical joint."""
        return cls(tuple(axes), tuple(axes), tuple(map(tuple, np.eye(len(axes)).tolist())))

    @cached_property
    def matrix(self) -> Array:
        """R, shape (m, n); without functions J, too."""
        return np.array(self.rows, dtype=np.float64).reshape(-1, len(self.axes))

    @cached_property
    def inverse(self) -> Array:
        """The pseudo-inverse of R, shape (n, m)."""
        return np.asarray(np.linalg.pinv(self.matrix), dtype=np.float64)

    @cached_property
    def offset(self) -> Array:
        """Of x, shape (m,)."""
        return np.array(self.offsets or [0.0] * len(self.physical_joints))

    @cached_property
    def curved(self) -> dict[int, FourBar]:
        """The functions, by row."""
        return {i: function for i, function in enumerate(self.functions) if function is not None}

    @cached_property
    def _plain(self) -> list[int]:
        """Rows without a function."""
        return [i for i in range(len(self.physical_joints)) if i not in self.curved]

    @cached_property
    def _straight(self) -> tuple[Array, Array]:
        """The way back from the rows without a function: its matrix, shape (n, m), and offset."""
        back = np.zeros((len(self.axes), len(self.physical_joints)))
        back[:, self._plain] = np.linalg.pinv(self.matrix[self._plain])
        return back, back @ self.offset

    def jacobian(self, at: Array | None = None) -> Array:
        """J, shape (m, n), at positions of the axes, shape (n,); None: at zero."""
        return self.matrix * self._slopes(at)[:, None] if self.curved else self.matrix

    def positions(self, axes: Array) -> Array:
        """Positions of the physical joints, shape (m,), for those of the axes, shape (n,)."""
        joints: Array = product(self.matrix, axes) + self.offset
        for i, function in self.curved.items():
            joints[i] = function.value(joints[i : i + 1])[0]
        return joints

    def velocities(self, axes: Array, at: Array | None = None) -> Array:
        """Velocities of the physical joints for those of the axes, at their positions."""
        return product(self.jacobian(at), axes)

    def torques(self, axes: Array, at: Array | None = None) -> Array:
        """The smallest torques of the physical joints, shape (m,), that make those of the axes."""
        joints: Array = self._back(at).T @ axes
        return joints

    def axis_positions(self, joints: Array) -> Array:
        """Positions of the axes, shape (n,), for those of the physical joints, shape (m,)."""
        back, offset = self._straight
        axes: Array = back @ joints - offset
        return axes

    def axis_velocities(self, joints: Array, at: Array | None = None) -> Array:
        """Velocities of the axes for those of the physical joints, at positions of the axes."""
        axes: Array = self._back(at) @ joints
        return axes

    @cached_property
    def leads(self) -> tuple[int, ...]:
        """N rows without a function that determine the axes, the first ones."""
        independent: list[int] = []
        for i in self._plain:
            if np.linalg.matrix_rank(self.matrix[[*independent, i]], tol=1e-9) > len(independent):
                independent.append(i)
        return tuple(independent)

    @cached_property
    def lead_inverse(self) -> Array:
        """Axes by the leads, shape (n, n)."""
        return np.asarray(np.linalg.inv(self.matrix[list(self.leads)]), dtype=np.float64)

    @cached_property
    def gears(self) -> tuple[Gear, ...]:
        """The gears by which the other joints follow the leads.

        Raises:
            ValueError: a joint follows several leads; one line.
        """
        gears, leads, names = [], list(self.leads), self.physical_joints
        shares = self.matrix @ self.lead_inverse
        for i, name in enumerate(names):
            if i in leads:
                continue
            by = [k for k in range(len(leads)) if abs(shares[i, k]) > 1e-12]
            if len(by) > 1:
                several = " and ".join(names[leads[k]] for k in by)
                raise ValueError(f"{name} following one joint; it follows {several}")
            leader = leads[by[0]] if by else leads[0]  # a row of zeros does not move
            ratio = float(shares[i, leads.index(leader)])
            offset = float(self.offset[i] - ratio * self.offset[leader])
            gears.append(Gear(name, names[leader], ratio, offset, self.curved.get(i)))
        return tuple(gears)

    def _back(self, at: Array | None) -> Array:
        """The pseudo-inverse of J, shape (n, m)."""
        if not self.curved:
            return self.inverse
        known = np.nan_to_num(self.jacobian(at))  # of axes that were not read yet (B7)
        return np.asarray(np.linalg.pinv(known), dtype=np.float64)

    def _inputs(self, at: Array | None) -> Array:
        """x, shape (m,)."""
        inputs: Array = self.offset if at is None else product(self.matrix, at) + self.offset
        return inputs

    def _slopes(self, at: Array | None) -> Array:
        """f'(x), shape (m,)."""
        x, slopes = self._inputs(at), np.ones(len(self.physical_joints))
        for i, function in self.curved.items():
            slopes[i] = function.slope(x[i : i + 1])[0]
        return slopes


def product(matrix: Array, values: Array) -> Array:
    """M x, where an unknown value, NaN, reaches only what depends on it: 0 · NaN = 0."""
    made: Array = matrix @ values
    if not np.isfinite(values).all():
        made = np.where(matrix == 0.0, 0.0, matrix * values).sum(axis=1)
    return made


class MotorMix:
    """From the outputs of axes to those of coupled motors, and back from their currents.

    Each axis is controlled as if its own motor moved it alone; with the constants K (N·m/A), R, E
    (back-EMF at the joint) and p (percent per volt) of both, and the motors' turns φ = M q::

        u_axis  = p (R/K τ + E dq)          τ_motors = M⁻ᵀ τ_axes
        u_motor = p (R/K τ + E dφ)          K i_axes = Mᵀ K i_motors

    With equal motors, the currents of the axes obey the equation of one motor each.

    Args:
        coupling: square, of the axes with the motors.
        constants: K, R, E and p of each motor, at its joint, shape (n,) each.

    Attributes: pwm (percent) and powered (1.0 where a bridge is on) of the motors, shape (n,), as
    ``drive`` leaves them.
    """

    def __init__(self, coupling: Coupling, *constants: Array) -> None:
        whole = coupling.matrix
        apart = whole != np.eye(len(whole))
        self._shared = np.flatnonzero(apart.any(axis=0) | apart.any(axis=1))
        self._coupling = coupling
        self.pwm, self.powered = np.zeros((2, len(whole)))
        self._asked = np.zeros(2 * len(self._shared))
        self.retune(*constants)

    def retune(self, *constants: Array) -> None:
        """Set the constants of the motors."""
        coupling, shared = self._coupling, self._shared
        block = np.ix_(shared, shared)
        matrix, sharing = coupling.matrix[block], coupling.inverse.T[block]
        torque, resistance, back_emf, percent = (row[shared] for row in constants)
        per_torque = percent * resistance / torque
        self._sharing = per_torque[:, None] * sharing / per_torque
        self._together = per_torque[:, None] * matrix.T / per_torque
        self._axis_emf = percent * back_emf
        self._motor_emf = self._axis_emf[:, None] * matrix
        self._currents = matrix.T * torque / torque[:, None]
        self._needs = np.abs(sharing) > 1e-12
        self._switched = b""

    def drive(self, output: Array, velocity: Array, powered: Array, caps: Array) -> None:
        """Turn the outputs of axes (percent) into those of motors, each within its limit.

        An axis without power requests no torque; its motors serve the other axes. Where a motor
        saturates, ``output`` becomes what acts on the axes.
        """
        shared, count, asked = self._shared, len(self._shared), self._asked
        if powered.tobytes() != self._switched:
            self._switch(powered)
        output.take(shared, out=asked[:count], mode="clip")
        velocity.take(shared, out=asked[count:], mode="clip")
        motor_output: Array = self._lead @ asked
        cap = caps.take(shared, mode="clip")
        if (np.abs(motor_output) > cap).any():
            motor_output = np.maximum(np.minimum(motor_output, cap), -cap)
            speed = asked[count:]
            driving = motor_output - self._motor_emf @ speed
            acting = self._together @ driving + self._axis_emf * speed
            output[shared] = np.where(self._on, acting, asked[:count])
        self.pwm[:] = output
        self.pwm[shared] = motor_output * self._needed

    def _switch(self, powered: Array) -> None:
        """Set the matrix for the axes with power: S on (u_axes − E dq) + E' dq."""
        shared = self._shared
        self._on = powered[shared] > 0.0
        sharing = self._sharing * self._on
        self._lead = np.hstack([sharing, self._motor_emf - sharing * self._axis_emf])
        self._needed = (self._needs & self._on).any(axis=1).astype(np.float64)
        self.powered[:] = powered
        self.powered[shared] = self._needed
        self._switched = powered.tobytes()

    def axis_currents(self, motors: Array) -> None:
        """Turn the currents of the motors into those of the axes, A, in place."""
        motors[self._shared] = self._currents @ motors.take(self._shared)

    def motor_rates(self, axes: Array) -> Array:
        """Velocities or accelerations of the motors, at their joints, for those of the axes."""
        return self._coupling.velocities(axes)


def rotors_of_motors(motors: Coupling, rotors: Array) -> Array:
    """Inertia of rotors for each axis alone, the diagonal of Mᵀ diag(rotors) M, shape (n,)."""
    seen: Array = (motors.matrix**2).T @ rotors
    return seen


def side_by_side(couplings: Sequence[Coupling]) -> Coupling:
    """The coupling of several independent parts."""
    axes = tuple(name for c in couplings for name in c.axes)
    before, rows = 0, []
    for c in couplings:
        after = len(axes) - before - len(c.axes)
        rows += [(0.0,) * before + row + (0.0,) * after for row in c.rows]
        before += len(c.axes)
    joints = tuple(name for c in couplings for name in c.physical_joints)
    offsets = tuple(value for c in couplings for value in c.offset.tolist())
    functions = tuple(c.curved.get(i) for c in couplings for i in range(len(c.rows)))
    return Coupling(axes, joints, tuple(rows), offsets, functions if any(functions) else ())

# SPDX-License-Identifier: Apache-2.0
"""A path through points: its checks, its sampling, and the tolerances around it (SPEC T1).

Between two points the path is a polynomial in s = (t − t0)/T, T = t1 − t0, Δ = q1 − q0:

    positions only           q = q0 + Δ s
    with velocities          q = q0 + V0 s + (3Δ − 2V0 − V1) s² + (V0 + V1 − 2Δ) s³
    with accelerations, too  the quintic that meets q, dq/dt and d²q/dt² at both points

with V = v T. After the last point the path is at rest there. This is what ros2_controllers'
joint_trajectory_controller makes of the same points.

Tolerances mean what they do there, too: 0 in a goal leaves the default, which is a parameter; a
negative number removes the limit. Accelerations are not measured, so there is no tolerance of
theirs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...text import count_of
from ..selection import RequestError
from ..terms.arguments import Array
from ..terms.joint_kind import JointKind
from ..terms.measurement import CREDIBLE
from ..terms.vocabs import InteractionMode

#: A trajectory of more points is refused.
MAX_POINTS = 10_000

#: Speed up to which the last point counts as at rest, rad/s (m/s for a prismatic joint).
MAX_END_SPEED = 1e-6

#: Times closer than this are equal, s.
SAME_TIME = 1e-9

#: Factors and powers of s in q, dq/ds, d²q/ds² of a polynomial of six coefficients.
_FACTORS = np.array([[1, 1, 1, 1, 1, 1], [0, 1, 2, 3, 4, 5], [0, 0, 2, 6, 12, 20]], dtype=float)
_POWERS = np.array([[0, 1, 2, 3, 4, 5], [0, 0, 1, 2, 3, 4], [0, 0, 0, 1, 2, 3]], dtype=float)

Rows = Sequence[Sequence[float]]


class Sample(NamedTuple):
    """A path at one time, arrays of shape (k,): rad, rad/s, rad/s²."""

    positions: Array
    velocities: Array
    accelerations: Array


class Points(NamedTuple):
    """The points of a trajectory as they come in a message; see ``make_path``."""

    times: Sequence[float]
    positions: Rows
    velocities: Rows
    accelerations: Rows


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Points of k joints.

    Attributes: times (s from the start of the path, rising, shape (m,)); positions (rad, shape
    (m, k)); velocities (rad/s) and accelerations (rad/s²), of the same shape, or None.
    """

    times: Array
    positions: Array
    velocities: Array | None = None
    accelerations: Array | None = None

    @property
    def duration(self) -> float:
        """Time of the last point, s."""
        return float(self.times[-1])

    def of(self, columns: NDArray[np.bool_] | NDArray[np.intp]) -> Path:
        """The path of some of its joints; columns: a mask, shape (k,), or their numbers."""
        velocities, accelerations = self.velocities, self.accelerations
        return Path(
            self.times,
            self.positions[:, columns],
            None if velocities is None else velocities[:, columns],
            None if accelerations is None else accelerations[:, columns],
        )

    def shifted(self, offsets: Array) -> Path:
        """The path with offsets added to its positions, rad, shape (k,)."""
        return Path(self.times, self.positions + offsets, self.velocities, self.accelerations)

    def joined(self, time: float, present: Sample) -> Path:
        """The path from a time on: it starts at ``present``, without the points before.

        Args:
            time: of the present, s from the start of the path; before its last point.
            present: state of the joints then; ignored where a point has exactly this time.
        """
        first = int(np.searchsorted(self.times, time - SAME_TIME))
        fields = (self.positions, self.velocities, self.accelerations)
        if self.times[first] - time <= SAME_TIME:
            return Path(
                self.times[first:],
                *(None if f is None else f[first:] for f in fields),  # type: ignore[arg-type]
            )
        return Path(
            np.concatenate([[time], self.times[first:]]),
            *(
                None if field is None else np.vstack([start, field[first:]])  # type: ignore[arg-type]
                for field, start in zip(fields, present, strict=True)
            ),
        )


class Spline:
    """A path that is ready to be sampled."""

    def __init__(self, path: Path) -> None:
        self._times, self._last = path.times, path.positions[-1]
        self._periods = np.diff(path.times)
        self._coefficients = coefficients(path)

    def at(self, time: float) -> Sample:
        """The path at a time, s; at rest at the last point from its time on."""
        times = self._times
        if time >= times[-1]:
            zeros = np.zeros_like(self._last)
            return Sample(self._last, zeros, zeros)
        segment = max(int(np.searchsorted(times, time, side="right")) - 1, 0)
        period = self._periods[segment]
        s = max(time - times[segment], 0.0) / period
        rows = (_FACTORS * s**_POWERS) @ self._coefficients[segment]
        return Sample(rows[0], rows[1] / period, rows[2] / period**2)


def coefficients(path: Path) -> Array:
    """Coefficients of the powers of s, lowest first, shape (m − 1, 6, k); see the module."""
    periods = np.diff(path.times)[:, None]
    q0, delta = path.positions[:-1], np.diff(path.positions, axis=0)
    zero = np.zeros_like(delta)
    if path.velocities is None:
        rows = [q0, delta, zero, zero, zero, zero]
        return np.stack(rows, axis=1)
    v0, v1 = path.velocities[:-1] * periods, path.velocities[1:] * periods
    if path.accelerations is None:
        rows = [q0, v0, 3 * delta - 2 * v0 - v1, v0 + v1 - 2 * delta, zero, zero]
        return np.stack(rows, axis=1)
    a0, a1 = path.accelerations[:-1] * periods**2, path.accelerations[1:] * periods**2
    rows = [
        q0,
        v0,
        0.5 * a0,
        10 * delta - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1,
        -15 * delta + 8 * v0 + 7 * v1 + 1.5 * a0 - a1,
        6 * delta - 3 * (v0 + v1) - 0.5 * (a0 - a1),
    ]
    return np.stack(rows, axis=1)


def minimum_jerk(s: Array | float) -> Array:
    """The quintic from rest to rest, from 0 to 1 and held beyond: 10 s³ − 15 s⁴ + 6 s⁵ (P1)."""
    s = np.clip(s, 0.0, 1.0)
    profile: Array = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return profile


def braking(position: float, velocity: float, acceleration: float) -> Path:
    """The path of one joint to rest.

    q(t) = q₀ + v₀ t − sign(v₀) a t²/2 until t = |v₀|/a.

    Args:
        position: q₀, rad or m.
        velocity: v₀, rad/s or m/s.
        acceleration: a, above 0, rad/s² or m/s².
    """
    time = abs(velocity) / acceleration
    if time <= SAME_TIME:
        return Path(np.zeros(1), np.array([[position]]))
    return Path(
        np.array([0.0, time]),
        np.array([[position], [position + 0.5 * velocity * time]]),
        np.array([[velocity], [0.0]]),
    )


def make_path(
    names: Sequence[str], times: Sequence[float], positions: Rows, velocities: Rows, accels: Rows
) -> Path:
    """A path of points as they come in a message, checked whole (SPEC P13).

    Args:
        names: of the k joints, for the texts of errors.
        times: of the m points, s.
        positions: one row per point, one entry per joint, rad.
        velocities: likewise, rad/s; or every row empty.
        accels: accelerations, likewise, rad/s²; or every row empty.

    Raises:
        RequestError: what is wrong with which point, and what would be right.
    """
    if not times:
        raise RequestError("it has no points; send at least one")
    if len(times) > MAX_POINTS:
        raise RequestError(f"it has {len(times)} points; send at most {MAX_POINTS}")
    _check_times(times)
    where = _field(names, "positions", positions)
    if where is None:
        raise RequestError("its points have no positions; send one per joint")
    speeds = _field(names, "velocities", velocities)
    rates = _field(names, "accelerations", accels)
    if speeds is None and rates is not None:
        raise RequestError("its points have accelerations and no velocities; send both or neither")
    if speeds is not None and (np.abs(speeds[-1]) > MAX_END_SPEED).any():
        worst = int(np.argmax(np.abs(speeds[-1])))
        raise RequestError(
            f"point {len(times) - 1}, the last one, has velocity {speeds[-1, worst]:.6g} of "
            f"{names[worst]}; a trajectory ends at rest, send 0"
        )
    return Path(np.array(times, dtype=np.float64), where, speeds, rates)


def _check_times(times: Sequence[float]) -> None:
    for i, time in enumerate(times):
        if not math.isfinite(time):
            raise RequestError(f"point {i} has time_from_start {time}; send a number of seconds")
    if times[0] < 0.0:
        raise RequestError(f"point 0 has time_from_start {times[0]:.9g} s; send 0 or more")
    for i in range(1, len(times)):
        if times[i] <= times[i - 1]:
            raise RequestError(
                f"point {i} has time_from_start {times[i]:.9g} s after {times[i - 1]:.9g} s of "
                "the point before; send times that rise from point to point"
            )


def _field(names: Sequence[str], what: str, rows: Rows) -> Array | None:
    """The rows of one field as an array, shape (m, k); None where no point has it."""
    count = len(names)
    if not any(len(row) for row in rows):
        return None
    for i, row in enumerate(rows):
        if len(row) == 0:
            raise RequestError(
                f"point {i} has no {what} and others have; send them at every point or at none"
            )
        if len(row) != count:
            raise RequestError(
                f"point {i} has {count_of(len(row), what)} for {count_of(count, 'joints')}; "
                "send one per joint"
            )
    values: Array = np.array(rows, dtype=np.float64)
    bad = ~(np.abs(values) <= CREDIBLE)
    if bad.any():
        i, k = np.argwhere(bad)[0]
        raise RequestError(
            f"point {i} has {values[i, k]} in {what} of {names[k]}; "
            f"send numbers from {-CREDIBLE:g} to {CREDIBLE:g}"
        )
    return values


Bools = NDArray[np.bool_]


@dataclass(slots=True, eq=False)
class Run:
    """A path that is active, or waiting for its start.

    Attributes: joints (indices, shape (k,)), interactions (theirs when the path was accepted),
    path, start (time of the board, s), held (it stays at its last point until it is ended), spline
    (None while it waits), last (the last references), left (why the first joints left it, with
    their names; empty while none did).
    """

    joints: NDArray[np.intp]
    interactions: list[InteractionMode]
    path: Path
    start: float
    held: bool
    spline: Spline | None = None
    last: Sample | None = None
    left: str = ""

    def keep(self, columns: Bools) -> None:
        """Continue with some of the joints only."""
        self.joints = self.joints[columns]
        self.interactions = [
            mode for mode, kept in zip(self.interactions, columns, strict=True) if kept
        ]
        self.path = self.path.of(columns)
        if self.spline is not None:
            self.spline = Spline(self.path)
        if self.last is not None:
            self.last = Sample(*(row[columns] for row in self.last))


#: What the numbers of a tolerance are about.
QUANTITIES = ("position", "velocity")


class Wish(NamedTuple):
    """The tolerance that a goal names for one joint: rad and rad/s, 0 = default, < 0 = none."""

    name: str
    position: float
    velocity: float


class Wishes(NamedTuple):
    """The tolerances that a goal names: on the way, at the last point, and time after it (s)."""

    path: Sequence[Wish] = ()
    goal: Sequence[Wish] = ()
    goal_time: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tolerances:
    """Of k joints; 0 means no limit.

    Attributes: path and goal (rows position, rad, and velocity, rad/s; shape (2, k)), goal_time (s
    after the last point until which the joints may arrive).
    """

    path: Array
    goal: Array
    goal_time: float


class Excess(NamedTuple):
    """The joint that is farthest beyond its tolerance: column, quantity, error and tolerance."""

    column: int
    quantity: str
    error: float
    tolerance: float


def resolve(default: float, wish: float) -> float:
    """The tolerance in force: 0 leaves the default, a negative number removes it."""
    return default if wish == 0.0 else max(wish, 0.0)


def goal_tolerances(
    defaults: Tolerances, names: Sequence[str], known: Sequence[str], wishes: Wishes
) -> Tolerances:
    """The tolerances of a goal.

    Args:
        defaults: of the goal's joints.
        names: of the goal's joints, in the order of the columns.
        known: names of all joints of the board; wishes for those outside the goal are passed over.
        wishes: of the goal.

    Raises:
        RequestError: a wish is not a number, or for a joint that is not there.
    """
    return replace(
        defaults,
        path=_with("path_tolerance", defaults.path, names, known, wishes.path),
        goal=_with("goal_tolerance", defaults.goal, names, known, wishes.goal),
        goal_time=resolve(defaults.goal_time, wishes.goal_time),
    )


def _with(
    what: str, rows: Array, names: Sequence[str], known: Sequence[str], wishes: Sequence[Wish]
) -> Array:
    made = rows.copy()
    if len(wishes) > len(known):
        raise RequestError(
            f"{what} has {len(wishes)} entries for {len(known)} joints; name each at most once"
        )
    for wish in wishes:
        if wish.name not in known:
            raise RequestError(f"{what} names {wish.name!r}, which is no joint of this board")
        if not np.isfinite([wish.position, wish.velocity]).all():
            raise RequestError(f"{what} of {wish.name} is not finite; send numbers")
        if wish.name in names:
            k = names.index(wish.name)
            made[:, k] = [resolve(made[0, k], wish.position), resolve(made[1, k], wish.velocity)]
    return made


def excess(errors: Array, tolerances: Array) -> Excess | None:
    """The joint that is farthest beyond its tolerance; None where all are within.

    Args:
        errors: desired − actual, rows position and velocity, shape (2, k).
        tolerances: of the same shape; 0 means no limit.
    """
    limited = tolerances > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(limited, np.abs(errors) / tolerances, 0.0)
    if not (ratios > 1.0).any():
        return None
    row, column = (int(i) for i in np.unravel_index(np.argmax(ratios), ratios.shape))
    error, tolerance = float(abs(errors[row, column])), float(tolerances[row, column])
    return Excess(column, QUANTITIES[row], error, tolerance)


def explain(excess: Excess, name: str, kind: JointKind, which: str) -> str:
    """What is beyond which tolerance, ``path`` or ``goal``, and by how much."""
    rate = "/s" if excess.quantity == "velocity" else ""
    units = kind.unit + rate
    return (
        f"{name} is {excess.error:.4g} {units} away from the {excess.quantity} it should have; "
        f"its {which} tolerance is {excess.tolerance:.4g} {units}"
    )

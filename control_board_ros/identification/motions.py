# SPDX-License-Identifier: Apache-2.0
"""Motions that identify a joint: slow ramps, sines and steps, one joint at a time or together.

Every motion begins and ends at rest at the joint's centre, and stays within range, speed and
acceleration of its bounds. Units: rad, rad/s, rad/s², s; m where joints slide.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..core.goals.path import minimum_jerk
from ..core.terms.joint_kind import JointKind
from ..joint_limits import JointLimits
from ..protocols import Floats
from .shares import ACCELERATION, SPEED, TORQUE

#: s between the points of a motion; s of rest at reversals and at both ends.
GRID, REST = 0.02, 0.4
#: Default of half the range, rad and m.
RANGE, RANGE_SLIDING = 0.35, 0.05
#: Speeds of ramps, as shares of a joint's bound; slow ones are short, for the breakaway.
CRAWL_SPEED, RAMPS = 0.03, (0.3, 0.6, 1.0, 1.0)
#: Duration of slow ramps, half of it accelerating and half braking, s; their number.
CRAWL, CRAWLS = 2.4, 6
#: Frequencies of the two tones of a sine, Hz, with their shares; duration, s.
TONES, SINES = ((0.5, 1.0), (1.3, 0.5)), 8.0
#: Steps there and back.
STEPS = 3
#: Duration of a motion of all joints, s, its lowest frequency and the ratio from joint to joint.
ALL_JOINTS_S, MIN_FREQUENCY_HZ, FREQUENCY_RATIO = 16.0, 0.25, 1.17
#: s in which the amplitude of sines grows and falls.
FADE = 1.5
#: Distance that motions keep from software limits, rad and m.
CLEARANCE_RAD, CLEARANCE_M = 0.02, 0.002
#: Minimum range, as a share of the requested one.
MIN_RANGE_SHARE = 0.2

RAMP, SINE, STEP, ALL = "ramps", "sines", "steps", "together"


@dataclass(frozen=True, slots=True)
class Bounds:
    """Limits of the motions of one joint.

    Attributes: joint, centre (rad), reach (to either side, rad), speed (rad/s), acceleration
    (rad/s²), torque (N·m; stops the motion if exceeded).
    """

    joint: str
    centre: float
    reach: float
    speed: float
    acceleration: float
    torque: float


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A trajectory of some joints.

    Attributes: what (RAMP, SINE, STEP, or ALL), joints, times (s, shape (n,)), positions (rad,
    shape (n, k)), velocities (rad/s, shape (n, k)).
    """

    what: str
    joints: tuple[str, ...]
    times: Floats
    positions: Floats
    velocities: Floats

    @property
    def duration(self) -> float:
        return float(self.times[-1])


class NoRoomError(ValueError):
    """The limits of a joint leave too little range."""


def bounds_of(
    joint: str,
    kind: JointKind,
    limits: JointLimits,
    position: float,
    *,
    reach: float | None = None,
    speed: float = SPEED,
    acceleration: float = ACCELERATION,
    torque: float = TORQUE,
) -> Bounds:
    """The bounds of a joint around its position, clear of its limits.

    Args:
        joint: Its name.
        kind: Of the joint.
        limits: In force.
        position: Measured, rad.
        reach: To either side, rad; None: RANGE.
        speed: Share of its limit.
        acceleration: Likewise.
        torque: Likewise.

    Raises:
        NoRoomError: the limits leave less than LEAST of the range.
    """
    requested = kind.choose(RANGE, RANGE_SLIDING) if reach is None else reach
    clear = kind.choose(CLEARANCE_RAD, CLEARANCE_M)
    low, high = limits.lower + clear, limits.upper - clear
    travel = min(requested, 0.5 * (high - low))
    if not travel > MIN_RANGE_SHARE * requested:
        raise NoRoomError(
            f"{joint} has {kind.position(limits.upper - limits.lower)} between its limits, too "
            f"little to move {kind.position(requested)} to either side; make --range smaller"
        )
    centre = min(max(position, low + travel), high - travel)
    fastest = speed * limits.velocity
    hardest = acceleration * limits.acceleration
    return Bounds(joint, centre, travel, fastest, hardest, torque * limits.torque)


def motions_of(bounds: Sequence[Bounds]) -> list[Motion]:
    """The motions of each joint alone, then, of several, of all together."""
    motions = []
    for b in bounds:
        for what, columns in ((RAMP, _ramps(b)), (SINE, _sines(b)), (STEP, _steps(b))):
            motions.append(_motion(what, (b.joint,), [columns]))
    if len(bounds) > 1:
        names = tuple(b.joint for b in bounds)
        motions.append(_motion(ALL, names, [_tones_of(k, b) for k, b in enumerate(bounds)]))
    return motions


def _motion(what: str, joints: tuple[str, ...], columns: list[Floats]) -> Motion:
    """A motion of columns, each with position and velocity, shape (2, n)."""
    times: Floats = GRID * np.arange(columns[0].shape[1], dtype=np.float64)
    whole: Floats = np.stack(columns, axis=-1)
    positions, velocities = whole
    return Motion(what, joints, times, positions, velocities)


def _ramps(bounds: Bounds) -> Floats:
    """Ways at constant speeds with rests between, first short ones with slow starts."""
    slow = CRAWL_SPEED * bounds.speed
    short = min(0.5 * slow * CRAWL, bounds.reach)
    crawls = [(short if k % 2 == 0 else -short, slow) for k in range(CRAWLS)]
    gentle = _ways(replace(bounds, acceleration=2.0 * slow / CRAWL), crawls)
    ways = [(bounds.reach, bounds.speed)]
    for share in RAMPS:
        ways += [
            (-2.0 * bounds.reach, share * bounds.speed),
            (2.0 * bounds.reach, share * bounds.speed),
        ]
    ways.append((-bounds.reach, bounds.speed))
    return np.concatenate([gentle, _ways(bounds, ways)], axis=1)


def _steps(bounds: Bounds) -> Floats:
    """Ways at the bounds of speed and acceleration."""
    ways = [(bounds.reach, bounds.speed)]
    ways += [(-2.0 * bounds.reach, bounds.speed), (2.0 * bounds.reach, bounds.speed)] * STEPS
    return _ways(bounds, [*ways, (-bounds.reach, bounds.speed)], rest=0.25 * REST)


def _ways(bounds: Bounds, ways: Sequence[tuple[float, float]], rest: float = REST) -> Floats:
    """Position and velocity along ways (distance, speed) with constant acceleration."""
    parts, place = [_still(bounds.centre, REST)], bounds.centre
    for distance, speed in ways:
        parts += [
            _way(place, distance, speed, bounds.acceleration),
            _still(place + distance, rest),
        ]
        place += distance
    parts.append(_still(place, REST))
    return np.concatenate(parts, axis=1)


def _still(place: float, seconds: float) -> Floats:
    count = round(seconds / GRID)
    return np.array([np.full(count, place), np.zeros(count)])


def _way(start: float, distance: float, speed: float, acceleration: float) -> Floats:
    """A sampled trapezoid of velocity; its last sample is at rest."""
    size = abs(distance)
    ramp = min(speed / acceleration, math.sqrt(size / acceleration))
    top = acceleration * ramp
    whole = size / top + ramp
    count = max(math.ceil(whole / GRID), 1)
    factor = whole / (count * GRID)  # a little slower, so that it ends on the grid
    t = factor * GRID * np.arange(1, count + 1)
    up, down = np.minimum(t, ramp), np.clip(t - (whole - ramp), 0.0, ramp)
    velocity = acceleration * (up - down)
    position = acceleration * (0.5 * up**2 + ramp * np.maximum(t - ramp, 0.0) - 0.5 * down**2)
    sign = math.copysign(1.0, distance)
    return np.array([start + sign * position, sign * factor * velocity])


def _sines(bounds: Bounds) -> Floats:
    """Two tones at the greatest amplitude within the bounds."""
    return _filled(bounds, SINES, [(f, share, 0.0) for f, share in TONES])


def _tones_of(k: int, bounds: Bounds) -> Floats:
    """Three tones of joint k, at frequencies that differ from joint to joint."""
    base = MIN_FREQUENCY_HZ * FREQUENCY_RATIO ** (k % 8)
    tones = [(base, 1.0, 0.9 * k), (2.3 * base, 0.5, 2.1 * k), (4.1 * base, 0.25, 0.4 * k)]
    return _filled(bounds, ALL_JOINTS_S, tones)


def _filled(bounds: Bounds, seconds: float, tones: Sequence[tuple[float, float, float]]) -> Floats:
    """Tones (Hz, share, phase) that fade in and out, at the greatest amplitude in the bounds."""
    t = GRID * np.arange(round(seconds / GRID) + 1)
    shape = np.zeros_like(t)
    for frequency, share, phase in tones:
        angular = 2.0 * math.pi * frequency
        shape += share / frequency * np.sin(angular * t + phase)
    shape *= minimum_jerk(np.minimum(t, t[-1] - t) / FADE)
    rate = np.gradient(shape, GRID)
    rate[[0, -1]] = 0.0
    peaks = (np.abs(row).max() for row in (shape, rate, np.gradient(rate, GRID)))
    size = min(
        bound / peak
        for bound, peak in zip(
            (bounds.reach, bounds.speed, bounds.acceleration), peaks, strict=True
        )
    )
    rest = _still(bounds.centre, REST)
    moving = np.array([bounds.centre + size * shape, size * rate])
    return np.concatenate([rest, moving, rest], axis=1)

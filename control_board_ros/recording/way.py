# SPDX-License-Identifier: Apache-2.0
"""The recorded motion of guided joints, as a trajectory within their limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from control_board_ros.joint_limits import JointLimits
from control_board_ros.protocols import Floats

from .errors import RecordingError
from .figures import gaps_in
from .reading import BoardRecording

#: s between points; motion within twice that is a hand's tremor.
GRID = 0.05
#: Minimum travel that counts as motion, rad or m.
MIN_MOTION = 2e-3
#: Share of a joint's limits of speed and acceleration used by a replay.
SHARE = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """A trajectory.

    Attributes:
        names: Of the joints.
        times: Of its n points, from 0, s.
        positions: rad, shape (n, k).
        velocities: rad/s, shape (n, k); 0 at both ends.
        stretched: Duration over the requested one, for the limits.
    """

    names: tuple[str, ...]
    times: Floats
    positions: Floats
    velocities: Floats
    stretched: float

    @property
    def duration(self) -> float:
        return float(self.times[-1])


def way_of(
    recording: BoardRecording, names: Sequence[str], limits: Sequence[JointLimits], speed: float
) -> Way:
    """The motion of joints in a recording, without the rest before and after it.

    Points every GRID s are means over ±GRID, with velocities of central differences, bounded by
    the limits of position; slower where the limits of speed or acceleration require it.

    Args:
        recording: Of the board.
        names: The joints.
        limits: Of each joint.
        speed: Of the replay; 1: as recorded.

    Raises:
        RecordingError: no joint moves, joints are missing, or there is a gap in the motion.
    """
    if missing := [name for name in names if name not in recording.names]:
        raise RecordingError(f"{', '.join(missing)}: not in the recording")
    columns = [recording.names.index(name) for name in names]
    measured = recording.signals["position"][:, columns]
    good = np.isfinite(measured).all(axis=1)
    time, measured = recording.time[good], measured[good]
    if time.size < 2 or not np.ptp(measured, axis=0).max() > MIN_MOTION:
        raise RecordingError("no joint moves in the recording; guide it, then record")
    away = np.abs(measured - measured[0]).max(axis=1) > MIN_MOTION
    still = np.abs(measured - measured[-1]).max(axis=1) > MIN_MOTION
    first, last = int(np.argmax(away)), time.size - 1 - int(np.argmax(still[::-1]))
    begin, end = max(time[first] - 4.0 * GRID, time[0]), min(time[last] + 4.0 * GRID, time[-1])
    inside = (time >= begin) & (time <= end)
    for k in gaps_in(time[inside]):
        before, after = time[inside][k : k + 2]
        raise RecordingError(
            f"there are no states from {before:.6g} to {after:.6g} s: the motion between is not "
            "known; record it again"
        )
    count = max(int(np.ceil((end - begin) / GRID)), 4)
    grid = np.linspace(begin, end, count + 1)
    points = np.column_stack([_means(time, row, grid) for row in measured.T])
    low = np.array([limit.lower for limit in limits])
    high = np.array([limit.upper for limit in limits])
    points = np.clip(points, low, high)
    step = (end - begin) / count / speed
    velocities = np.zeros_like(points)
    velocities[1:-1] = (points[2:] - points[:-2]) / (2.0 * step)
    # greatest speed and acceleration of the cubic between two points
    slope = np.diff(points, axis=0) / step
    before, after = velocities[:-1], velocities[1:]
    middle = np.abs(1.5 * slope - 0.25 * (before + after))
    fastest = np.maximum(np.abs(velocities).max(axis=0), middle.max(axis=0))
    bends = np.maximum(
        np.abs(6.0 * slope - 4.0 * before - 2.0 * after),
        np.abs(-6.0 * slope + 2.0 * before + 4.0 * after),
    )
    hardest = bends.max(axis=0) / step
    most_speed = SHARE * np.array([limit.velocity for limit in limits])
    most_bend = SHARE * np.array([limit.acceleration for limit in limits])
    needed = np.maximum(fastest / most_speed, np.sqrt(hardest / most_bend))
    stretched = max(1.0, float(needed.max()))
    times = step * stretched * np.arange(count + 1)
    return Way(tuple(names), times, points, velocities / stretched, stretched)


def _means(time: Floats, values: Floats, grid: Floats) -> Floats:
    """The mean of a signal within ±GRID around each time, from differences of its integral."""
    areas = np.concatenate([[0.0], np.cumsum(np.diff(time) * 0.5 * (values[1:] + values[:-1]))])
    low = np.maximum(grid - GRID, time[0])
    high = np.minimum(grid + GRID, time[-1])
    width = np.minimum(grid - low, high - grid)  # the same on both sides
    low, high = grid - width, grid + width
    narrow = width < 1e-6
    span = np.where(narrow, 1.0, high - low)
    inside = (np.interp(high, time, areas) - np.interp(low, time, areas)) / span
    return np.where(narrow, np.interp(grid, time, values), inside)

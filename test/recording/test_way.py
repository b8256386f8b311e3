# SPDX-License-Identifier: Apache-2.0
"""recording/way.py: what a hand did becomes a trajectory within the limits (SPEC G2, T1)."""

from __future__ import annotations

import numpy as np
import pytest

from control_board_ros.joint_limits import JointLimits
from control_board_ros.recording.errors import RecordingError
from control_board_ros.recording.reading import BoardRecording
from control_board_ros.recording.way import way_of

TIME = np.arange(0.0, 8.0, 0.02)
WIDE = JointLimits(lower=-2.0, upper=2.0, velocity=10.0, acceleration=100.0)


def recorded(positions: np.ndarray) -> BoardRecording:
    """Of one joint that was there at TIME, with the noise of an encoder."""
    noisy = positions + np.random.default_rng(1).normal(0.0, 1e-5, TIME.size)
    nothing = np.zeros((TIME.size, 1))
    return BoardRecording(
        "/b", 0.0, ("a",), TIME, {"position": noisy[:, None]}, nothing == 0.0, nothing
    )


def swing(size: float) -> np.ndarray:
    """Rest, from 2 s to 4 s a smooth way there, rest."""
    s = np.clip((TIME - 2.0) / 2.0, 0.0, 1.0)
    return size * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


def test_the_path_is_the_guided_motion_without_pauses() -> None:
    """G2: same places, same speeds, at rest at both ends."""
    way = way_of(recorded(swing(1.0)), ["a"], [WIDE], 1.0)
    assert way.stretched == 1.0
    assert 1.5 < way.duration < 3.0
    assert way.positions[[0, -1], 0] == pytest.approx([0.0, 1.0], abs=5e-3)
    assert way.velocities[[0, -1]] == pytest.approx(0.0)
    assert way.velocities.max() == pytest.approx(1.875 / 2.0, rel=0.03)


def test_half_the_speed_lasts_twice_as_long() -> None:
    whole = way_of(recorded(swing(1.0)), ["a"], [WIDE], 1.0)
    slow = way_of(recorded(swing(1.0)), ["a"], [WIDE], 0.5)
    assert slow.duration == pytest.approx(2.0 * whole.duration)
    assert slow.velocities == pytest.approx(0.5 * whole.velocities)


@pytest.mark.parametrize(("speed", "acceleration"), [(0.3, 100.0), (10.0, 0.5)])
def test_limits_make_it_slower(speed: float, acceleration: float) -> None:
    """T1: of speed and of acceleration; the way stays the same."""
    tight = JointLimits(lower=-2.0, upper=0.8, velocity=speed, acceleration=acceleration)
    way = way_of(recorded(swing(1.0)), ["a"], [tight], 1.0)
    step = way.times[1]
    assert way.stretched > 1.0
    assert np.abs(np.diff(way.positions, axis=0)).max() / step <= speed
    assert np.abs(np.diff(way.velocities, axis=0)).max() / step <= acceleration
    assert way.positions.max() == 0.8


def test_recordings_without_motion_have_no_path() -> None:
    with pytest.raises(RecordingError, match="no joint moves"):
        way_of(recorded(swing(0.0)), ["a"], [WIDE], 1.0)
    with pytest.raises(RecordingError, match="b: not in the recording"):
        way_of(recorded(swing(1.0)), ["b"], [WIDE], 1.0)

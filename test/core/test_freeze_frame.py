# SPDX-License-Identifier: Apache-2.0
"""Freeze frames: which cycles are kept of a fault, of which joint (SPEC E3)."""

from __future__ import annotations

import numpy as np
import pytest
from rig import board_config

from control_board_ros.core.state import BLOCK_ROWS, Reference, StateArrays
from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.watch.freeze_frame import AFTER, BEFORE, FreezeFrames

PERIOD = 0.05
KEPT_BEFORE, KEPT_AFTER = round(BEFORE / PERIOD), round(AFTER / PERIOD)
KEPT = KEPT_BEFORE + KEPT_AFTER


class Recorder:
    """Frames of three joints; in cycle k the time is k, the position 100·joint + k."""

    def __init__(self) -> None:
        self.state = StateArrays(board_config().names)
        self.frames = FreezeFrames(self.state, PERIOD)
        self.cycle = 0

    def note(self, cycles: int) -> None:
        for _ in range(cycles):
            self.state.time = float(self.cycle)
            self.state.position[:] = [100.0 * j + self.cycle for j in range(3)]
            self.state.done[:] = [(self.cycle + j) % 2 == 0 for j in range(3)]
            self.frames.note()
            self.cycle += 1

    def check(self, j: int, first: int, end: int) -> None:
        """The frame of a joint is of these cycles."""
        frame = self.frames.of(j)
        assert frame is not None
        cycles = np.arange(first, end)
        assert frame.stamps.tolist() == cycles.tolist()
        assert frame.block.shape == (end - first, BLOCK_ROWS)
        assert frame.block.dtype == np.float32
        assert frame.block[:, Row.POSITION].tolist() == (100 * j + cycles).tolist()
        assert not frame.block[:, Reference.OUTPUT].any()
        assert frame.done.tolist() == ((cycles + j) % 2 == 0).tolist()


@pytest.fixture
def recorder() -> Recorder:
    return Recorder()


def test_a_frame_holds_cycles_before_and_after_a_fault(recorder: Recorder) -> None:
    recorder.note(100)
    assert recorder.frames.of(1) is None
    recorder.frames.fault(1)
    recorder.note(200)
    recorder.check(1, 100 - KEPT_BEFORE, 100 + KEPT_AFTER)
    assert recorder.frames.of(0) is None


def test_a_frame_grows_until_it_is_complete(recorder: Recorder) -> None:
    recorder.note(100)
    recorder.frames.fault(2)
    for cycle in range(1, KEPT_AFTER + 1):
        recorder.note(1)
        first = 100 + cycle - KEPT if cycle < KEPT_AFTER else 100 - KEPT_BEFORE
        recorder.check(2, first, 100 + cycle)
    recorder.note(1)
    recorder.check(2, 100 - KEPT_BEFORE, 100 + KEPT_AFTER)


def test_a_fault_soon_after_the_start_has_fewer_cycles(recorder: Recorder) -> None:
    recorder.note(3)
    recorder.frames.fault(0)
    recorder.note(2)
    recorder.check(0, 0, 5)
    recorder.note(100)
    recorder.check(0, 0, 3 + KEPT_AFTER)


def test_the_frame_is_of_the_last_fault(recorder: Recorder) -> None:
    """Also where the one before was not complete; another joint keeps its own."""
    recorder.note(50)
    recorder.frames.fault(0)
    recorder.frames.fault(1)
    recorder.note(KEPT_AFTER - 2)
    recorder.frames.fault(0)
    second = 50 + KEPT_AFTER - 2
    recorder.note(5)  # the first one would be complete by now
    recorder.check(0, second + 5 - KEPT, second + 5)
    recorder.note(300)
    recorder.check(0, second - KEPT_BEFORE, second + KEPT_AFTER)
    recorder.check(1, 50 - KEPT_BEFORE, 50 + KEPT_AFTER)
    recorder.frames.fault(1)
    recorder.note(1)
    recorder.check(1, recorder.cycle - KEPT, recorder.cycle)


def test_all_joints_at_once_are_whole(recorder: Recorder) -> None:
    """They are cut out one after the other; the ring has room for that."""
    recorder.note(200)
    for j in (2, 0, 1):
        recorder.frames.fault(j)
    recorder.note(KEPT_AFTER + 3)
    for j in range(3):
        recorder.check(j, 200 - KEPT_BEFORE, 200 + KEPT_AFTER)


def test_the_size_is_that_of_the_ring_and_its_frames(recorder: Recorder) -> None:
    """About 10 MB at 32 joints and 1 kHz, as the docstring says."""
    cycles = KEPT + 3
    ring = cycles * (3 * BLOCK_ROWS * 4 + 3 + 8)
    assert recorder.frames.size == ring
    recorder.note(100)
    recorder.frames.fault(0)
    recorder.note(100)
    frame = KEPT * (BLOCK_ROWS * 4 + 1 + 8)
    assert recorder.frames.size == ring + frame
    whole = 1e-3 / PERIOD
    assert 32 * (ring / 3 + frame) / whole < 10e6

# SPDX-License-Identifier: Apache-2.0
"""The moves in a recording: changes of a joint's position reference, and its response."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.core.terms.modes import STOPPABLE
from control_board_ros.protocols import Floats

from .figures import (
    StepFigures,
    TrackingFigures,
    mean_over_time,
    step_figures,
    time_saturated,
    tracking_figures,
)
from .reading import BoardRecording

#: Modes with a position reference.
FOLLOWING = frozenset(mode.code for mode in STOPPABLE)
#: Minimum travel of a reference, rad and m.
MIN_TRAVEL_RAD, MIN_TRAVEL_M = 2e-3, 2e-4
#: s without change between two moves; s evaluated after the end of a move.
PAUSE, AFTER = 0.1, 2.0
#: Share of the time after the end for the steady-state error.
STEADY = 0.25
#: Travel of a move, in multiples of its distance, from which it counts as to and fro.
MAX_DETOUR = 1.5


@dataclass(frozen=True, slots=True)
class Move:
    """A move of one joint.

    Attributes:
        joint: Its name.
        mode: The control mode, code.
        begin: Start of the reference's change, s.
        end: End of the reference's change, s.
        until: End of the evaluation, s.
        start: Reference before, rad or m.
        target: Reference in the end, rad or m.
        step: Rise, settling, overshoot; None for a move to and fro.
        tracking: Error and lag.
        steady_error: Reference minus position at the end, rad or m.
        saturated: Time at the limit of the output or the torque, s.
    """

    joint: str
    mode: str
    begin: float
    end: float
    until: float
    start: float
    target: float
    step: StepFigures | None
    tracking: TrackingFigures
    steady_error: float
    saturated: float


def moves_of(recording: BoardRecording, joint: str, kind: JointKind) -> list[Move]:
    least = kind.choose(MIN_TRAVEL_RAD, MIN_TRAVEL_M)
    return [
        move(recording, joint, mode, *change)
        for begin, end, mode in recording.control_modes(joint)
        if mode in FOLLOWING
        for change in changes(recording, joint, (begin, end), least)
    ]


def changes(
    recording: BoardRecording, joint: str, within: tuple[float, float], least: float
) -> Iterator[tuple[int, int, int]]:
    """Samples of each change of the reference: first (at rest), last, end of the evaluation."""
    time, reference = recording.time, recording.signal("position_reference", joint)
    low, high = np.searchsorted(time, within)
    # The first sample of a mode may belong to the previous one.
    moving = low + 1 + np.flatnonzero(np.diff(reference[low + 1 : high]) != 0.0)
    if not moving.size:
        return
    gaps = np.flatnonzero(np.diff(time[moving]) > PAUSE)
    firsts = moving[np.concatenate(([0], gaps + 1))]
    lasts = moving[np.concatenate((gaps, [moving.size - 1]))] + 1
    nexts = np.concatenate((firsts[1:], [high - 1]))
    for first, last, following in zip(firsts, lasts, nexts, strict=True):
        stop = int(min(np.searchsorted(time, time[last] + AFTER), following))
        travelled = float(np.ptp(reference[first : last + 1]))
        if travelled >= least and stop > last:
            yield int(first), int(last), stop


def move(
    recording: BoardRecording, joint: str, mode: str, first: int, last: int, stop: int
) -> Move:
    window = slice(first, stop + 1)
    time = recording.time[window]
    reference = recording.signal("position_reference", joint)[window]
    position = recording.signal("position", joint)[window]
    start, target = float(reference[0]), float(reference[-1])
    travelled = float(np.ptp(reference))
    direct = abs(target - start) * MAX_DETOUR >= travelled
    rest = recording.time[last] + (1.0 - STEADY) * (time[-1] - recording.time[last])
    steady = time >= rest
    return Move(
        joint=joint,
        mode=mode,
        begin=float(time[0]),
        end=float(recording.time[last]),
        until=float(time[-1]),
        start=start,
        target=target,
        step=step_figures(time, position, float(position[0]), target) if direct else None,
        tracking=tracking_figures(time, reference, position),
        steady_error=steady_error(time[steady], (reference - position)[steady]),
        saturated=saturated(recording, joint, window),
    )


def steady_error(time: Floats, error: Floats) -> float:
    """The mean error over a time; the last error for a single sample."""
    return mean_over_time(time, error) if time.size > 1 else float(error[-1])


def saturated(recording: BoardRecording, joint: str, window: slice) -> float:
    """Time at the limit of the output or of the torque, s; the longer one."""
    time = recording.time[window]
    limit = recording.parameter(joint, "limits.output", 100.0)
    torque = recording.parameter(joint, "limits.torque")
    return max(
        time_saturated(time, recording.signal("output", joint)[window], limit),
        time_saturated(time, recording.signal("torque_reference", joint)[window], torque),
    )

# SPDX-License-Identifier: Apache-2.0
"""The torque from outside that a board would show over recorded motions (SPEC X1), and thresholds.

It is the observer of ``core.laws``, with the parameters as they were identified. Where nothing
touches the arm, it shows what the model does not explain: a threshold lies above it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import minimum_filter1d

from ..core.laws.control import SLIP
from ..protocols import Floats
from .rigid import torques
from .robot import Robot
from .samples import Record

#: s at the start of a record in which the observer settles.
SETTLING = 0.3
#: Readings in the time of an observer's bandwidth: with fewer, each step of velocity is a torque.
READINGS = 20.0
#: Length of a block, s: peaks in several are independent. Minimum number of blocks with motion.
BLOCK, FEWEST = 1.0, 60
#: Share of the blocks with the greatest peaks, by which the tail is estimated.
TAIL = 0.1
HOUR = 3600.0


@dataclass(frozen=True, slots=True, eq=False)
class External:
    """Torques from outside over a record: time (s, shape (m,)), torque (N·m, shape (m, n))."""

    time: Floats
    torque: Floats


@dataclass(frozen=True, slots=True)
class Threshold:
    """Of a joint, N·m: the upper end of its 95 % interval, half the width of that, the residual's
    rms, and its worst.
    """

    value: float
    sure: float
    rms: float
    worst: float


def external(robot: Robot, records: Sequence[Record]) -> list[External]:
    """The torques from outside over records, with the robot's parameters.

    Raises:
        IdentificationError: the URDF's masses have no effect on the joints.
    """
    arm = robot.loaded_model().arm()
    dry, wet = robot.numbers("motor.coulomb"), robot.numbers("motor.viscous")
    slip = SLIP * robot.numbers("limits.velocity")
    limit = robot.numbers("contact.bandwidth")
    traces = []
    for record in records:
        velocity, torque = record.signals["velocity"], record.signals["torque"]
        senses = np.isfinite(torque).all(axis=0)
        friction = dry * np.clip(velocity / slip, -1.0, 1.0) + wet * velocity
        sensed = np.where(senses, torque, robot.gains * record.signals["current"] - friction)
        # M Δq̇/T + c + g, as the board has it at each reading
        rates = np.diff(velocity, axis=0) / np.diff(record.time)[:, None]
        left = torques(arm, record.signals["position"][1:], velocity[1:], rates) - sensed[1:]
        rate = 2.0 * math.pi * np.minimum(limit, bandwidth(record))
        share = -np.expm1(-rate * np.diff(record.time)[:, None])
        shown, now = np.empty_like(left), np.zeros(left.shape[1])
        for k, (value, part) in enumerate(zip(left, share, strict=True)):
            now = now + part * (value - now)
            shown[k] = now
        time = record.time[1:]
        settled = time >= record.time[0] + SETTLING
        traces.append(External(time[settled], shown[settled]))
    return traces


def bandwidth(record: Record) -> float:
    """Greatest bandwidth of an observer that its readings show, Hz."""
    return float(1.0 / (READINGS * np.median(np.diff(record.time))))


def threshold(
    shown: Sequence[External], column: int, lasting: float, alarms: float, least: float = 0.0
) -> Threshold | None:
    """The threshold of a joint; None: too short, or not known.

    Peaks of each second beyond the highest tenth of them are taken as exponentially distributed.

    Args:
        shown: Torques from outside, where nothing touches the arm.
        column: The joint.
        lasting: ``contact.time``, s.
        alarms: False ones per hour that are permitted.
        least: The threshold is not below it, N·m: dry friction, where a current is all that tells
            the torque, which a gearbox at rest may hold.
    """
    peaks, squares, count = [], 0.0, 0
    for trace in shown:
        if trace.time.size < 2:
            continue
        size = np.abs(trace.torque[:, column])
        squares, count = squares + float((size**2).sum()), count + size.size
        step = float(np.median(np.diff(trace.time)))
        held = minimum_filter1d(size, max(round(lasting / step), 1))
        blocks = np.floor((trace.time - trace.time[0]) / BLOCK).astype(np.intp)
        best = np.zeros(int(blocks[-1]) + 1)
        np.maximum.at(best, blocks, held)
        peaks += best.tolist()
    row = np.array(peaks)
    if row.size < FEWEST or not np.isfinite(row).all():
        return None
    start = float(np.quantile(row, 1.0 - TAIL))
    above = row[row > start] - start
    if not above.size:
        return None
    often = above.size / row.size * HOUR / BLOCK / alarms
    way = math.log(max(often, 1.0))
    mean = float(above.mean())
    sure = 1.96 * way * mean / math.sqrt(above.size)
    worst = float(row.max())
    value = max(start + way * mean + sure, worst, least)
    return Threshold(value, sure, math.sqrt(squares / count), worst)

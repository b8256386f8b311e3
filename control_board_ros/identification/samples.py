# SPDX-License-Identifier: Apache-2.0
"""Records of motions, and the samples of a fit: filtered, with accelerations.

All signals pass the same zero-phase low pass (a Gaussian), which leaves linear equations of motion
true; the acceleration is the derivative of the filtered velocity. Units: rad, rad/s, rad/s², N·m,
A, V, s; m and N where joints slide.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from ..protocols import Floats
from ..recording.figures import MOST_EVEN
from .motions import CRAWL, CRAWL_SPEED, CRAWLS, RAMP

Bools = NDArray[np.bool_]
Signals = dict[str, Floats]

#: Recorded signals of every joint.
SIGNALS = (
    "position",
    "velocity",
    "torque",
    "current",
    "output",
    "position_reference",
    "motor_position",
)
#: Standard deviation of the low pass, s, and at least this many readings.
WIDTH, READINGS = 0.02, 2.0
#: Cut at both ends, and around reversals, in standard deviations.
TAIL = 4.0
#: Minimum duration of a used record, s.
MIN_RECORD_S = 0.5
#: How far apart the peaks of friction of several starts are, s.
START_SPREAD_S = 0.2
#: Share of a joint's speed from which on its friction is that of motion.
FRICTION = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """The readings of one motion.

    Attributes:
        what: The kind of motion.
        speeds: The greatest requested speed of each moving joint, by name, rad/s.
        time: Of each reading, s, shape (m,).
        signals: By the names of SIGNALS, of the board's joints, shape (m, n); output in %; NaN
            where not measured.
        ended: Reason of an early end; empty: none.
    """

    what: str
    speeds: Mapping[str, float]
    time: Floats
    signals: Signals
    ended: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples for a fit: m of them, of the board's n joints.

    Attributes:
        position, velocity, acceleration, torque, current: Filtered, shape (m, n); torque NaN
            where not measured.
        change: Of the current, A/s, shape (m, n).
        rise: Of the torque, N·m/s, shape (m, n).
        voltage: Of the motors: value, per s, per s², shape (m, n, 3).
        moving: The joint moves steadily in one direction, shape (m, n).
        commanded: The motion is of the joint, shape (m, n).
        start: The joint starts to move, 1 or −1 by direction; else 0, shape (m, n).
        time: s from the first sample, without pauses between motions, shape (m,).
        block: Number of a sample's second, shape (m,).
    """

    position: Floats
    velocity: Floats
    acceleration: Floats
    torque: Floats
    current: Floats
    change: Floats
    rise: Floats
    voltage: Floats
    moving: Bools
    commanded: Bools
    start: Floats
    time: Floats
    block: NDArray[np.intp]


def samples_of(
    records: Sequence[Record], names: Sequence[str], supply: Floats, gain: Floats
) -> Samples:
    """The samples of records.

    Args:
        records: Of the motions.
        names: The board's n joints.
        supply: Voltage of each at 100 % output, V, shape (n,).
        gain: Torque per ampere of each, about, N·m/A, shape (n,).

    Raises:
        ValueError: every record is too short.
    """
    parts: list[dict[str, Floats]] = []
    blocks, since = 0, 0.0
    for record in records:
        if record.time.size < 8 or record.time[-1] - record.time[0] < MIN_RECORD_S:
            continue
        if np.ptp(record.time) > MOST_EVEN * record.time.size * np.median(np.diff(record.time)):
            continue  # mostly a gap, or a step of the clock
        step, width, whole = smoothed(record, supply)
        time: Floats = step * np.arange(len(whole["position"]), dtype=np.float64)
        cut = int(np.ceil(TAIL * width / step))
        whole["moving"] = steady(whole["velocity"], record.speeds, names, cut)
        whole["commanded"] = np.zeros_like(whole["velocity"])
        whole["commanded"][:, [list(names).index(joint) for joint in record.speeds]] = 1.0
        whole["start"] = np.zeros_like(whole["velocity"])
        rows = np.arange(cut, time.size - cut, max(round(width / step), 1))
        rows = rows[~near_gaps(record.time - record.time[0], time[rows], width)]
        if not rows.size:
            continue
        part = {name: values[rows] for name, values in whole.items()} | {"time": time[rows]}
        if record.what == RAMP:
            (joint, speed), *_ = record.speeds.items()
            column = list(names).index(joint)
            begins = np.array(
                starts(whole, step, column, float(gain[column]), CRAWL_SPEED * speed), int
            )
            begins = begins[~near_gaps(record.time - record.time[0], time[begins], width)]
            part = joined([part, of_starts(whole, begins, column, time)])
        part["block"] = blocks + np.floor(part["time"])
        blocks = int(part["block"].max()) + 1
        part["time"] = part["time"] + since
        since = float(part["time"].max()) + width
        parts.append(part)
    if not parts:
        raise ValueError(
            f"no motion was recorded for {MIN_RECORD_S:g} s without gaps of more than "
            f"{1e3 * WIDTH:g} ms between readings; is the machine or the network overloaded?"
        )
    made = joined(parts)
    columns: dict[str, Any] = {field.name: made[field.name] for field in fields(Samples)}
    columns["block"] = made["block"].astype(np.intp)
    return Samples(**columns | {name: made[name] > 0.5 for name in ("moving", "commanded")})


def joined(parts: Sequence[dict[str, Floats]]) -> dict[str, Floats]:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def smoothed(record: Record, supply: Floats) -> tuple[float, float, Signals]:
    """The step of an even grid of time, s, the low pass, s, and signals on it, shape (m, n)."""
    raw = record.time - record.time[0]
    step = float(np.median(np.diff(raw)))
    width = max(WIDTH, READINGS * step)
    time = step * np.arange(round(raw[-1] / step) + 1)

    def even(values: Floats, order: int = 0) -> Floats:
        rows = np.column_stack([np.interp(time, raw, column) for column in values.T])
        made = gaussian_filter1d(rows, width / step, axis=0, order=order, mode="nearest")
        derivative: Floats = made / step**order
        return derivative

    signals = record.signals
    volts = 0.01 * signals["output"] * supply
    return (
        step,
        width,
        {
            "position": even(signals["position"]),
            "velocity": even(signals["velocity"]),
            "acceleration": even(signals["velocity"], 1),
            "torque": even(signals["torque"]),
            "current": even(signals["current"]),
            "change": even(signals["current"], 1),
            "rise": even(signals["torque"], 1),
            "voltage": np.stack([even(volts, order) for order in range(3)], axis=-1),
            "reference": even(signals["position_reference"], 1),
        },
    )


def near_gaps(readings: Floats, time: Floats, width: float) -> Bools:
    """Whether times, s, are so near to a gap of readings that the low pass lacks data."""
    gaps = np.flatnonzero(np.diff(readings) > width)
    near = np.zeros(time.size, dtype=np.bool_)
    for begin, end in zip(readings[gaps], readings[gaps + 1], strict=True):
        near |= (time > begin - TAIL * width) & (time < end + TAIL * width)
    return near


def steady(
    velocity: Floats, speeds: Mapping[str, float], names: Sequence[str], cut: int
) -> Floats:
    """1 where a joint moves in one direction, and not slowly, for ``cut`` samples to each side."""
    at_rest = np.zeros_like(velocity)
    for joint, speed in speeds.items():
        column = list(names).index(joint)
        for sign in (1.0, -1.0):
            slow = ~(sign * velocity[:, column] > FRICTION * speed)
            near = np.convolve(slow, np.ones(2 * cut + 1), mode="same")
            at_rest[:, column] += near < 0.5
    return at_rest


def starts(signals: Signals, step: float, column: int, gain: float, slow: float) -> list[int]:
    """Samples at which a joint starts to move: the friction peak of every slow start.

    Friction is the current's torque beyond the measured one; without torque sensor the current's
    torque, as the load is almost constant on so short a way. The peak is searched near that of the
    mean of all starts, smoothed, which is not the greatest noise.

    Args:
        signals: Filtered, of ramps.
        step: From sample to sample, s.
        column: The joint.
        gain: Torque per ampere, N·m/A.
        slow: Speed of the slow ramps, rad/s.
    """
    rate = signals["reference"][:, column]
    under_way = np.abs(rate) > 0.1 * slow
    begins = np.flatnonzero(under_way[1:] & ~under_way[:-1])[:CRAWLS]
    window = round(0.5 * CRAWL / step)
    begins = begins[begins + window < rate.size]
    if not begins.size:
        return []
    friction = gain * signals["current"][:, column]
    measured = signals["torque"][:, column]
    friction = friction - measured if np.isfinite(measured).all() else friction
    ways = np.array([np.sign(rate[b + window // 2]) * friction[b : b + window] for b in begins])
    ways = gaussian_filter1d(ways, 2.0 * WIDTH / step, axis=1, mode="nearest")
    peak, near = int(np.argmax(ways.mean(axis=0))), round(START_SPREAD_S / step)
    first = max(peak - near, 0)
    return [
        int(begin) + first + int(np.argmax(way[first : peak + near]))
        for begin, way in zip(begins, ways, strict=True)
    ]


def of_starts(
    whole: Signals, rows: NDArray[np.intp], column: int, time: Floats
) -> dict[str, Floats]:
    """The samples at which a joint starts to move."""
    part = {name: values[rows] for name, values in whole.items()}
    part["moving"], part["start"] = np.zeros_like(part["velocity"]), part["start"].copy()
    part["start"][:, column] = np.sign(part["reference"][:, column])
    return part | {"time": time[rows]}

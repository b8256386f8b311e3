# SPDX-License-Identifier: Apache-2.0
"""Rows of the table about streams of direct positions, as programs send them (SPEC P4)."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import numpy as np

from .position_rows import Figures, sine_amplitude
from .rig import M, Record, Rig, Way

#: What is sent in which control cycle: times of samples, s.
Schedule = dict[int, list[float]]

#: A stream that comes unevenly: late by up to this part of its interval, this part lost.
LATE, LOST, SEED = 0.8, 0.03, 7


def even(rate: float, seconds: float, period: float) -> Schedule:
    """Samples at an even rate, in the cycles nearest to their times."""
    every = max(1, round(1.0 / (rate * period)))
    return {k: [k * period] for k in range(0, round(seconds / period), every)}


def uneven(rate: float, seconds: float, period: float, *, made_late: bool) -> Schedule:
    """Samples late by up to LATE intervals, a part of them LOST.

    Args:
        rate: Hz.
        seconds: how long.
        period: of control, s.
        made_late: samples are made when they are sent; else on the even grid, and arrive late.
    """
    chance, due = random.Random(SEED), Schedule()
    for k in range(int(seconds * rate)):
        late = chance.uniform(0.0, LATE) / rate
        if chance.random() >= LOST:
            sent = k / rate + late
            cycle = math.ceil(sent / period - 1e-9)
            due.setdefault(cycle, []).append(sent if made_late else k / rate)
    return due


def sent(
    rig: Rig, j: int, due: Schedule, path: Callable[[float], float], seconds: float
) -> Record:
    """What a joint does while samples of a path are sent when they are due."""

    def send(time: float) -> None:
        for made in due.get(round(time / rig.period), ()):
            rig.expect(rig.board.set_position(j, path(made)))

    return rig.record(j, seconds, each=send)


def prepare(rig: Rig, j: int, amplitude: float) -> float:
    """Bring a joint to the centre of a sine, STIFF in POSITION_DIRECT; where that is."""
    centre = rig.windows[j].clip(rig.pose(j), amplitude + 0.05 * rig.windows[j].span)
    rig.go({j: centre})
    rig.enter(j, M.POSITION_DIRECT, Way.STIFF)
    rig.run(0.1)
    return centre


def abrupt(rig: Rig, j: int) -> Figures:
    """A sine c + A sin(2πft) by direct positions at 1 kHz and 100 Hz, at full speed from rest.

    Its peak acceleration is 0.9 and 0.95 of limits.acceleration, its peak speed at most 0.8 of
    limits.velocity, A at most 0.2 of the range; f = 1 Hz, or more where required, at most
    2 Hz: where that is not enough, the sine is slower than stated. error = max |q(t) − s(t)| / A
    over the third and fourth period, percent.
    """
    limits, span = rig.joints[j].limits, rig.windows[j].span
    found: Figures = {}
    for part, key in ((0.9, "at_90"), (0.95, "at_95")):
        peak = part * limits.acceleration
        omega = max(2.0 * math.pi, peak / (0.8 * limits.velocity), math.sqrt(peak / (0.2 * span)))
        omega = min(omega, 4.0 * math.pi)
        amplitude = min(peak / omega**2, 0.8 * limits.velocity / omega, 0.2 * span)
        lasts = 4.0 * 2.0 * math.pi / omega
        errors = []
        for rate in (1000.0, 100.0):
            centre = prepare(rig, j, amplitude)
            path = _sine(centre, amplitude, omega)
            record = sent(rig, j, even(rate, lasts, rig.period), path, lasts)
            late = record.time >= 0.5 * lasts
            off = record.position - centre - amplitude * np.sin(omega * record.time)
            errors.append(100.0 * float(np.abs(off[late]).max()) / amplitude)
        found[key] = max(errors)
    return found


def ripple(rig: Rig, j: int) -> Figures:
    """Torque and current of an even stream at 100 Hz, STIFF.

    ripple = max (peak to peak of the measured torque in 20 ms) / limits.torque, percent, over the
    second period of the sine of 1 Hz of row ``sine``. current = RMS over the nominal current of
    the same sine at 0.5 Hz, peak speed and acceleration a quarter of the limits at most.
    """
    found: Figures = {}
    limits = rig.joints[j].limits
    for key, frequency, part in (("ripple", 1.0, 0.5), ("current", 0.5, 0.25)):
        omega = 2.0 * math.pi * frequency
        amplitude = sine_amplitude(rig, j, omega, part)
        centre = prepare(rig, j, amplitude)
        lasts = 2.0 / frequency
        due = even(100.0, lasts, rig.period)
        currents: list[float] = []

        def look(
            time: float, path: Callable[[float], float], due: Schedule, kept: list[float]
        ) -> None:
            for made in due.get(round(time / rig.period), ()):
                rig.expect(rig.board.set_position(j, path(made)))
            kept.append(float(rig.board.snapshot().current[j]))

        path = _sine(centre, amplitude, omega)
        record = rig.record(j, lasts, each=lambda t, a=path, b=due, c=currents: look(t, a, b, c))
        late = record.time >= 1.0 / frequency
        if key == "ripple":
            windows = np.lib.stride_tricks.sliding_window_view(
                record.torque[late], max(2, round(0.02 / rig.period))
            )
            peak = float(np.ptp(windows, axis=1).max())
            found[key] = 100.0 * peak / limits.torque
        else:
            nominal = limits.nominal_current
            found[key] = float(np.sqrt(np.mean(np.square(np.array(currents)[late])))) / nominal
    return found


def jitter(rig: Rig, j: int) -> Figures:
    """A sine of 1 Hz by a stream that arrives late by up to 0.8 of its interval, 3 % lost, STIFF.

    At 20, 30, 50, 100, 500 Hz, made on the even grid and made when sent, the worse of the two.
    error = max |q(t) − s(t)| / A, speed = max |dq − ds/dt| / max |ds/dt|, percent, from the third
    period to the fifth; the sine is that of row ``sine``. Lateness and losses are those of one
    seed.
    """
    omega = 2.0 * math.pi
    amplitude = sine_amplitude(rig, j, omega)
    found: Figures = {}
    for rate in (20.0, 30.0, 50.0, 100.0, 500.0):
        errors, speeds = [], []
        for made_late in (False, True):
            centre = prepare(rig, j, amplitude)
            due = uneven(rate, 5.0, rig.period, made_late=made_late)
            record = sent(rig, j, due, _sine(centre, amplitude, omega), 5.0)
            late, angle = record.time >= 2.0, omega * record.time
            off = record.position - centre - amplitude * np.sin(angle)
            slip = record.velocity / (omega * amplitude) - np.cos(angle)
            errors.append(100.0 * float(np.abs(off[late]).max()) / amplitude)
            speeds.append(100.0 * float(np.abs(slip[late]).max()))
        found[f"error_{rate:g}"], found[f"speed_{rate:g}"] = max(errors), max(speeds)
    return found


def _sine(centre: float, amplitude: float, omega: float) -> Callable[[float], float]:
    return lambda time: centre + amplitude * math.sin(omega * time)

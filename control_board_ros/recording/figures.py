# SPDX-License-Identifier: Apache-2.0
"""Figures of motions: pure functions of arrays.

Times are s, frequencies Hz. Values have any one unit: rad, m, N·m. Step figures and bandwidth are
defined as in python-control, verified by a test.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from control_board_ros.protocols import Floats

Spectrum = NDArray[np.complex128]

#: Shares of the step: start and end of the rise, settling band.
RISE = (0.1, 0.9)
SETTLED = 0.02
#: Range of lags searched, ± s.
LONGEST_LAG, LONGEST_LEAD = 0.5, 0.1
#: Share of the limit from which an output counts as saturated.
SATURATED = 0.995
#: A gain of −3 dB.
HALF_POWER = 10.0**-0.15
#: A difference of times above both is a gap: s, and median periods.
GAP, GAP_PERIODS = 1.0, 10.0
#: Maximum evenly spaced values per measured one.
MOST_EVEN = 100
#: Minimum spectral lines averaged per point of a frequency response.
LEAST_LINES = 3


@dataclass(frozen=True, slots=True)
class StepFigures:
    """Figures of a step; NaN where not reached.

    Attributes:
        rise: From 10 to 90 % of the step, s.
        settling: From the start until within 2 % of the step around the end, s.
        overshoot: Beyond the end, in % of the step.
        peak: Extreme value in the direction of the step.
        delay: From the start to 50 % of the step, s.
    """

    rise: float
    settling: float
    overshoot: float
    peak: float
    delay: float


@dataclass(frozen=True, slots=True)
class TrackingFigures:
    """Tracking of a reference: rms and peak of the error, lag (s; positive: behind)."""

    rms: float
    peak: float
    lag: float


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """A frequency response, arrays of shape (m,).

    Attributes: frequency (Hz), gain (output over input), phase (degrees, continuous), coherence
    (0 to 1: share of the output explained by the input).
    """

    frequency: Floats
    gain: Floats
    phase: Floats
    coherence: Floats


def step_figures(time: Floats, value: Floats, start: float, end: float) -> StepFigures:
    """Figures of a step from ``start`` to ``end``, which begins with the first time.

    y = (value − start) / (end − start); rise: first y ≥ 0.9 after first y ≥ 0.1; settling: last
    time with |y − 1| ≥ 0.02; crossings are interpolated between samples.
    """
    nothing = math.nan
    if end == start or time.size < 2:
        return StepFigures(nothing, nothing, nothing, nothing, nothing)
    y = (value - start) / (end - start)
    rise = first_above(time, y, RISE[1]) - first_above(time, y, RISE[0])
    peak = float(np.max(y))
    return StepFigures(
        rise=rise,
        settling=settling_time(time, np.abs(y - 1.0), SETTLED),
        overshoot=100.0 * max(peak - 1.0, 0.0),
        peak=start + peak * (end - start),
        delay=first_above(time, y, 0.5) - float(time[0]),
    )


def first_above(time: Floats, y: Floats, level: float) -> float:
    """Time at which a value first reaches a level, interpolated; NaN if never."""
    above = np.flatnonzero(y >= level)
    if not above.size:
        return math.nan
    k = int(above[0])
    return float(time[0]) if k == 0 else crossing(time, y, k, level)


def settling_time(time: Floats, error: Floats, width: float) -> float:
    """Time until the error stays below a width; NaN if never."""
    outside = np.flatnonzero(error >= width)
    if not outside.size:
        return 0.0
    k = int(outside[-1]) + 1
    return math.nan if k == time.size else crossing(time, error, k, width) - float(time[0])


def crossing(time: Floats, y: Floats, k: int, level: float) -> float:
    """Time at which y crosses a level between the samples k − 1 and k."""
    share = (level - y[k - 1]) / (y[k] - y[k - 1])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))


def tracking_figures(time: Floats, reference: Floats, value: Floats) -> TrackingFigures:
    """Figures of the error e = reference − value: √(mean e²), max |e|, and the lag."""
    if time.size < 2:
        return TrackingFigures(math.nan, math.nan, math.nan)
    error = reference - value
    rms = math.sqrt(mean_over_time(time, error**2))
    return TrackingFigures(rms, float(np.max(np.abs(error))), lag(time, reference, value))


def mean_over_time(time: Floats, value: Floats) -> float:
    """∫ value dt / T, by trapezoids; the spacing may vary."""
    return float(np.trapezoid(value, time) / (time[-1] - time[0]))


def lag(time: Floats, reference: Floats, value: Floats) -> float:
    """The time τ for which value(t) is nearest to reference(t − τ), s; NaN without motion."""
    t, (r, y) = evenly(time, reference, value)
    if t.size < 8 or np.ptp(r) == 0.0:
        return math.nan
    period = float(t[1] - t[0])
    longest = min(round(LONGEST_LAG / period), t.size // 2)
    least = min(round(LONGEST_LEAD / period), t.size // 2)
    shifts = np.arange(-least, longest + 1)
    costs = np.array([mismatch(r, y, int(shift)) for shift in shifts])
    k = int(np.argmin(costs))
    if not 0 < k < shifts.size - 1:
        return float(shifts[k] * period)
    return float((shifts[k] + vertex(costs[k - 1 : k + 2])) * period)


def mismatch(reference: Floats, value: Floats, shift: int) -> float:
    """Mean square of value(t) − reference(t − shift), where both are known."""
    n = reference.size
    behind, ahead = max(shift, 0), max(-shift, 0)
    difference = value[behind : n - ahead] - reference[ahead : n - behind]
    return float(np.mean(difference**2))


def vertex(three: Floats) -> float:
    """Position of the minimum of the parabola through (−1, a), (0, b), (1, c), from −1 to 1."""
    a, b, c = (float(x) for x in three)
    curvature = a - 2.0 * b + c
    return 0.0 if curvature <= 0.0 else 0.5 * (a - c) / curvature


def newer(time: Floats) -> NDArray[np.bool_]:
    """Whether each time is beyond all before it: a clock may step back."""
    return time > np.concatenate([[-np.inf], np.maximum.accumulate(time)[:-1]])


def gaps_in(time: Floats, least: float = GAP) -> NDArray[np.intp]:
    """The indices of the times before a gap: of a silent board, or a step of its clock.

    Args:
        time: s, shape (n,).
        least: A shorter difference is none, s.
    """
    steps = np.diff(time)
    if not steps.size:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(steps > max(least, GAP_PERIODS * float(np.median(steps))))


def longest_part(time: Floats) -> slice:
    """The most times in a row without a gap."""
    edges = [0, *(gaps_in(time) + 1).tolist(), time.size]
    sizes = np.diff(edges)
    k = int(np.argmax(sizes))
    return slice(edges[k], edges[k + 1])


def evenly(time: Floats, *values: Floats) -> tuple[Floats, list[Floats]]:
    """The values at equally spaced times, at the median period, interpolated.

    Of the longest part without a gap: what happened in a gap is not known.
    """
    part = longest_part(time)
    time = time[part]
    if time.size < 2:
        return time, [value[part] for value in values]
    span = float(time[-1] - time[0])
    period = max(float(np.median(np.diff(time))), span / (MOST_EVEN * time.size))
    even = time[0] + period * np.arange(math.floor(span / period + 1e-6) + 1)
    return even, [np.interp(even, time, value[part]) for value in values]


def time_saturated(time: Floats, value: Floats, limit: float) -> float:
    """Time for which |value| is at its limit, s."""
    if time.size < 2 or not math.isfinite(limit):
        return 0.0
    at_limit = np.abs(value[:-1]) >= SATURATED * limit
    return float(np.sum(np.diff(time)[at_limit]))


def frequency_response(
    time: Floats, reference: Floats, value: Floats, low: float, high: float, points: int = 120
) -> Response:
    """The frequency response of a joint from a motion that begins and ends at rest.

    Over a band of the spectra R and Y of the whole motion: H = Σ Y R* / Σ |R|²,
    coherence = |Σ Y R*|² / (Σ |R|² Σ |Y|²).

    Args:
        time: Shape (n,).
        reference: Reference, shape (n,).
        value: Measured value, shape (n,).
        low: Lowest frequency of the response, Hz.
        high: Highest, Hz; at most half the sampling frequency.
        points: Maximum number of bands, of equal width on a logarithmic axis.
    """
    t, (r, y) = evenly(time, reference, value)
    period = float(t[1] - t[0])
    lines: Floats = np.fft.rfftfreq(t.size, period).astype(np.float64)
    spectra = [np.fft.rfft(level(signal)) for signal in (r, y)]
    high = min(high, 0.5 / period)
    edges = np.geomspace(low, high, points + 1)
    bands = []
    begin = int(np.searchsorted(lines, edges[0]))
    for edge in edges[1:]:
        stop = int(np.searchsorted(lines, edge, side="right"))
        if stop - begin >= LEAST_LINES:
            window = slice(begin, stop)
            bands.append(band(lines[window], spectra[0][window], spectra[1][window]))
            begin = stop
    frequency, response, coherence = np.array(bands).reshape(-1, 3).T
    return Response(
        frequency.real,
        np.abs(response),
        np.degrees(np.unwrap(np.angle(response))),
        coherence.real,
    )


def level(signal: Floats) -> Floats:
    """A signal minus the line from its first to its last value."""
    return signal - np.linspace(signal[0], signal[-1], signal.size)


def band(lines: Floats, r: Spectrum, y: Spectrum) -> tuple[complex, complex, complex]:
    """Mean frequency (weighted by excitation), response and coherence of a band."""
    power_r, power_y = np.sum(np.abs(r) ** 2), np.sum(np.abs(y) ** 2)
    cross = np.sum(y * np.conj(r))
    frequency = np.sum(lines * np.abs(r) ** 2) / power_r
    coherence = np.abs(cross) ** 2 / (power_r * power_y) if power_y > 0.0 else 0.0
    return complex(frequency), complex(cross / power_r), complex(coherence)


def bandwidth(response: Response) -> float:
    """The first frequency where the gain is 3 dB below 1, Hz; NaN if not reached."""
    below = np.flatnonzero(response.gain < HALF_POWER)
    if not below.size or below[0] == 0:
        return math.nan
    x, g = np.log(response.frequency), np.log(response.gain)
    return math.exp(crossing(x, g, int(below[0]), math.log(HALF_POWER)))


def resonance(response: Response) -> tuple[float, float]:
    """The greatest gain, dB, and its frequency, Hz."""
    k = int(np.argmax(response.gain))
    return 20.0 * math.log10(response.gain[k]), float(response.frequency[k])

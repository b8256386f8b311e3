# SPDX-License-Identifier: Apache-2.0
"""The least possible error of a stream whose samples come late (decision 25).

python benchmark/stream_bound.py [TIMINGS] [LOST] [RATE]

A grid of RATE (20 Hz), each sample late by a time uniform up to 0.8 of the interval, seen in
steps of 1 ms, LOST of them lost (0), and known to be. Nothing is known of slope and phase of the
grid but the arrivals. Of all grids that agree with them, each equally likely, the mean one is best
(least squares); its phase is off, and that alone moves a sine of 1 Hz by 2π times the error. Of
TIMINGS (400), from the third second to the fifth: the error over the amplitude, median, 90 % and
worst, and timings above 5 %; where the greatest lateness is known, and where not (prior 1/L).
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LATENESS = 0.8
STEP = 1e-3
SETTLED, SECONDS = 2.0, 5.0
#: Slopes of the grid that are looked at, as parts of the interval.
SLOPES = np.linspace(0.94, 1.06, 1201)


def phase_errors(number: Floats, arrival: Floats, rate: float) -> Floats:
    """Greatest errors of the grid's time at the latest sample, s: latest time known, unknown.

    Args:
        number: of each sample on the grid, shape (n,).
        arrival: of each, s; on the true grid sample k is due at k/rate.
        rate: of the grid, Hz.
    """
    slopes, latest = SLOPES / rate, LATENESS / rate
    late = arrival - slopes[:, None] * number
    least, most = np.minimum.accumulate(late, 1), np.maximum.accumulate(late, 1)
    found = []
    for n in np.flatnonzero(number >= SETTLED * rate):
        begin, spread = least[:, n], most[:, n] - least[:, n]
        due = slopes * number[n]
        known = np.maximum(latest - spread, 0.0)  # begin is anywhere in so much
        unknown = (spread / spread.min()) ** -float(n)
        means = (
            np.average(begin - 0.5 * known + due, weights=known),
            np.average(begin - spread / (n - 1.0) + due, weights=unknown),
        )
        found.append(np.abs(np.array(means) - number[n] / rate))
    return np.max(found, axis=0)


def main(timings: int = 400, lost: float = 0.0, rate: float = 20.0) -> None:
    """Print both rows."""
    randoms = np.random.default_rng(0)
    errors = []
    for _ in range(timings):
        number = np.arange(SECONDS * rate)
        number = number[randoms.random(len(number)) >= lost]
        arrival = number / rate + randoms.uniform(0.0, LATENESS / rate, len(number))
        seen = np.ceil(arrival / STEP) * STEP - 0.5 * STEP
        errors.append(2.0 * np.pi * phase_errors(number, seen, rate))
    for name, error in zip(("known", "unknown"), np.transpose(errors), strict=True):
        middle, most, last = 100.0 * np.quantile(error, [0.5, 0.9, 1.0])
        print(
            f"greatest lateness {name}: {middle:.1f} / {most:.1f} / {last:.1f} %, "
            f"{np.sum(error > 0.05)} of {timings} above 5 %"
        )


if __name__ == "__main__":
    main(*(kind(word) for kind, word in zip((int, float, float), sys.argv[1:], strict=False)))

# SPDX-License-Identifier: Apache-2.0
"""Measure how well the reference of a joint follows streams of many timings (decision 25).

python benchmark/stream_timings.py [TIMINGS] [LOST]

A sine of 1 Hz near a joint's limits, each sample late by up to 0.8 of the interval: sampled on an
even grid of any phase, LOST of them lost (0.03), or when it is sent, 3 % of them lost. Of TIMINGS
(200) such streams, from the third second to the fifth: the error over the amplitude, median, 90 %
and worst; timings above 5 and 8 %; timings whose speed is off by more than 20 %.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

TESTS = Path(__file__).parents[1] / "test"
sys.path[:0] = [str(TESTS / "support"), str(TESTS / "core")]
from test_streams import begun_anywhere, errors, fed, path, uneven  # noqa: E402

RATES = (20.0, 30.0, 50.0, 100.0, 200.0)
SETTLED, SECONDS = 2000, 5.0


def on_grid(rate: float, seed: int, lost: float) -> tuple[float, float]:
    """The greatest errors of position, over the amplitude, and of speed, over its peak."""
    due, phase = begun_anywhere(rate, seed, lost)
    return worst(errors(fed(due, SECONDS, lambda time: path(time, phase)), phase))


def when_sent(rate: float, seed: int, _: float) -> tuple[float, float]:
    """The same of samples made when they are sent."""
    return worst(errors(fed(uneven(rate, SECONDS, seed, made_late=True), SECONDS)))


def worst(of_cycles: tuple[np.ndarray, np.ndarray]) -> tuple[float, float]:
    position, speed = of_cycles
    return position[SETTLED:].max(), speed[SETTLED:].max()


def main(timings: int = 200, lost: float = 0.03) -> None:
    """Print both tables."""
    for name, sampled in (("on a grid", on_grid), ("when sent", when_sent)):
        print(f"{name}: Hz | median / 90 % / worst | above 5 % | above 8 % | speed off by 20 %")
        for rate in RATES:
            position, speed = np.array([sampled(rate, k, lost) for k in range(timings)]).T
            middle, most, last = 100.0 * np.quantile(position, [0.5, 0.9, 1.0])
            print(
                f"{rate:13g} | {middle:.1f} / {most:.1f} / {last:.1f} % | "
                f"{np.sum(position > 0.05)} | {np.sum(position > 0.08)} | {np.sum(speed > 0.2)}",
                flush=True,
            )


if __name__ == "__main__":
    main(*(kind(word) for kind, word in zip((int, float), sys.argv[1:], strict=False)))

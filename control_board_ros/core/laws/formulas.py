# SPDX-License-Identifier: Apache-2.0
"""Formulas without state that the laws share: bounds of numbers, ways and speeds of braking; and
rows of numbers.
"""

from __future__ import annotations

from array import array
from math import ceil, sqrt

from ... import nocython as cython

#: No limit, and no time at which something was.
INFINITE = cython.declare(cython.double, 1e300)
#: Distance above which no braking is needed, rad or m.
FAR_DISTANCE = cython.declare(cython.double, 1e9)
NAN = cython.declare(cython.double, float("nan"))


@cython.cfunc
@cython.inline
def clamp(value: cython.double, low: cython.double, high: cython.double) -> cython.double:
    """``value`` within ``low`` to ``high``; NaN passes."""
    if value < low:
        return low
    if value > high:
        return high
    return value


@cython.cfunc
def brake_speed(
    distance: cython.double, acceleration: cython.double, period: cython.double
) -> cython.double:
    """The greatest speed from which braking in whole cycles ends within a distance.

    d = k v T − a T² k(k − 1)/2: k cycles, each slower by a·T, with the least k that ends at rest.
    """
    if distance <= 0.0:
        return 0.0
    if distance > FAR_DISTANCE:  # no limit is known
        return FAR_DISTANCE
    if distance < 0.99 * acceleration * period * period:  # in one cycle
        return distance / period
    cycles = 0.5 * (sqrt(1.0 + 8.0 * distance / (acceleration * period * period)) - 1.0)
    cycles = max(ceil(cycles), 1.0)
    return distance / (cycles * period) + 0.5 * acceleration * period * (cycles - 1.0)


@cython.cfunc
def speed_ahead(
    distance: cython.double,
    acceleration: cython.double,
    period: cython.double,
    top: cython.double,
) -> cython.double:
    """The same, at most ``top``: that where there is more room than braking from it takes."""
    if distance > top * (0.5 * top / acceleration + period):
        return top
    return min(brake_speed(distance, acceleration, period), top)


@cython.cfunc
@cython.inline
def braking(
    velocity: cython.double, acceleration: cython.double, time: cython.double
) -> cython.double:
    """The way of a braking within a time, from velocity and acceleration."""
    return 0.5 * velocity * time + acceleration * time * time / 12.0


@cython.cfunc
@cython.inline
def is_number(value: cython.double) -> cython.bint:
    """Whether a value is finite."""
    return value - value == 0.0


@cython.cfunc
def row(count: cython.Py_ssize_t) -> object:
    """A row of numbers for views, all 0."""
    return memoryview(array("d", [0.0] * count))

# SPDX-License-Identifier: Apache-2.0
"""Turns that a drive lost by a restart: corrected where that is certain (S9)."""

from __future__ import annotations

import math

#: Share of the step between two possible places within which the last reading decides.
NEAR = 0.25


def missing(
    place: float, step: float, ends: tuple[float, float] | None, before: float | None
) -> float | None:
    """What is to be added to the reading of a joint, rad; None: it is not certain.

    Args:
        place: As its drive reads, rad.
        step: Multiples of this may be missing; inf: any angle.
        ends: Of its range; None: it has none, or their places are not known.
        before: Its last reading before the restart; None: there is none.
    """
    if math.isinf(step):
        return None
    if ends is not None:
        first, final = math.ceil((ends[0] - place) / step), math.floor((ends[1] - place) / step)
        if first == final:
            return first * step
        if first > final and before is None:
            return 0.0  # it is outside its range: that is no matter of turns
    if before is None:
        return None if ends is not None else 0.0
    turns = round((before - place) / step) * step
    return turns if abs(place + turns - before) <= NEAR * step else None

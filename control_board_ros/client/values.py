# SPDX-License-Identifier: Apache-2.0
"""Conversion of the numbers in requests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from control_board_ros.core.selection import spread
from control_board_ros.protocols import Values


def for_each(values: Values, count: int, what: str) -> list[float]:
    """One value per joint; a single value, scalar or list, applies to all.

    Raises:
        RequestError: wrong length, or not numbers.
    """
    alone = values[0] if isinstance(values, Sequence | np.ndarray) and len(values) == 1 else values
    spread_out: list[float] = spread(alone, count, what).tolist()
    return spread_out


def as_given(fields: Mapping[str, Values | None]) -> dict[str, list[float]]:
    """The sendable form of invalid values, for the board to count (P13)."""
    sent = {}
    for name, given in fields.items():
        if given is not None:
            try:
                sent[name] = np.atleast_1d(np.asarray(given, dtype=np.float64)).ravel().tolist()
            except (TypeError, ValueError):
                sent[name] = []
    return sent

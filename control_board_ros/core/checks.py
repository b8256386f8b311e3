# SPDX-License-Identifier: Apache-2.0
"""How values of a configuration are checked: every error names key, value and what is allowed."""

from __future__ import annotations

import math
from typing import Any


class ConfigError(ValueError):
    """A configuration value that is not allowed; one line: key, value, what is allowed."""

    def __init__(self, key: str, value: Any, allowed: str) -> None:
        super().__init__(f"{key}: {value!r} is not allowed; {allowed}")
        self.key, self.value, self.allowed = key, value, allowed


def check_number(
    key: str,
    value: Any,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: float | None = None,
) -> None:
    """Raise ConfigError unless ``low <= value <= high`` (and ``value > above``, if given).

    NaN and values that are not numbers fail; infinity passes only where the range holds it.
    """
    good = isinstance(value, (int, float)) and not isinstance(value, bool)
    if good and low <= value <= high and (above is None or value > above):
        return
    if above is not None:
        allowed = f"a number above {above:g}" + (f" and up to {high:g}" if high < math.inf else "")
    elif math.isinf(low) and math.isinf(high):
        allowed = "a number"
    elif math.isinf(high):
        allowed = f"a number of at least {low:g}"
    else:
        allowed = f"a number from {low:g} to {high:g}"
    raise ConfigError(key, value, allowed)


#: The largest finite number a configuration takes; keeps products of two of them finite.
HUGE = 1e12

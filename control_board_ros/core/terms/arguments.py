# SPDX-License-Identifier: Apache-2.0
"""What the methods of SPEC A accept and return: joints, one value for all or one for each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Joints = int | str | Sequence[int | str] | None
Array = NDArray[np.float64]
Values = float | Sequence[float] | Array
Flags = bool | Sequence[bool]


def releases(stop: object) -> bool:
    """Whether it releases an emergency stop: False alone; None and 0 are joints elsewhere."""
    return isinstance(stop, bool | np.bool_) and not stop

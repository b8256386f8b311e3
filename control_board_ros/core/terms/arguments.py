# SPDX-License-Identifier: Apache-2.0
"""What the methods of SPEC A accept: joints, one value for all or one for each, modes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .vocabs import ControlMode, InteractionMode

Joints = int | str | Sequence[int | str] | None
Values = float | Sequence[float] | NDArray[np.float64]
Flags = bool | Sequence[bool]
Floats = NDArray[np.float64]
Mode = ControlMode | str | int
Interaction = InteractionMode | str | int

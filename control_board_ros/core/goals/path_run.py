# SPDX-License-Identifier: Apache-2.0
"""A path that joints follow, or that waits for its start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..terms.vocabs import InteractionMode
from .path import Path, Sample, Spline

Bools = NDArray[np.bool_]


@dataclass(slots=True, eq=False)
class Run:
    """A path under way, or waiting for its start.

    Attributes: joints (indices, shape (k,)), interactions (theirs when the path was accepted),
    path, start (time of the board, s), held (it stays at its last point until it is ended), spline
    (None while it waits), last (what was sent last), left (why joints left it first, with their
    names; empty while none did).
    """

    joints: NDArray[np.intp]
    interactions: list[InteractionMode]
    path: Path
    start: float
    held: bool = False
    spline: Spline | None = None
    last: Sample | None = None
    left: str = ""

    def keep(self, columns: Bools) -> None:
        """Go on with some of the joints only."""
        self.joints = self.joints[columns]
        self.interactions = [
            mode for mode, kept in zip(self.interactions, columns, strict=True) if kept
        ]
        self.path = self.path.of(columns)
        if self.spline is not None:
            self.spline = Spline(self.path)
        if self.last is not None:
            self.last = Sample(*(row[columns] for row in self.last))

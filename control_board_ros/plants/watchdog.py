# SPDX-License-Identifier: Apache-2.0
"""A plant that is let go without requests for too long (B5).

For the process that holds the plant; the process of the board may be stopped, hang, or be gone.
"""

from __future__ import annotations

import contextlib

import numpy as np

from ..core.terms.measurement import SetPoints
from .interface import Description, DrivePlant, Readings, Setup


class Watchdog:
    """A DrivePlant around another one.

    After :meth:`strike` no set-point acts until all are without power: the sender is aware of it.
    Until then each joint that was driven reports a fault.
    """

    def __init__(self, plant: DrivePlant) -> None:
        self._plant = plant
        self._off = SetPoints.off(len(plant.describe().joints))
        self._last = self._off
        self._struck: dict[int, str] = {}

    @property
    def drives(self) -> bool:
        """Whether a joint has power."""
        return bool(self._last.powered.any())

    def strike(self, reason: str) -> None:
        """Each motor does its ``on_silence``: without power, where it has none."""
        self._struck = {int(joint): reason for joint in np.flatnonzero(self._last.powered)}
        self._last = self._off
        with contextlib.suppress(Exception):
            self._plant.let_go()

    def describe(self) -> Description:
        return self._plant.describe()

    def connect(self, setup: Setup) -> None:
        self._last, self._struck = self._off, {}
        self._plant.connect(setup)

    def exchange(self, wanted: SetPoints) -> Readings:
        if self._struck:
            if not wanted.powered.any():
                self._struck = {}
            wanted = self._off
        self._last = wanted
        found = self._plant.exchange(wanted)
        if self._struck and isinstance(found, Readings):
            faults = found.faults or [None] * len(self._off.kinds)
            found.faults = [self._struck.get(joint, text) for joint, text in enumerate(faults)]
        return found

    def clear_fault(self, joint: int) -> None:
        self._plant.clear_fault(joint)

    def let_go(self) -> None:
        self._last = self._off
        self._plant.let_go()

    def close(self) -> None:
        self._plant.close()

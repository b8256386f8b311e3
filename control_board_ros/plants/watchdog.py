# SPDX-License-Identifier: Apache-2.0
"""A plant that loses its power when nobody has asked for anything for too long (B5).

For the process that holds the plant; the process of the board may be stopped, hang, or be gone.
"""

from __future__ import annotations

import contextlib

import numpy as np

from ..core.measurement import Array
from .interface import Description, Readings, RobotPlant


class Watchdog:
    """A RobotPlant around another one.

    After :meth:`strike` no output acts, and no bridge closes, until outputs of zero came: whoever
    gives them knows. Until then each joint that was driven reports a fault.
    """

    def __init__(self, plant: RobotPlant) -> None:
        self._plant = plant
        self._count = len(plant.describe().joints)
        self._on: set[int] = set()
        self._outputs = np.zeros(self._count)
        self._struck: dict[int, str] = {}

    @property
    def drives(self) -> bool:
        """Whether a bridge is closed, or an output is not 0."""
        return bool(self._on) or bool(self._outputs.any())

    def strike(self, reason: str) -> None:
        """Every bridge open, every output 0, as far as the plant still listens."""
        driven = self._on | {int(joint) for joint in np.flatnonzero(self._outputs)}
        self._struck = dict.fromkeys(driven, reason)
        self._on, self._outputs = set(), np.zeros(self._count)
        for joint in range(self._count):
            with contextlib.suppress(Exception):  # the others, all the same
                self._plant.disable(joint)
        with contextlib.suppress(Exception):
            self._plant.write(self._outputs.copy())

    def describe(self) -> Description:
        return self._plant.describe()

    def connect(self) -> None:
        self._on, self._outputs, self._struck = set(), np.zeros(self._count), {}
        self._plant.connect()

    def read(self) -> Readings:
        found = self._plant.read()
        if self._struck and isinstance(found, Readings):
            faults = found.faults or [""] * self._count
            found.faults = [self._struck.get(joint, text) for joint, text in enumerate(faults)]
        return found

    def write(self, pwm: Array) -> Array:
        if self._struck:
            if not pwm.any():
                self._struck = {}
            pwm = np.zeros(self._count)
        self._outputs = pwm.copy()
        return self._plant.write(pwm)

    def exchange(self, pwm: Array) -> tuple[Array, Readings]:
        """Write, then read: one request instead of two."""
        return self.write(pwm), self.read()

    def enable(self, joint: int) -> None:
        if not self._struck:
            self._on.add(joint)
            self._plant.enable(joint)

    def disable(self, joint: int) -> None:
        self._on.discard(joint)
        self._plant.disable(joint)

    def clear_fault(self, joint: int) -> None:
        self._plant.clear_fault(joint)

    def close(self) -> None:
        self._plant.close()

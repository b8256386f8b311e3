# SPDX-License-Identifier: Apache-2.0
"""A plant whose motors accept PWM, as one of drives that accept that set-point only."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np

from ..core.terms.measurement import SetPoints
from .interface import Description, DrivePlant, Readings, RobotPlant, Setup


def as_drives(plant: Any) -> DrivePlant:
    """A RobotPlant as a DrivePlant; a DrivePlant as it is."""
    drives: DrivePlant = plant if hasattr(plant, "exchange") else OutputDrives(plant)
    return drives


class OutputDrives:
    """A DrivePlant around a RobotPlant."""

    def __init__(self, plant: RobotPlant) -> None:
        self._plant = plant
        self._switches = [joint.power_switch for joint in plant.describe().joints]
        self._forget()

    def _forget(self) -> None:
        self._on: list[bool | None] = [None] * len(self._switches)

    def describe(self) -> Description:
        return self._plant.describe()

    def connect(self, _setup: Setup) -> None:
        self._forget()
        self._plant.connect()

    def exchange(self, wanted: SetPoints) -> Readings:
        """Power, outputs, readings; what was applied is with them."""
        plant = self._plant
        for joint, on in enumerate(wanted.powered.tolist()):
            if self._switches[joint] and on is not self._on[joint]:
                (plant.enable if on else plant.disable)(joint)
            self._on[joint] = on
        applied = plant.write(wanted.pwm.copy())
        readings = plant.read()
        if isinstance(readings, Readings):
            readings.applied = applied
        return readings

    def clear_fault(self, joint: int) -> None:
        self._plant.clear_fault(joint)

    def let_go(self) -> None:
        """Every bridge open, every output 0."""
        self._forget()
        for joint in range(len(self._switches)):
            with contextlib.suppress(Exception):  # the others, all the same
                self._plant.disable(joint)
        with contextlib.suppress(Exception):
            self._plant.write(np.zeros(len(self._switches)))

    def close(self) -> None:
        self._plant.close()

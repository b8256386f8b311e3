# SPDX-License-Identifier: Apache-2.0
"""What a board lets a calibrator do with its joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..config.config import JointConfig
from ..terms.modes import Law

if TYPE_CHECKING:
    from ..machine.machine import Machine


class JointAccess:
    """What a calibrator may do with its joint; see calibrator.Hand."""

    __slots__ = ("_j", "_machine")

    def __init__(self, machine: Machine, j: int) -> None:
        self._machine, self._j = machine, j

    @property
    def joint(self) -> JointConfig:
        return self._machine.config.joints[self._j]

    @property
    def reading(self) -> float:
        state = self._machine.state
        return float(state.position[self._j] + state.offset[self._j])

    @property
    def position(self) -> float:
        return float(self._machine.state.position[self._j])

    @property
    def travelled(self) -> float:
        return float(self._machine.monitor.travelled[self._j])

    @property
    def current(self) -> float:
        return float(self._machine.state.current[self._j])

    def hold(self) -> None:
        self._machine.references.reset([self._j], bounded=False)
        self._machine.set_law([self._j], Law.POSITION, feeds=False)

    def drive(self, output: float) -> None:
        self._machine.controller.joints[self._j].output_command = output
        self._machine.set_law([self._j], Law.OUTPUT, feeds=False)

    def set_offset(self, offset: float) -> None:
        self._machine.calibrations.set_offset(self._j, offset)
        self._machine.references.reset([self._j], bounded=False)

    def move(self, target: float, speed: float) -> None:
        self._machine.references.move(np.array([self._j]), np.array([target]), np.array([speed]))

    def moving(self) -> bool:
        return not self._machine.state.done[self._j]

# SPDX-License-Identifier: Apache-2.0
"""The calibrations of a board: the active ones, and the last status of each joint (SPEC K)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..config.config import BoardConfig, Calibration, JointConfig
from ..laws.control import Controller
from ..laws.references import References
from ..state import StateArrays
from ..terms.faults import FaultCode
from ..terms.modes import Event, Law, Trigger
from ..terms.vocabs import CommandKind
from .calibration import TYPES, CalibrationError, CalibrationStatus, Calibrator


class CalibratedMachine(Protocol):
    """The part of the mode machine that calibrations use; ``machine.Machine`` has it."""

    config: BoardConfig
    state: StateArrays
    controller: Controller
    references: References
    calibrations: Calibrations

    def go(self, j: int, trigger: Trigger) -> bool: ...
    def set_law(self, joints: Sequence[int], law: Law, *, direct: bool, feeds: bool) -> None: ...
    def raise_fault(self, j: int, code: FaultCode, text: str) -> None: ...
    def report(self, level: str, key: str, j: int, text: str) -> None: ...


class Calibrations:
    """Starts, steps and ends calibrators, group after group; records which joints are calibrated.

    Args:
        machine: of the board; its modes change when a calibration begins and ends.

    Attributes: running (the calibrators that run or wait for their group, by joint), shifted (any
    joint's angle differs from its reading).
    """

    def __init__(self, machine: CalibratedMachine) -> None:
        self._machine, self._state = machine, machine.state
        config = machine.config
        self._status = [CalibrationStatus(name) for name in config.names]
        self.running: dict[int, Calibrator] = {}
        self._former: dict[int, tuple[float, bool]] = {}  # offset, calibrated: before it began
        self._groups = groups_of(config)
        self.shifted = False

    def status(self, j: int) -> CalibrationStatus:
        """Status of the last calibration of a joint, and whether it is calibrated (K7)."""
        return replace(self._status[j], calibrated=bool(self._state.calibrated[j]))

    def forget(self, joints: Sequence[int]) -> None:
        """Reset the calibrations of joints (N1)."""
        for j in joints:
            self.running.pop(j, None)
            self._status[j] = CalibrationStatus(self._machine.config.names[j])
        self.shifted = bool(self._state.offset.any())

    def start(self, j: int) -> None:
        """Start the calibration of a joint (K1)."""
        machine = self._machine
        calibration = self._config(j)
        self._former[j] = float(self._state.offset[j]), bool(self._state.calibrated[j])
        self._state.calibrated[j] = False
        access = JointAccess(machine, j)
        self.running[j] = TYPES[calibration.type](calibration, access, machine.config.period)
        self._show(j, running=True, phase="waiting")
        machine.go(j, Event.CALIBRATE)

    def step(self) -> None:
        """Step the started calibrators, and those whose turn it is (K1, K3, K4)."""
        for j in self._active():
            if self._machine.controller.joints[j].braked:
                continue  # its brake still opens
            calibrator = self.running[j]
            try:
                done = calibrator.step(self._state.periods)
            except CalibrationError as error:
                self._machine.raise_fault(j, FaultCode.CALIBRATION, str(error))
                continue
            progress = calibrator.progress
            self._show(j, running=True, progress=progress.fraction, phase=progress.phase)
            if done:
                self._finish(j)

    def abort(self, j: int) -> None:
        """End an unfinished calibration, and undo its changes (K2, K4).

        A joint that requires it is uncalibrated then (K7); another one keeps its former angle and
        its limits.
        """
        if self.running.pop(j, None) is None:
            return
        calibration, (offset, calibrated) = self._config(j), self._former[j]
        self.set_offset(j, offset)
        self._state.calibrated[j] = calibrated and not calibration.required
        progress = self._status[j].progress
        self._show(j, progress=progress, phase="aborted", message="aborted")

    def fail(self, j: int, text: str) -> None:
        """Record why the calibration that has just ended failed (K4)."""
        self._status[j] = replace(self._status[j], phase="failed", message=text)

    def lose(self, j: int) -> None:
        """Record that the angle of a joint that requires a calibration is lost (K7, S9)."""
        required = self._machine.config.joints[j].requires_calibration
        if required and self._state.calibrated[j] and j not in self.running:
            self._state.calibrated[j] = False
            self._show(j, message="its drive restarted, and lost its zero")
            self._machine.report("warning", "uncalibrated", j, "its drive lost its zero")

    def set_offset(self, j: int, offset: float) -> None:
        """Set the offset: joint angle = reading − offset, rad."""
        state = self._state
        state.position[j] += state.offset[j] - offset
        state.offset[j] = offset
        self.shifted = bool(state.offset.any())

    def know_angle(self, j: int) -> None:
        """Record that a joint's angle is valid; its last references are its position (M11)."""
        self._state.calibrated[j] = True
        for kind in (CommandKind.POSITION, CommandKind.POSITION_DIRECT):
            self._machine.references.last[kind, j] = self._state.position[j]

    def _active(self) -> list[int]:
        """The joints that calibrate now; the others wait, started ones continue.

        In each part the first requested group begins when no other one drives; parts calibrate
        side by side (R4).
        """
        active: list[int] = []
        for part in {self._groups[j].part for j in self.running}:
            running = [j for j in self.running if self._groups[j].part == part]
            turn = min(self._groups[j].turn for j in running)
            begun = [j for j in running if self.running[j].begun]
            if all(self._groups[j].turn == turn for j in begun):
                begun = [j for j in running if self._groups[j].turn == turn]
            active += begun
        return active

    def _finish(self, j: int) -> None:
        del self.running[j]
        self.know_angle(j)
        self._show(j, done=True, progress=1.0, phase="done")
        self._machine.go(j, Event.CALIBRATED)
        self._machine.report("info", "calibrated", j, "calibrated")

    def _config(self, j: int) -> Calibration:
        calibration = self._machine.config.joints[j].calibration
        assert calibration is not None
        return calibration

    def _show(self, j: int, **fields: Any) -> None:
        self._status[j] = CalibrationStatus(self._machine.config.names[j], **fields)


class Group(NamedTuple):
    """The calibration group of a joint: its part, and its turn there."""

    part: int
    turn: int


def groups_of(config: BoardConfig) -> list[Group]:
    """The calibration group of each joint; joints in none form the last one of their part."""
    group_of_joint = []
    for part, zone in enumerate(config.zones()):
        groups = zone.config.calibration_groups
        turns = {name: turn for turn, names in enumerate(groups) for name in names}
        group_of_joint += [Group(part, turns.get(name, len(turns))) for name in zone.config.names]
    return group_of_joint


class JointAccess:
    """What a calibrator may do with its joint; see calibration.Hand."""

    __slots__ = ("_j", "_machine")

    def __init__(self, machine: CalibratedMachine, j: int) -> None:
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
        """Of the motor; of the joint where its drive shows no travel of its own."""
        if math.isinf(self.joint.max_travel_error):
            return self.reading
        return float(self._machine.state.travelled[self._j])

    @property
    def current(self) -> float:
        return float(self._machine.state.current[self._j])

    def hold(self) -> None:
        self._machine.references.reset([self._j], bounded=False)
        self._machine.set_law([self._j], Law.POSITION, direct=False, feeds=False)

    def drive(self, output: float) -> None:
        self._machine.controller.joints[self._j].output_command = output
        self._machine.set_law([self._j], Law.OUTPUT, direct=False, feeds=False)

    def set_offset(self, offset: float) -> None:
        self._machine.calibrations.set_offset(self._j, offset)
        self._machine.references.reset([self._j], bounded=False)

    def move(self, target: float, speed: float) -> None:
        self._machine.references.move(np.array([self._j]), np.array([target]), np.array([speed]))

    def moving(self) -> bool:
        return not self._machine.state.done[self._j]

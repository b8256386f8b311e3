# SPDX-License-Identifier: Apache-2.0
"""The calibrations of a board: which joints calibrate now, and which are calibrated (SPEC K)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

from ...text import clean
from ..config.config import BoardConfig, Calibration
from ..state import StateArrays
from ..terms.faults import FaultCode
from ..terms.modes import Event, Trigger
from .calibration import TYPES, CalibrationError, Calibrator, Hand, Unmade


@dataclass(frozen=True, slots=True)
class CalibrationStatus:
    """Status of the last calibration of a joint.

    Attributes: name, running, done (the last one succeeded), progress (0 to 1), phase,
    message (why it failed; empty otherwise), calibrated (whether the joint has a valid angle, be
    it from an earlier one or because it requires none; None if unknown).
    """

    name: str
    running: bool = False
    done: bool = False
    progress: float = 0.0
    phase: str = "none"
    message: str = ""
    calibrated: bool | None = None


class CalibratedMachine(Protocol):
    """The part of the mode machine that calibrations use; ``machine.Machine`` has it."""

    config: BoardConfig
    state: StateArrays

    def go(self, j: int, trigger: Trigger) -> bool: ...
    def hand(self, j: int) -> Hand: ...
    def know_angle(self, j: int) -> None: ...
    def waits_for_brake(self, j: int) -> bool: ...
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
        self._begun: set[int] = set()  # joints that theirs controls: it was stepped
        self._former: dict[int, tuple[float, bool]] = {}  # offset, calibrated: before it began
        self._groups = groups_of(config)
        self.shifted = False

    def status(self, j: int) -> CalibrationStatus:
        """Status of the last calibration of a joint, and whether it is calibrated (K7)."""
        return replace(self._status[j], calibrated=bool(self._state.calibrated[j]))

    def forget(self, joints: Sequence[int]) -> None:
        """Reset the calibrations of joints (N1)."""
        for j in joints:
            ran = self.running.pop(j, None) is not None
            self._show(j, message="ended by a power cycle" if ran else "")
        self.shifted = bool(self._state.offset.any())

    def start(self, j: int) -> None:
        """Start the calibration of a joint (K1)."""
        machine = self._machine
        calibration = self._config(j)
        self._former[j] = float(self._state.offset[j]), bool(self._state.calibrated[j])
        self._state.calibrated[j] = False
        arguments = calibration, machine.hand(j), machine.config.period
        try:
            calibrator = TYPES[calibration.type](*arguments)
        except Exception as error:  # noqa: BLE001 - of a user's type
            calibrator = Unmade(error, *arguments)
        self.running[j] = calibrator
        self._begun.discard(j)
        self._show(j, running=True, phase="waiting")
        machine.go(j, Event.CALIBRATE)

    def step(self) -> None:
        """Step the started calibrators, and those whose turn it is (K1, K3, K4)."""
        for j in self._active():
            if self._machine.waits_for_brake(j):
                continue
            calibrator = self.running[j]
            self._begun.add(j)
            try:
                done = calibrator.step(self._state.periods)
                progress, phase = float(calibrator.progress.fraction), calibrator.progress.phase
            except CalibrationError as error:
                self._machine.raise_fault(j, FaultCode.CALIBRATION, str(error))
                continue
            except Exception as error:  # noqa: BLE001 - of a user's type: other joints go on (K4)
                text = clean(f"its calibrator failed, {type(error).__name__}: {error}")
                self._machine.raise_fault(j, FaultCode.CALIBRATION, text)
                continue
            self._show(j, running=True, progress=progress, phase=clean(phase))
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

    def _active(self) -> list[int]:
        """The joints that calibrate now; the others wait, started ones continue.

        In each part the first requested group begins when no other one drives; parts calibrate
        side by side (R4).
        """
        active: list[int] = []
        for part in {self._groups[j].part for j in self.running}:
            running = [j for j in self.running if self._groups[j].part == part]
            turn = min(self._groups[j].turn for j in running)
            begun = [j for j in running if j in self._begun]
            if all(self._groups[j].turn == turn for j in begun):
                begun = [j for j in running if self._groups[j].turn == turn]
            active += begun
        return active

    def _finish(self, j: int) -> None:
        del self.running[j]
        self._machine.know_angle(j)
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

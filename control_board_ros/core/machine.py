# SPDX-License-Identifier: Apache-2.0
"""The mode machine of all joints: the one engine that looks TRANSITIONS up (SPEC M, F, K, N).

It owns what belongs to being in a mode (entering one, faults and their records, calibrations
and configuration) and emits events; it takes no requests from users.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .calibration import TYPES, CalibrationError, CalibrationStatus, Calibrator
from .causes import Cause
from .config import BoardConfig
from .control import Controller
from .faults import FaultCode, FaultRecord
from .joint_hand import JointHand
from .modes import (
    ACCEPTS,
    DIRECT_GAINS,
    LAWS,
    STATES,
    Choice,
    Event,
    Law,
    Trigger,
    law_of,
    next_mode,
)
from .references import References
from .state import Joints, State, span
from .vocabs import CommandKind, ControlMode, InteractionMode
from .watch import Watch

#: Events that nobody takes are dropped from here on, oldest first.
EVENTS_KEPT = 1000

#: ACCEPTS as columns over the kinds of command, shape (kinds, 1).
ACCEPTED = {
    mode: np.array([[kind in ACCEPTS.get(mode, ())] for kind in CommandKind]) for mode in STATES
}


@dataclass(frozen=True, slots=True)
class BoardEvent:
    """Something that happened in a cycle and belongs in a log.

    Attributes: level (``info``, ``warning`` or ``error``), key (what repeats of it share),
    joint (name), text (one line).
    """

    level: str
    key: str
    joint: str
    text: str


class Machine:
    """The joints of a board and what mode each is in."""

    def __init__(self, config: BoardConfig) -> None:
        self.config = config
        self.names = config.names
        self.count = len(config.joints)
        self.period = config.period
        self.cycle = 0
        self.time = 0.0
        self.modes_version = 0
        self.faults_version = 0
        self.faults = [FaultRecord(name) for name in self.names]
        self.events: deque[BoardEvent] = deque(maxlen=EVENTS_KEPT)
        self.state = State(config)
        self._build()

    def _build(self) -> None:
        """Everything that a power-on makes anew (N1)."""
        config, state = self.config, self.state
        self.controller = Controller(config, state)
        self.references = References(config, state, self.controller.joints)
        self.watch = Watch(config, state)
        self.accepts = np.zeros((len(CommandKind), self.count), dtype=bool)
        self.calibration = [CalibrationStatus(name) for name in self.names]
        self._calibrators: dict[int, Calibrator] = {}
        self._former: dict[int, tuple[float, bool]] = {}  # offset, calibrated: before it began
        self._shifted = False
        group = {name: i for i, names in enumerate(config.calibration_groups) for name in names}
        self._groups = [group.get(name, len(group)) for name in self.names]
        state.offset[:] = 0.0
        self.configure_next = config.autoconfigure
        self.blind = True  # no reading since power-on
        for j in range(self.count):
            state.calibrated[j] = False
            state.interaction_modes[j] = InteractionMode.STIFF
        for j in range(self.count):
            self.go(j, Event.POWER_ON)

    def reset(self) -> None:
        """Back to power-on (N1): records of faults stay readable, nothing else (F5)."""
        self.faults = [fault.cleared() for fault in self.faults]
        self.faults_version += 1
        self._build()

    # --- the engine -----------------------------------------------------------------------

    def go(self, j: int, trigger: Trigger) -> bool:
        """Let a trigger act on a joint; false when the table refuses it."""
        target = next_mode(self.state.control_modes[j], trigger)
        if target is None:
            return False
        joint = self.config.joints[j]
        if target is Choice.STARTUP:
            self.state.interaction_modes[j] = joint.startup_interaction
            target = joint.startup_mode
        elif target is Choice.CALIBRATED:
            assert joint.calibration is not None
            self.state.interaction_modes[j] = joint.calibration.interaction_mode
            target = joint.calibration.control_mode
        assert isinstance(target, ControlMode)
        if target is not ControlMode.CALIBRATING:
            self._drop_calibrator(j)
        self.enter([j], target)
        return True

    def enter(self, joints: Sequence[int], mode: ControlMode) -> None:
        """Put joints into a mode: references and controllers start afresh (M9)."""
        state, controller = self.state, self.controller
        chosen = span(joints)
        for j in joints:
            state.control_modes[j] = mode
        for j in joints:
            controller.joints[j].output_command = 0.0
        calibrating = Law.CALIBRATOR in LAWS.get(mode, {}).values()
        self.references.reset(chosen, bounded=not calibrating)
        for interaction in {state.interaction_modes[j] for j in joints}:
            some = [j for j in joints if state.interaction_modes[j] is interaction]
            law = Law.POSITION if calibrating else law_of(mode, interaction)
            self.set_law(span(some), law, direct=mode in DIRECT_GAINS, feeds=not calibrating)
        on = mode is not ControlMode.NOT_CONFIGURED
        self.watch.arm(chosen, on=on, calibrated=state.calibrated)
        self.accepts[:, chosen] = ACCEPTED[mode]
        self.modes_version += 1

    def set_law(
        self, joints: Joints, law: Law, *, direct: bool = False, feeds: bool = True
    ) -> None:
        """Let a law of control run joints from their present torque on."""
        self.controller.arm(joints, law, direct=direct, feeds=feeds)
        self.watch.power(joints, self.state.powered)

    def tell(self, level: str, key: str, j: int, text: str) -> None:
        """Emit an event."""
        self.events.append(BoardEvent(level, key, self.names[j], text))

    def _warn_of_heat(self) -> None:
        """Tell who comes near a fault by heat (F6)."""
        self.watch.monitor.news = False
        for j in range(self.count):
            for key, text in self.watch.warnings(j).items():
                if not self.faults[j].active:
                    self.tell("warning", key, j, f"{self.names[j]}: {text}")

    # --- faults ---------------------------------------------------------------------------

    def raise_fault(self, j: int, code: FaultCode, text: str) -> None:
        """Put a joint into HW_FAULT; the first cause is kept (F1, F5)."""
        trigger = Event.UNSUPPORTED if code is FaultCode.UNSUPPORTED else Event.FAULT
        calibrating = j in self._calibrators
        if not self.go(j, trigger):
            return
        self.faults[j] = FaultRecord(
            self.names[j],
            active=True,
            code=int(code),
            text=f"{code.title}, {text}",
            stamp=self.time,
        )
        self.faults_version += 1
        if calibrating:  # K4
            self.calibration[j] = replace(
                self.calibration[j], phase="failed", message=self.faults[j].text
            )
        self.watch.let_cool(j, code)
        self.watch.forget(j)
        self.tell(
            "error", f"fault {int(code)}", j, f"{self.names[j]}: fault, {code.title}: {text}"
        )

    def clear_fault(self, j: int) -> Cause | None:
        """FORCE_IDLE on a faulted joint; the cause when it persists (F2, F3)."""
        cause = self.watch.cause(j)
        if cause is not None:
            return cause
        self.go(j, Event.FORCE_IDLE)
        self.watch.forget(j)
        self.faults[j] = self.faults[j].cleared()
        self.faults_version += 1
        return None

    def _raise_faults(self, last: Any) -> None:
        modes = self.state.control_modes
        causes = {
            j: self.watch.cause(j)
            for j in self.watch.unhealthy()
            if next_mode(modes[j], Event.FAULT) is not None  # in a fault, the first cause is kept
        }
        self.watch.mend(last)
        for j, cause in causes.items():
            if cause is not None:
                self.raise_fault(j, cause.code, cause.text)

    def _expire(self) -> None:
        """Reference timeouts (P12): a velocity stops and holds, a torque or output faults."""
        late = self.references.expired(self.cycle)
        if late is None:
            return
        for j in late:
            if self.accepts[CommandKind.VELOCITY, j]:
                if not self.references.rolls(int(j)):
                    continue  # it was stopped before: nothing to tell
                self.references.halt(np.array([j]))
                timeout = self.config.joints[j].timeouts.velocity
                text = f"no velocity reference for {timeout:g} s; it stops and holds"
                self.tell("info", "velocity timeout", j, f"{self.names[j]}: {text}")
            else:
                self.raise_fault(
                    int(j),
                    FaultCode.REFERENCE_TIMEOUT,
                    "references stopped while the motor drives",
                )

    # --- configuration and calibration -----------------------------------------------------

    def complete_configuration(self) -> None:
        """The whole configuration is in: every joint leaves NOT_CONFIGURED (N2, N3).

        Before the first reading it waits for it: a joint holds where it is, not where it was.
        """
        self.configure_next = self.blind
        if self.blind:
            return
        for j, joint in enumerate(self.config.joints):
            if self.state.control_modes[j] is not ControlMode.NOT_CONFIGURED:
                continue
            if joint.calibration is not None and joint.calibration.required:
                self.start_calibration(j)
                continue
            self.set_offset(j, joint.calibration.zero if joint.calibration else 0.0)
            self.state.calibrated[j] = True
            self.references.last[CommandKind.POSITION, j] = self.state.position[j]
            self.references.last[CommandKind.POSITION_DIRECT, j] = self.state.position[j]
            self.go(j, Event.CONFIGURED)

    def start_calibration(self, j: int) -> bool:
        """The calibration command (K1); false when the table refuses it."""
        calibration = self.config.joints[j].calibration
        assert calibration is not None
        if next_mode(self.state.control_modes[j], Event.CALIBRATE) is None:
            return False
        self._former[j] = float(self.state.offset[j]), bool(self.state.calibrated[j])
        self.state.calibrated[j] = False
        self._calibrators[j] = TYPES[calibration.type](
            calibration, JointHand(self, j), self.period
        )
        self.calibration[j] = CalibrationStatus(self.names[j], running=True, phase="waiting")
        return self.go(j, Event.CALIBRATE)

    def set_offset(self, j: int, offset: float) -> None:
        """Take reading − offset as the joint angle."""
        state = self.state
        state.position[j] += state.offset[j] - offset
        state.offset[j] = offset
        self._shifted = bool(self.state.offset.any())

    def _calibrate(self) -> None:
        """Step the calibrators of the group whose turn it is (K1, K3, K4)."""
        turn = min(self._groups[j] for j in self._calibrators)
        for j in [j for j in self._calibrators if self._groups[j] == turn]:
            calibrator = self._calibrators[j]
            try:
                done = calibrator.step()
            except CalibrationError as error:
                self.raise_fault(j, FaultCode.CALIBRATION, str(error))
                continue
            progress = calibrator.progress
            self.calibration[j] = CalibrationStatus(
                self.names[j], running=True, progress=progress.fraction, phase=progress.phase
            )
            if done:
                self._finish_calibration(j)

    def _finish_calibration(self, j: int) -> None:
        del self._calibrators[j]
        self.state.calibrated[j] = True
        self.references.last[CommandKind.POSITION, j] = self.state.position[j]
        self.references.last[CommandKind.POSITION_DIRECT, j] = self.state.position[j]
        self.calibration[j] = CalibrationStatus(
            self.names[j], done=True, progress=1.0, phase="done"
        )
        self.go(j, Event.CALIBRATED)
        self.tell("info", "calibrated", j, f"{self.names[j]}: calibrated")

    def lacks_calibration(self, j: int) -> bool:
        """Whether a joint requires a calibration and has none (K7)."""
        calibration = self.config.joints[j].calibration
        required = calibration is not None and calibration.required
        return required and not self.state.calibrated[j]

    def _drop_calibrator(self, j: int) -> None:
        """End a calibration that is not done: what it changed is taken back (K2, K4).

        A joint that requires it is left uncalibrated (K7), another as it was: its former
        angle and its limits hold.
        """
        if self._calibrators.pop(j, None) is None:
            return
        calibration, (offset, calibrated) = self.config.joints[j].calibration, self._former[j]
        assert calibration is not None
        self.set_offset(j, offset)
        self.state.calibrated[j] = calibrated and not calibration.required
        status = self.calibration[j]
        self.calibration[j] = CalibrationStatus(
            status.name, progress=status.progress, phase="aborted", message="aborted"
        )

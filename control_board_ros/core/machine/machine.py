# SPDX-License-Identifier: Apache-2.0
"""The mode machine of all joints: the one engine that looks TRANSITIONS up (SPEC M, F, N).

It owns what belongs to being in a mode: entering one, and faults with their records. Requests are
decided in ``requests``, calibrations run in ``calibration``, ``start_up`` begins. Theory of
operation, from power-on to power-off: docs/architecture.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ..calibration.calibration import CalibrationError, Hand
from ..calibration.calibrations import Calibrations
from ..config.config import BoardConfig, JointConfig
from ..laws.control import Controller
from ..laws.references import References, ReferenceTimeouts
from ..state import Indices, StateArrays
from ..terms.arguments import Array
from ..terms.faults import Cause, Events, FaultCode, FaultRecord
from ..terms.measurement import Row
from ..terms.modes import (
    ACCEPTS,
    CALIBRATES,
    CONFIGURED,
    DIRECT_GAINS,
    STATES,
    STOPPABLE,
    UNPOWERED,
    Choice,
    Event,
    Law,
    Stage,
    Trigger,
    law_of,
    next_mode,
)
from ..terms.vocabs import CommandKind, ControlMode
from ..watch.fault_monitor import FaultMonitor
from .brakes import Brakes, WaitingLaw
from .decisions import Facts
from .stale import StaleStreams

#: ACCEPTS as columns over the kinds of command, shape (kinds,).
ACCEPTED = {
    mode: np.array([kind in ACCEPTS.get(mode, ()) for kind in CommandKind]) for mode in STATES
}


class Machine:
    """The modes of a board's joints, from a power-on to the next.

    Args:
        config: of the board.
        state: whose modes, faults and calibrations it changes.
        controller, references, timeouts, monitor: reset by a change of mode.
        events: receives log entries.
        joint: the present configuration of a joint, without a silent external torque sensor.
        on_fault: called with each joint that faults.

    Attributes: calibrations, brakes, streams (of references) and feeds (of feed-forwards) that
    outlived a fault, and the arguments.
    """

    def __init__(
        self,
        config: BoardConfig,
        state: StateArrays,
        controller: Controller,
        references: References,
        timeouts: ReferenceTimeouts,
        monitor: FaultMonitor,
        events: Events,
        *,
        joint: Callable[[int], JointConfig],
        on_fault: Callable[[int], None],
    ) -> None:
        self.config, self.state = config, state
        self.controller, self.references = controller, references
        self.timeouts, self.monitor = timeouts, monitor
        self.events = events
        self.calibrations = Calibrations(self)
        self.brakes = Brakes(self)
        self.streams, self.feeds = StaleStreams(config, state), StaleStreams(config, state)
        self.joint, self.on_fault = joint, on_fault
        self._on_limit, self._strained = [False] * state.n, [False] * state.n

    def power_on(self, joints: Sequence[int]) -> None:
        """Restart joints, NOT_CONFIGURED and without power (N1)."""
        self.calibrations.forget(joints)
        for j in joints:
            self._on_limit[j] = self._strained[j] = False
            self.feeds.cut(j)  # N4
            self.go(j, Event.POWER_ON)

    def reconfigure(self, config: BoardConfig, timeout_cycles: Array) -> None:
        """Apply new limits and timeouts while running; timeouts in cycles, shape (kinds, n)."""
        before, self.config = self.config, config
        self.timeouts.reconfigure(timeout_cycles)
        self.brakes.reconfigure()
        state = self.state
        for j in range(state.n):
            if config.joints[j] == before.joints[j]:
                continue
            calibrated = bool(state.calibrated[j])
            self.monitor.set_limits(j, on=self.is_configured(j), calibrated=calibrated)
            if state.faults[j].active:
                self.monitor.let_cool(j, FaultCode(state.faults[j].code))
            if j not in self.calibrations.running and state.powered[j]:
                self.references.bound([j])

    # --- the engine -----------------------------------------------------------------------

    def go(self, j: int, trigger: Trigger) -> bool:
        """Apply a trigger to a joint; false where the table refuses it."""
        target = next_mode(self.state.control_modes[j], trigger)
        if target is None:
            return False
        joint = self.config.joints[j]
        if target is Choice.STARTUP:
            self.state.interaction_modes[j] = joint.startup_interaction
            target = joint.startup_mode if self.state.stages[j] is Stage.ACTIVE else UNPOWERED
        elif target is Choice.CALIBRATED:
            assert joint.calibration is not None
            self.state.interaction_modes[j] = joint.calibration.interaction_mode
            target = joint.calibration.control_mode
        assert isinstance(target, ControlMode)
        if target not in CALIBRATES:
            self.calibrations.abort(j)  # K2, K4
        self.enter([j], target)
        return True

    def enter(self, joints: Sequence[int], mode: ControlMode) -> None:
        """Put joints into a mode: references and controllers are reset (M9)."""
        state, controller = self.state, self.controller
        calibrating = mode in CALIBRATES
        self.references.reset(joints, bounded=not calibrating)
        self.timeouts.cancel(joints)
        for j in joints:
            state.control_modes[j] = mode
            controller.joints[j].output_command = 0.0
            state.accepts[:, j] = ACCEPTED[mode]
        for interaction in {state.interaction_modes[j] for j in joints}:
            some = [j for j in joints if state.interaction_modes[j] is interaction]
            law = Law.POSITION if calibrating else law_of(mode, interaction)
            self.set_law(some, law, direct=mode in DIRECT_GAINS, feeds=not calibrating)
        self.monitor.arm(joints, on=mode in CONFIGURED, calibrated=state.calibrated)
        state.note_modes(joints)

    def set_law(self, joints: Sequence[int], law: Law, *, direct: bool, feeds: bool) -> None:
        """Run a law from the present torque of joints, as soon as their brakes are open (Y4)."""
        ready = self.brakes.start_or_wait(joints, WaitingLaw(law, direct, feeds))
        self.controller.arm(ready, law, direct=direct, feeds=feeds)
        self.monitor.power(joints, self.state.powered)

    def give_power(self, j: int, waiting: WaitingLaw) -> None:
        """Run the law that waited for a joint's brake, with the references received since."""
        joint = self.controller.joints[j]
        if not joint.reference.active:
            bounded = self.state.control_modes[j] not in CALIBRATES
            self.references.reset([j], bounded=bounded)
        commanded = not joint.holding
        torque, current = joint.torque_command, joint.current_command
        self.controller.arm([j], waiting.law, direct=waiting.direct, feeds=waiting.feeds)
        self.wait_for_brake(j, waits=False)
        if commanded and waiting.law is Law.TORQUE:
            joint.command_torque(torque)
        elif commanded and waiting.law is Law.CURRENT:
            joint.command_current(current)
        self.monitor.power([j], self.state.powered)

    # --- for brakes and calibrations ------------------------------------------------------

    def wait_for_brake(self, j: int, *, waits: bool) -> None:
        """Whether the law of a joint waits for its brake; moves are planned meanwhile."""
        joint = self.controller.joints[j]
        joint.braked = waits
        if waits:
            joint.holding, joint.calibrated = True, bool(self.state.calibrated[j])

    def waits_for_brake(self, j: int) -> bool:
        """Whether the law of a joint waits for its brake."""
        return bool(self.controller.joints[j].braked)

    def hold(self, j: int) -> None:
        """Hold a joint, in whatever mode it is, until its brake is closed."""
        self.controller.arm([j], Law.POSITION, direct=False, feeds=True)

    def hand(self, j: int) -> Hand:
        """A calibrator's access to a joint."""
        return JointHand(self, j)

    def know_angle(self, j: int) -> None:
        """Record that a joint's angle is valid; its last references are its position (M11).

        Without a reading they stay as they are.
        """
        self.state.calibrated[j] = True
        if np.isnan(self.state.position[j]):
            return
        for kind in (CommandKind.POSITION, CommandKind.POSITION_DIRECT):
            self.references.last[kind, j] = self.state.position[j]

    def report(self, level: str, key: str, j: int, text: str) -> None:
        """Add an event of a joint: ``<joint>: <text>``."""
        name = self.config.names[j]
        self.events.add(level, key, name, f"{name}: {text}")

    def facts(self, j: int) -> Facts:
        """The facts for a decision on a joint."""
        state = self.state
        fault = state.faults[j]
        return Facts(
            joint=self.joint(j),
            mode=state.control_modes[j],
            interaction=state.interaction_modes[j],
            calibrated=bool(state.calibrated[j]),
            fault=fault,
            cause=self.monitor.cause(j) if fault.active else None,
            time=state.time,
            stage=state.stages[j],
            brake_closed=self.brakes.is_kept_closed(j),
        )

    def is_configured(self, j: int) -> bool:
        """Whether a joint has left NOT_CONFIGURED."""
        return self.state.control_modes[j] in CONFIGURED

    # --- faults ---------------------------------------------------------------------------

    def raise_fault(self, j: int, code: FaultCode, text: str) -> None:
        """Put a joint into HW_FAULT; the first cause is kept (F1, F5)."""
        trigger = Event.UNSUPPORTED if code is FaultCode.UNSUPPORTED else Event.FAULT
        calibrating = j in self.calibrations.running
        state, name = self.state, self.config.names[j]
        before = state.control_modes[j]
        if not self.go(j, trigger):
            return
        state.before[j] = before
        state.faults[j] = FaultRecord(
            name, active=True, code=int(code), text=f"{code.title}, {text}", stamp=state.time
        )
        state.note_faults([j])
        self.on_fault(j)
        self.streams.cut(j)
        self.feeds.cut(j)
        self.controller.joints[j].output_offset = 0.0  # F8: it would drive the joint in OPENLOOP
        if calibrating:  # K4
            self.calibrations.fail(j, state.faults[j].text)
        self.monitor.let_cool(j, code)
        self.monitor.forget(j)
        self.report("error", f"fault {int(code)}", j, f"fault, {code.title}: {text}")

    def force_idle(self, j: int) -> None:
        """FORCE_IDLE (F4, K2); on a fault whose cause is gone it clears it (F2)."""
        self.go(j, Event.FORCE_IDLE)
        if self.state.faults[j].active:
            self.monitor.forget(j)
            self.state.faults[j] = self.state.faults[j].cleared()
            self.state.note_faults([j])

    def check_faults(self) -> None:
        """Raise the faults that the last reading shows (F1)."""
        modes = self.state.control_modes
        causes: dict[int, Cause | None] = {
            j: self.monitor.cause(j)
            for j in self.monitor.unhealthy()
            if next_mode(modes[j], Event.FAULT) is not None  # in a fault, the first cause is kept
        }
        self.monitor.replace_broken()
        for j, cause in causes.items():
            if cause is not None:
                self.raise_fault(j, cause.code, cause.text)

    def warn_of_heat(self) -> None:
        """Warn of joints that approach a fault by heat (F6)."""
        for j in range(self.state.n):
            for key, text in self.monitor.warnings(j).items():
                if not self.state.faults[j].active:
                    self.report("warning", key, j, text)

    def raise_divergence(self) -> None:
        """Fault the joints whose control laws have an output that is not finite."""
        for j, joint in enumerate(self.controller.joints):
            if joint.diverged:
                joint.diverged = False
                text = "the output of its control laws is not a number; check its gains"
                self.raise_fault(j, FaultCode.CONTROLLER, text)

    def warn_of_limits(self) -> None:
        """Warn of joints that have passed a limit: software (P9) or torque."""
        laws, joints = self.controller.joints, self.config.joints
        on_limit, strained = [j.on_limit for j in laws], [j.strained for j in laws]
        for j, joint in enumerate(joints):
            if on_limit[j] and not self._on_limit[j]:
                position = float(self.state.measured[Row.POSITION, j])
                self.report("warning", "limit", j, explain_limit(joint, position))
            if strained[j] and not self._strained[j]:
                self.report("warning", "torque limit", j, explain_strain(joint))
        self._on_limit, self._strained = on_limit, strained

    def expire(self, late: Indices) -> None:
        """Reference timeouts of joints (P12): a velocity stops and holds, others fault."""
        for j in late.tolist():
            if self.state.control_modes[j] not in STOPPABLE:
                text = "references stopped while the motor drives"
                self.raise_fault(j, FaultCode.REFERENCE_TIMEOUT, text)
            elif self.references.is_ramping(j):
                self.references.halt(np.array([j]))
                timeout = self.config.joints[j].timeouts.velocity
                text = f"no velocity reference for {timeout:g} s; it stops and holds"
                self.report("info", "velocity timeout", j, text)


class JointHand:
    """What a calibrator may do with its joint; see :class:`Hand`."""

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
        check_finite("output", output)
        self._machine.controller.joints[self._j].output_command = output
        self._machine.set_law([self._j], Law.OUTPUT, direct=False, feeds=False)

    def set_offset(self, offset: float) -> None:
        check_finite("offset", offset)
        self._machine.calibrations.set_offset(self._j, offset)
        self._machine.references.reset([self._j], bounded=False)

    def move(self, target: float, speed: float) -> None:
        check_finite("target", target)
        check_finite("speed", speed)
        self._machine.references.move(np.array([self._j]), np.array([target]), np.array([speed]))

    def moving(self) -> bool:
        return not self._machine.state.done[self._j]


def check_finite(what: str, value: float) -> None:
    """Raise CalibrationError where a calibrator gives what is no finite number."""
    if not math.isfinite(value):
        raise CalibrationError(f"its calibrator gives {what} {value}, not a finite number")


def explain_limit(joint: JointConfig, position: float) -> str:
    """The warning of a joint that its protection pushes back into its software limits (P9)."""
    limits = joint.limits
    beyond = max(limits.lower - position, position - limits.upper)
    at, over, low, high = (
        joint.kind.position(value) for value in (position, beyond, limits.lower, limits.upper)
    )
    where = f"{over} beyond" if beyond > 0.5 * joint.kind.resolution else "at"
    return f"at {at}, {where} its software limits, {low} to {high}; the protection pushes it back"


def explain_strain(joint: JointConfig) -> str:
    """Why a joint in a position mode lags its reference."""
    torque = joint.kind.force(joint.limits.torque)
    return (
        f"its torque is at its limit, {torque}, and it lags its reference; "
        "reduce speed or load, or check for an obstruction"
    )

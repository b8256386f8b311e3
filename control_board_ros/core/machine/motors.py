# SPDX-License-Identifier: Apache-2.0
"""Motors of joints: encoders, amplifiers and loops under YARP's names (SPEC Y5), and the
feed-forward terms, u_ff on the output and τ_ff on the impedance torque (P11).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...text import unknown_word
from ..config.config import BoardConfig, BoardLimits
from ..laws.joint import Joint
from ..laws.pid import Pid as Gains
from ..model.coupling import MotorMix
from ..selection import RequestError, Selection, all_within, spread
from ..state import StateArrays
from ..terms.arguments import Array, Values
from ..terms.measurement import Motor
from ..terms.modes import CALIBRATES, CONFIGURED, UNCONFIGURED, UNPOWERED
from ..terms.motors import TERMS, Loop, Motors, Pids, Term
from ..terms.reply import Answer, JointAnswer, Reason, Reply, accepted, decided
from .decisions import decide_reference
from .explanations import all_or_none, explain_reference
from .machine import Machine


class Feedforward:
    """Checks feed-forward terms joint by joint, sets what is good, counts the rest."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine

    def set_feedforward(
        self,
        selection: Selection,
        outputs: Values | None,
        torques: Values | None,
        *,
        together: bool,
    ) -> Reply:
        """Set u_ff (percent) and τ_ff (N·m), either or both; they act as P11.

        Args:
            selection: the joints.
            outputs: u_ff, one for all joints or one each.
            torques: τ_ff, likewise.
            together: whether all joints accept them or none does.

        Raises:
            RequestError: neither is given, or the length of one does not fit.
        """
        if outputs is None and torques is None:
            raise RequestError("neither outputs nor torques given")
        machine, count = self._machine, len(selection.names)
        terms = [
            None if values is None else spread(values, count, what)
            for what, values in (("outputs", outputs), ("torques", torques))
        ]
        parts = [
            (j, [None if term is None else float(term[k]) for term in terms])
            for k, j in enumerate(selection.numbers)
        ]
        verdicts = [self._verdict(j, values) for j, values in parts]
        machine.feeds.note(selection.joints)
        answers = all_or_none(verdicts) if together else verdicts
        bounded = []
        for (j, values), verdict, answer in zip(parts, verdicts, answers, strict=True):
            machine.state.rejected[j] += np.uint64(bool(verdict.code))
            joint = machine.controller.joints[j]
            bounded.append(math.nan if answer.code else add_feedforward(joint, *values))
        return replace(decided(selection.names, answers), values=tuple(bounded))

    def _verdict(self, j: int, terms: Sequence[float | None]) -> JointAnswer:
        """What becomes of the terms of a joint."""
        facts = self._machine.facts(j)
        values = tuple(value for value in terms if value is not None)
        verdict = decide_reference(facts, None, values)
        joint = np.array([j])
        if void := self._machine.feeds.void(None, joint, joint, [verdict.accepts]):
            verdict = decide_reference(facts, None, values, void=void[0])
        text = explain_reference(verdict.reason, facts, None, values)
        return JointAnswer(verdict.answer, text, verdict.reason)


def add_feedforward(joint: Joint, output: float | None, torque: float | None) -> float:
    """Set u_ff (percent) and τ_ff (N·m), either or both; the first given, as bounded."""
    bounded = [] if output is None else [feed_output(joint, output)]
    if torque is not None:
        bounded.append(feed_torque(joint, torque))
    return bounded[0]


def feed_output(joint: Joint, output: float) -> float:
    """Set u_ff within the limit of the output, percent (P11); as bounded."""
    joint.output_offset = bounded = float(
        min(max(output, -joint.limits.output), joint.limits.output)
    )
    return bounded


def feed_torque(joint: Joint, torque: float) -> float:
    """Set τ_ff within the limit of the torque, N·m (P11); as bounded."""
    bounded = float(min(max(torque, -joint.limits.torque), joint.limits.torque))
    joint.offer_torque(bounded)
    return bounded


#: How many times the configured torque constant one may be that users set, or a part of it; and
#: the same of the back-EMF's: more would drive a motor by its own speed.
CONSTANT_FACTOR, EMF_FACTOR = 10.0, 2.0


#: The least cap of a current, as a part of the peak current.
MIN_CAP_SHARE = 1e-3


class MotorAccess:
    """What is read and set of motors, amplifiers and loops.

    Args:
        machine: whose joints they are.
        limits: of the same joints.
        mix: of their motors, where these are coupled.
    """

    def __init__(self, machine: Machine, limits: BoardLimits, mix: MotorMix | None = None) -> None:
        self._machine, self.limits, self._mix = machine, limits, mix

    def motors(self, joints: list[int]) -> Motors:
        """Motors and amplifiers as they are now."""
        machine, state = self._machine, self._machine.state
        configs = [machine.config.joints[j] for j in joints]
        ratios = np.array([c.motor.gear_ratio for c in configs])
        shafts = shaft_readings(state)[:, joints]
        accelerations = np.array([joint.acceleration for joint in machine.controller.joints])
        if self._mix is not None:
            accelerations = self._mix.motor_rates(accelerations)
        accelerations = accelerations[joints] * ratios
        accelerations[np.isnan(shafts[Motor.POSITION])] = np.nan
        caps = machine.controller.caps[:, joints]
        return Motors(
            gear_ratios=ratios,
            positions=shafts[Motor.POSITION],
            velocities=shafts[Motor.VELOCITY],
            accelerations=accelerations,
            currents=state.current[joints],
            nominal_currents=np.array([c.limits.nominal_current for c in configs]),
            peak_currents=np.array([c.limits.peak_current for c in configs]),
            max_currents=caps[0].copy(),
            outputs=state.applied[joints],
            output_limits=caps[1].copy(),
            supply_voltages=shafts[Motor.SUPPLY],
            temperatures=state.temperature[joints],
            temperature_limits=np.array([c.limits.temperature for c in configs]),
            torque_limits=np.array([c.limits.torque for c in configs]),
            **self._terms(joints),
        )

    def _terms(self, joints: list[int]) -> dict[str, Array]:
        rows = [self._machine.controller.terms_in_force(j) for j in joints]
        columns = np.array(rows).reshape(len(joints), len(Term)).T
        return {name: columns[row].copy() for name, row in TERMS.items()}

    def set(self, selection: Selection, requested: Mapping[str, Values | None]) -> Reply:
        """Set values, one for all joints or one each, by their names: caps, and those of TERMS.

        Raises:
            RequestError: there is none, or one is not within what is configured.
        """
        bounds = self._bounds()
        for name in requested:
            if name not in bounds:
                raise RequestError(unknown_word("value of motors", name, bounds))
        checked = {
            name: all_within(
                selection, name.removesuffix("s"), values, bounds[name][1], lowest=bounds[name][0]
            )
            for name, values in requested.items()
            if values is not None
        }
        if not checked:
            raise RequestError(f"none of {', '.join(requested)} given; send one or more")
        controller = self._machine.controller
        controller.set_caps(
            selection.joints, checked.get("max_currents"), checked.get("output_limits")
        )
        terms = {TERMS[name]: values for name, values in checked.items() if name in TERMS}
        if terms:
            controller.set_terms(selection.joints, terms)
            self.retune()
        return accepted(selection.names)

    def _bounds(self) -> dict[str, tuple[Array | None, Array]]:
        """Least (None: above 0) and greatest value of each joint of the board, by name."""
        limits, zero = self.limits, np.zeros(self._machine.state.n)
        constants = np.array(
            [joint.motor.torque_constant for joint in self._machine.config.joints]
        )
        return {
            "max_currents": (MIN_CAP_SHARE * limits.current, limits.current),
            "output_limits": (zero, limits.output),
            "torque_constants": (constants / CONSTANT_FACTOR, CONSTANT_FACTOR * constants),
            "back_emf_constants": (zero, EMF_FACTOR * constants),
            "viscous_positive": (zero, limits.torque / limits.velocity),
            "viscous_negative": (zero, limits.torque / limits.velocity),
            "coulomb_positive": (zero, limits.torque),
            "coulomb_negative": (zero, limits.torque),
            "velocity_thresholds": (None, limits.velocity),
        }

    def retune(self) -> None:
        """Lead coupled motors by the constants that the laws use."""
        if self._mix is not None:
            self._mix.retune(*constants_of(self._machine.controller.joints))

    def pids(self, joints: list[int], loop: Loop) -> Pids:
        """A loop of each joint; NaN where it does not run."""
        laws = [self._machine.controller.joints[j] for j in joints]
        rows = np.array([LOOPS[loop](joint) for joint in laws]).reshape(len(joints), 3)
        offsets = np.array([joint.output_offset for joint in laws])
        return Pids(rows[:, 0], rows[:, 0] - rows[:, 1], rows[:, 2], offsets)

    def set_pids(
        self, selection: Selection, loop: Loop, *, reset: bool, offsets: Array | None
    ) -> Reply:
        """Drop what a loop has integrated, set what is added to its output (percent), or both."""
        machine, answers = self._machine, []
        for k, j in enumerate(selection.numbers):
            name, mode = selection.names[k], machine.state.control_modes[j]
            if mode in CALIBRATES:
                text = f"{name} is {mode.name}: its calibrator has the loop; wait until it is done"
                answers.append(JointAnswer(Answer.REFUSED, text, Reason.CALIBRATING))
                continue
            if mode in UNCONFIGURED and offsets is not None:  # N4
                text = f"{name} is {mode.name}; offsets can be set once it is configured"
                answers.append(JointAnswer(Answer.REFUSED, text, Reason.NOT_CONFIGURED))
                continue
            joint = machine.controller.joints[j]
            if offsets is not None:
                feed_output(joint, float(offsets[k]))
            if reset:
                pid_of(joint, loop).reset(0.0)
            answers.append(JointAnswer())
        return decided(selection.names, answers)

    def set_motor_encoders(self, selection: Selection, positions: Array) -> Reply:
        """Set the readings of motor encoders, rad."""
        state, answers = self._machine.state, []
        for name, j, position in zip(
            selection.names, selection.numbers, positions.tolist(), strict=True
        ):
            if np.isnan(reading := float(state.motors[Motor.POSITION, j])):
                text = f"{name} has no encoder at its motor"
                answers.append(JointAnswer(Answer.REFUSED, text, Reason.UNSUPPORTED))
                continue
            state.motor_offset[j] = reading - position
            answers.append(JointAnswer())
        return decided(selection.names, answers)

    def set_encoders(self, selection: Selection, positions: Array) -> Reply:
        """Set the present angles of joints without power, rad; limits apply to these angles."""
        answers = [
            self._take_angle(j, name, position)
            for j, name, position in zip(
                selection.numbers, selection.names, positions.tolist(), strict=True
            )
        ]
        return decided(selection.names, answers)

    def _take_angle(self, j: int, name: str, position: float) -> JointAnswer:
        machine, state = self._machine, self._machine.state
        limits, mode = machine.config.joints[j].limits, state.control_modes[j]
        if mode not in CONFIGURED:
            text = f"{name} is {mode.name}; its angle can be set once it is configured"
            return JointAnswer(Answer.REFUSED, text, Reason.NOT_CONFIGURED)
        if mode is not UNPOWERED:
            text = f"{name} is {mode.name}; its angle can be set in {UNPOWERED.name} only"
            return JointAnswer(Answer.REFUSED, text, Reason.OTHER_MODE)
        if not limits.hard_lower <= position <= limits.hard_upper:
            kind = machine.config.joints[j].kind
            low, high = kind.position(limits.hard_lower), kind.position(limits.hard_upper)
            text = f"{name} cannot be at {kind.position(position)}; its stops are {low} to {high}"
            return JointAnswer(Answer.REFUSED, text, Reason.OUT_OF_RANGE)
        calibrations = machine.calibrations
        calibrations.set_offset(j, float(state.position[j] + state.offset[j]) - position)
        machine.references.reset([j], bounded=bool(state.calibrated[j]))
        return JointAnswer()


def mix_of(config: BoardConfig, joints: Sequence[Joint]) -> MotorMix | None:
    """What leads the coupled motors of a board; None where each axis has its own."""
    if config.motor_coupling is None:
        return None
    return MotorMix(config.motor_coupling, *constants_of(joints))


def constants_of(joints: Sequence[Joint]) -> Array:
    """Torque per ampere, resistance, back-EMF, percent per volt of the motors that laws lead."""
    rows = [
        (
            joint.motor.torque_per_ampere,
            joint.motor.ohms,
            joint.motor.emf,
            joint.motor.percent_per_volt,
        )
        for joint in joints
    ]
    return np.array(rows).T


def shaft_readings(state: StateArrays) -> Array:
    """Rows of Motor of all joints, as last set, shape (rows, n)."""
    readings: Array = state.motors.copy()
    readings[Motor.POSITION] -= state.motor_offset
    return readings


def pid_of(joint: Joint, loop: Loop) -> Gains:
    """The PID of a loop; that of the velocity is the position's."""
    pids = {Loop.TORQUE: joint.torque_pid, Loop.CURRENT: joint.current_pid}
    pid: Gains = pids.get(loop, joint.position_pid)
    return pid


def put_out(pid: Gains) -> float:
    """What a PID put out in the last cycle."""
    return float(pid.feed() + pid.integral)


#: What each loop follows, measures and puts out.
LOOPS: dict[Loop, Callable[[Joint], tuple[float, float, float]]] = {
    Loop.POSITION: lambda j: (j.track.position, j.position, put_out(j.position_pid)),
    Loop.VELOCITY: lambda j: (j.track.velocity, j.velocity, put_out(j.position_pid)),
    Loop.TORQUE: lambda j: (j.torque_reference, j.torque, put_out(j.torque_pid)),
    Loop.CURRENT: lambda j: (
        j.current_pid.reference,
        j.current,
        j.output if j.drive.in_amps else 0.0,
    ),
}

# SPDX-License-Identifier: Apache-2.0
"""The control laws of source Fig. 2, on arrays (SPEC P7 to P11, I5).

Both loops give a torque; the board turns it into a PWM or a current by the motor's constants.
A joint takes part in a law by its gains: where a law does not run, its gains are zero, so no
law ever asks for a mode.
"""

from __future__ import annotations

import math
from enum import IntEnum, auto

import numpy as np

from .config import BoardConfig, JointConfig
from .measurement import Array, Row
from .modes import GUARDED, Law
from .pid import PidLoops
from .state import Joints, State

POSITION_LOOP, TORQUE_LOOP = 0, 1

#: Where the protection at a software limit begins, rad inside it (P9).
GUARD_ZONE = math.radians(1.0)

#: Speeds over which it takes the torque away, as a part of the speed limit.
GUARD_SPEEDS = 0.2


class Gain(IntEnum):
    """Rows of what a law makes of a joint, below the gains of the position and torque loops."""

    PER_TORQUE = 2 * PidLoops.GAINS  # output per N·m
    COMPENSATION = auto()  # output per rad/s, against the back-EMF
    POWERED = auto()
    MAX_OUTPUT = auto()
    MIN_OUTPUT = auto()
    MAX_PWM = auto()
    MIN_PWM = auto()
    COMPLIANT = auto()  # 1 where the impedance acts
    TORQUE = auto()  # 1 where the torque asked for acts
    TRACKED = auto()  # 1 where a torque reference is tracked
    OUTPUT = auto()  # 1 where the output asked for acts
    OFFSET = auto()  # what u_ff in percent is worth
    IN_AMPS = auto()  # 1 where the output is a current reference
    GUARDED = auto()  # 1 where the protection at the limits watches


class Controller:
    """From references and measurements to the output of every motor.

    Every law is a table of gains, one column per joint; giving a joint its law copies a column.
    """

    def __init__(self, config: BoardConfig, state: State) -> None:
        n = state.n
        self._state = state
        self._current_loop = config.output == "current"
        self._gains = np.zeros((len(Gain) + 2 * PidLoops.GAINS, n))
        self.loops = PidLoops(self._gains[: 2 * PidLoops.GAINS].reshape(PidLoops.GAINS, 2, n))
        self._current_gains = np.zeros((PidLoops.GAINS, 1, n))
        self.current = PidLoops(self._current_gains)
        self._position_error, self._torque_error = self.loops.error
        self._position_rate, self._torque_rate = self.loops.rate
        self._position_wanted, self._torque_wanted = self.loops.reference
        self._last_torque_error = np.zeros(n)
        self._wanted, self._given = np.zeros(n), np.zeros(n)
        self._a, self._b, self._c = np.zeros(n), np.zeros(n), np.zeros(n)
        self.stiffness, self.damping = np.zeros(n), np.zeros(n)  # as set by the user (I6)
        self._stiffness, self._negative_damping = np.zeros(n), np.zeros(n)  # where they act
        self.torque_command, self.torque_offset = np.zeros(n), np.zeros(n)
        self.output_command, self.output_offset = np.zeros(n), np.zeros(n)
        self._impedance = np.zeros((3, n))  # torque of the spring, the damper, and the rest
        self._spring, self._damper, self._torque_base = self._impedance
        self._feed, self._ones = np.zeros(n), np.ones(3)
        gains = self._gains
        self._per_torque = gains[Gain.PER_TORQUE]
        self._compensation = gains[Gain.COMPENSATION]
        self._max_output, self._min_output = gains[Gain.MAX_OUTPUT], gains[Gain.MIN_OUTPUT]
        self._max_pwm, self._min_pwm = gains[Gain.MAX_PWM], gains[Gain.MIN_PWM]
        self._in_amps = gains[Gain.IN_AMPS]
        self._guard_lower = np.full((Row.VELOCITY + 1, n), -np.inf)
        self._guard_upper = np.full((Row.VELOCITY + 1, n), np.inf)
        self._above = np.ones((Row.VELOCITY + 1, n), dtype=bool)
        self._below = np.ones((Row.VELOCITY + 1, n), dtype=bool)
        self._armed = [(Law.OFF, False)] * n  # law, and whether with the direct gains
        self.on_limit = [False] * n
        self.reconfigure(config)

    def reconfigure(self, config: BoardConfig) -> None:
        """Take new constants and gains; the laws that run go on with them."""
        self._joints = config.joints
        self._period = config.period
        motors = [joint.motor for joint in config.joints]
        self._percent_per_volt = np.array([100.0 / motor.supply_voltage for motor in motors])
        self._ohms = np.array([motor.resistance for motor in motors])
        self._emf = np.array([motor.back_emf for motor in motors])
        self._percent_per_speed = self._percent_per_volt * self._emf
        limits = [joint.limits for joint in config.joints]
        self._lower = np.array([limit.lower for limit in limits])
        self._upper = np.array([limit.upper for limit in limits])
        self.max_torque = np.array([limit.torque for limit in limits])
        self._min_torque = -self.max_torque
        self.max_percent = np.array([limit.output for limit in limits])
        velocity = np.array([limit.velocity for limit in limits])
        braking = velocity**2 / np.array([2.0 * limit.acceleration for limit in limits])
        self._guard_lower[Row.POSITION] = self._lower + GUARD_ZONE + braking
        self._guard_upper[Row.POSITION] = self._upper - GUARD_ZONE - braking
        self._guard_upper[Row.VELOCITY] = (1.0 - GUARD_SPEEDS) * velocity
        self._guard_lower[Row.VELOCITY] = (GUARD_SPEEDS - 1.0) * velocity
        for j, joint in enumerate(config.joints):
            self._current_gains[:, 0, j] = PidLoops.column(joint.current_pid, config.period)
        self._tables = {
            (law, direct): np.array([self._column(j, law, direct) for j in config.joints]).T
            for law in Law
            for direct in (False, True)
        }
        for j, (law, direct) in enumerate(self._armed):
            self.arm(slice(j, j + 1), law, direct=direct)

    def _column(self, joint: JointConfig, law: Law, direct: bool) -> list[float]:
        """What a law makes of a joint: its gains there, none of the other laws'."""
        stiff, compliant = law is Law.POSITION, law is Law.IMPEDANCE
        torque, on = compliant or law is Law.TORQUE, law is not Law.OFF
        position_pid = (joint.direct_pid if direct else None) or joint.position_pid
        loops = zip(
            PidLoops.column(position_pid if stiff else None, self._period),
            PidLoops.column(joint.torque_pid if torque else None, self._period),
            strict=True,
        )
        motor, limits = joint.motor, joint.limits
        amps = self._current_loop and law is not Law.OUTPUT  # P8: the given PWM, as it is
        per_volt = 100.0 / motor.supply_voltage
        per_ampere = 1.0 if amps else per_volt * motor.resistance
        emf = 0.0 if amps else joint.back_emf_compensation * per_volt * motor.back_emf
        # A current reference stays below what would be an overcurrent.
        bound = 0.95 * limits.peak_current if amps else limits.output
        rows = {
            Gain.PER_TORQUE: per_ampere / motor.torque_per_ampere,
            Gain.COMPENSATION: emf * (stiff or torque),
            Gain.POWERED: on,
            Gain.MAX_OUTPUT: bound * on,
            Gain.MIN_OUTPUT: 0.0 - bound * on,  # never -0.0, which min and max mix up
            Gain.MAX_PWM: limits.output * on,
            Gain.MIN_PWM: 0.0 - limits.output * on,
            Gain.COMPLIANT: compliant,
            Gain.TORQUE: law is Law.TORQUE,
            Gain.TRACKED: torque,
            Gain.OUTPUT: law is Law.OUTPUT,
            Gain.OFFSET: (0.01 * limits.peak_current if amps else 1.0) * on,
            Gain.IN_AMPS: amps,
            Gain.GUARDED: law in GUARDED,
        }
        return [*(gain for pair in loops for gain in pair), *(float(rows[row]) for row in Gain)]

    def arm(self, joints: Joints, law: Law, *, direct: bool) -> None:
        """Give joints their law."""
        gains = self._gains
        gains[:, joints] = self._tables[law, direct][:, joints]
        self._state.powered[:] = gains[Gain.POWERED]
        for j in self._state.numbers(joints):
            self._armed[j] = law, direct
        self._tracked = gains[Gain.TRACKED] > 0.0
        self._torque_used = True in self._tracked.tolist()
        self._torque_rate_used = self._torque_used and bool(self.loops.kd[TORQUE_LOOP].any())
        self._position_fed = bool(self.loops.kff[POSITION_LOOP].any())
        self._guard_used = 1.0 in gains[Gain.GUARDED].tolist()
        if self._current_loop:
            self._bypassed = np.flatnonzero(self._in_amps == 0.0)
        self.refresh()

    def refresh(self) -> None:
        """Let the impedances, torques and outputs that users set act where they do."""
        gains = self._gains
        np.multiply(self.stiffness, gains[Gain.COMPLIANT], self._stiffness)
        np.multiply(self.damping, -gains[Gain.COMPLIANT], self._negative_damping)
        np.multiply(self.torque_offset, gains[Gain.COMPLIANT], self._torque_base)
        np.add(self._torque_base, self.torque_command * gains[Gain.TORQUE], self._torque_base)
        np.multiply(self.output_offset, gains[Gain.OFFSET], self._feed)
        np.add(self._feed, self.output_command * gains[Gain.OUTPUT], self._feed)
        # Adding zeros also turns -0.0, which the bounds of an unpowered joint mix up, into 0.0.
        self._feeding = bool(self._feed.any()) or 0.0 in gains[Gain.POWERED].tolist()

    def reset(self, joints: Joints) -> None:
        """Start the loops of joints without a jump of their torque (M9)."""
        state = self._state
        measured = state.torque[joints]
        fed = self.loops.kff[:, joints] * np.array([state.position[joints], measured])
        self.loops.reset(joints, measured - fed)
        if self._current_loop:
            self.current.reset(joints, 0.0)
        self._last_torque_error[joints] = 0.0
        for j in self._state.numbers(joints):
            self.on_limit[j] = False
        self._state.output[joints] *= self._gains[Gain.POWERED, joints]

    def step(self) -> None:
        """One control period: state.output from the references and measurements of now."""
        state, a, wanted, given = self._state, self._a, self._wanted, self._given
        np.subtract(state.position_reference, state.position, self._position_error)
        np.subtract(state.velocity_reference, state.velocity, self._position_rate)
        if self._torque_used:
            self._torque_reference()
        if self._position_fed:
            self._position_wanted[:] = state.position_reference
        self.loops.step(wanted)
        np.minimum(wanted, self.max_torque, out=given)
        np.maximum(given, self._min_torque, out=given)
        if wanted.tobytes() != given.tobytes():
            self.loops.unwind(wanted - given)
        # From torque to output, with what the motor and the user add.
        np.multiply(given, self._per_torque, wanted)
        np.multiply(state.velocity, self._compensation, a)
        np.add(wanted, a, wanted)
        if self._feeding:
            np.add(wanted, self._feed, wanted)
        output = given if self._current_loop else state.output
        np.minimum(wanted, self._max_output, out=output)
        np.maximum(output, self._min_output, out=output)
        if wanted.tobytes() != output.tobytes():
            self.loops.unwind(wanted - output)
        if self._guard_used:
            self._guard(output)
        if self._current_loop:
            self._track_current(output)

    def _torque_reference(self) -> None:
        """Torque of a virtual spring and damper (I5; source Fig. 2, second row).

        tau = tau_ff + k·(q_ref − q) − d·q̇, bounded by the joint's torque; where the law is
        TORQUE, k and d are zero and tau_ff is the torque asked for.
        """
        state, tau = self._state, self._torque_wanted
        np.multiply(self._stiffness, self._position_error, self._spring)
        np.multiply(self._negative_damping, state.velocity, self._damper)
        np.dot(self._ones, self._impedance, tau)
        np.minimum(tau, self.max_torque, out=tau)
        np.maximum(tau, self._min_torque, out=tau)
        np.copyto(state.torque_reference, tau, where=self._tracked)
        np.subtract(tau, state.torque, self._torque_error)
        if self._torque_rate_used:
            np.subtract(self._torque_error, self._last_torque_error, self._torque_rate)
            np.divide(self._torque_rate, self._period, self._torque_rate)
            self._last_torque_error[:] = self._torque_error

    def _track_current(self, reference: Array) -> None:
        """The inner loop of a board with current output (P10).

        v = R·i_ref + Ke·q̇ + PI(i_ref, i), as PWM in percent.
        """
        state, b, c = self._state, self._b, self._c
        np.subtract(reference, state.current, self.current.error[0])
        self.current.reference[0] = reference
        self.current.step(b)
        np.multiply(self._ohms, reference, c)
        np.add(b, c, b)
        np.multiply(self._emf, state.velocity, c)
        np.add(b, c, b)
        np.multiply(b, self._percent_per_volt, b)
        np.minimum(b, self._max_pwm, out=c)
        np.maximum(c, self._min_pwm, out=state.output)
        if b.tobytes() != state.output.tobytes():
            self.current.unwind(b - state.output)
        if self._bypassed.size:
            state.output[self._bypassed] = reference[self._bypassed]
            self.current.integral[0, self._bypassed] = 0.0

    def _guard(self, output: Array) -> None:
        """The protection at the limits, where no position loop keeps them (P9), in place."""
        watched = self._state.block[: Row.VELOCITY + 1]
        np.greater_equal(watched, self._guard_lower, self._above)
        np.less_equal(watched, self._guard_upper, self._below)
        if b"\0" in self._above.tobytes() or b"\0" in self._below.tobytes():
            for j, guarded in enumerate(self._gains[Gain.GUARDED].tolist()):
                if guarded and self._state.calibrated[j]:
                    output[j] = self._guarded(j, float(output[j]))
        elif True in self.on_limit:
            self.on_limit = [False] * self._state.n

    def _guarded(self, j: int, output: float) -> float:
        """What a joint may get of an output.

        A joint may go towards a software limit as fast as it can still brake, and nowhere faster
        than its speed limit: around that speed the torque that may drive it falls to zero, and
        goes on to a full one against it, over GUARD_SPEEDS. It also falls to zero over
        GUARD_ZONE; beyond the limit a spring and damper pushes the joint back.
        """
        state, joint = self._state, self._joints[j]
        limits, bound = joint.limits, float(self._max_output[j])
        position, velocity = float(state.position[j]), float(state.velocity[j])
        coasting = 0.0 if self._in_amps[j] else float(self._percent_per_speed[j]) * velocity
        beyond = False
        for way, room in ((1.0, limits.upper - position), (-1.0, position - limits.lower)):
            speed, top = velocity * way, limits.velocity
            top = min(top, math.sqrt(2.0 * limits.acceleration * max(room, 0.0)))
            allowed = limits.torque * (top - speed) / (GUARD_SPEEDS * limits.velocity)
            if room < 0.0:
                beyond, push = True, joint.guard_stiffness * room
                allowed = min(allowed, push - joint.guard_damping * max(speed, 0.0))
            elif room < GUARD_ZONE:
                allowed = min(allowed, limits.torque * room / GUARD_ZONE)
            if allowed < limits.torque:
                allowed = max(allowed, -limits.torque) * float(self._per_torque[j])
                output = way * min(output * way, allowed + coasting * way)
        on_edge = min(limits.upper - position, position - limits.lower) < GUARD_ZONE
        self.on_limit[j] = beyond or (on_edge and self.on_limit[j])
        return max(-bound, min(bound, output))

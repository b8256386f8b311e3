# SPDX-License-Identifier: Apache-2.0
"""The control laws of source Fig. 2, on arrays (SPEC P7 to P11, I5).

Both loops give a torque; the board turns it into a PWM or a current by the motor's constants.
A joint takes part in a law by its gains: where a law does not run, its gains are zero, so no
law ever asks for a mode.
"""

from __future__ import annotations

import math

import numpy as np

from .config import BoardConfig, Pid
from .measurement import Array, Row
from .modes import GUARDED, Law
from .state import State

POSITION_LOOP, TORQUE_LOOP = 0, 1

#: Where the protection at a software limit begins, rad inside it (P9).
GUARD_ZONE = math.radians(1.0)


class PidLoops:
    """PIDs with a clamped integral and a filtered derivative, for arrays of loops.

    out = kp·e + I + kd·d;  I += ki·e·dt, clamped;  d += α(rate − d)

    All arrays have shape (loops, n); ``terms`` and ``gains`` hold e, I, d and kp, 1, kd, so that
    the law is one product and one sum. Attributes: error and rate (inputs), integral.
    """

    def __init__(self, loops: int, n: int) -> None:
        self._terms = np.zeros((3, loops, n))
        self._gains = np.zeros((3, loops, n))
        self._products = np.zeros((3, loops, n))
        self._rows = self._products.reshape(3 * loops, n)
        self._ones = np.ones(3 * loops)  # a product with ones is the cheapest sum of rows
        self.error, self._integral_term, self._derivative = self._terms
        self.kp, unity, self.kd = self._gains
        unity[:] = 1.0
        shape = (loops, n)
        self.rate = np.zeros(shape)
        self.integral, self._previous = np.zeros(shape), np.zeros(shape)
        self.ki_dt, self.alpha = np.zeros(shape), np.ones(shape)
        self.limit, self._negative_limit = np.zeros(shape), np.zeros(shape)
        self._scratch = np.zeros(shape)

    def set_gains(self, loop: int, j: int, pid: Pid | None, period: float) -> None:
        """Give one loop its gains, or none."""
        pid = pid or Pid(kp=0.0, integral_limit=0.0)
        self.kp[loop, j], self.kd[loop, j] = pid.kp, pid.kd
        self.ki_dt[loop, j] = pid.ki * period
        self.alpha[loop, j] = 1.0 - math.exp(-2.0 * math.pi * pid.derivative_cutoff * period)
        self.limit[loop, j] = pid.integral_limit
        self._negative_limit[loop, j] = -pid.integral_limit
        if pid.ki == 0.0:
            self.integral[loop, j] = 0.0

    def reset(self, loop: int, j: int, integral: float) -> None:
        """Start one loop at a given integral part (M9: without a jump of the output)."""
        bound = self.limit[loop, j] if self.ki_dt[loop, j] > 0.0 else 0.0
        self.integral[loop, j] = max(-bound, min(bound, integral))
        self._derivative[loop, j] = 0.0

    def step(self, out: Array) -> None:
        """One period from ``error`` and ``rate``; out, shape (n,), is the sum of all loops."""
        scratch, integral = self._scratch, self._previous
        self._previous = self.integral
        np.multiply(self.ki_dt, self.error, scratch)
        np.add(self._previous, scratch, integral)
        np.minimum(integral, self.limit, out=integral)
        np.maximum(integral, self._negative_limit, out=integral)
        self.integral = integral
        self._integral_term[:] = integral
        derivative = self._derivative
        np.subtract(self.rate, derivative, scratch)
        np.multiply(scratch, self.alpha, scratch)
        np.add(derivative, scratch, derivative)
        np.multiply(self._gains, self._terms, self._products)
        np.dot(self._ones, self._rows, out)

    def unwind(self, excess: Array) -> None:
        """Anti-windup: where the output is cut, an integral that pushes further goes back.

        Args:
            excess: what was cut off, wanted minus given, shape (n,).
        """
        pushing = self.error * excess > 0.0
        self.integral[pushing] = self._previous[pushing]


class Controller:
    """From references and measurements to the output of every motor."""

    def __init__(self, config: BoardConfig, state: State) -> None:
        n = state.n
        self._state = state
        self.loops = PidLoops(2, n)
        self.current = PidLoops(1, n)
        self._current_loop = config.output == "current"
        self._position_error, self._torque_error = self.loops.error
        self._position_rate, self._torque_rate = self.loops.rate
        self._last_torque_error = np.zeros(n)
        self._wanted, self._given = np.zeros(n), np.zeros(n)
        self._a, self._b, self._c = np.zeros(n), np.zeros(n), np.zeros(n)
        self.stiffness, self.damping = np.zeros(n), np.zeros(n)  # as set by the user (I6)
        self._stiffness, self._damping = np.zeros(n), np.zeros(n)  # where they act
        self.torque_command, self.torque_offset = np.zeros(n), np.zeros(n)
        self._torque_base, self._kff = np.zeros(n), np.zeros(n)
        self.output_command, self.output_offset = np.zeros(n), np.zeros(n)
        self._feed, self._compensation = np.zeros(n), np.zeros(n)
        self._per_torque, self._in_amps = np.zeros(n), np.zeros(n, dtype=bool)
        self._bypassed = np.arange(n)
        self._feeding = True
        self._guard_lower = np.full((Row.VELOCITY + 1, n), -np.inf)
        self._guard_upper = np.full((Row.VELOCITY + 1, n), np.inf)
        self._above = np.ones((Row.VELOCITY + 1, n), dtype=bool)
        self._below = np.ones((Row.VELOCITY + 1, n), dtype=bool)
        self._torque_controlled = np.zeros(n, dtype=bool)
        self._torque_used = self._torque_rate_used = self._guard_used = False
        self._max_output, self._min_output = np.zeros(n), np.zeros(n)
        self._max_pwm, self._min_pwm = np.zeros(n), np.zeros(n)
        self.laws = [Law.OFF] * n
        self.on_limit = [False] * n
        self.reconfigure(config)

    def reconfigure(self, config: BoardConfig) -> None:
        """Take the constants of the joints; gains follow with :meth:`arm`."""
        self._joints, self._period = config.joints, config.period
        motors = [joint.motor for joint in config.joints]
        per_ampere = np.array([motor.torque_per_ampere for motor in motors])
        self._percent_per_volt = np.array([100.0 / motor.supply_voltage for motor in motors])
        self._ohms = np.array([motor.resistance for motor in motors])
        self._emf = np.array([motor.back_emf for motor in motors])
        self._amps_per_torque = 1.0 / per_ampere
        self._percent_per_torque = self._percent_per_volt * self._ohms / per_ampere
        self._percent_per_speed = self._percent_per_volt * self._emf
        limits = [joint.limits for joint in config.joints]
        self.max_torque = np.array([limit.torque for limit in limits])
        self._min_torque = -self.max_torque
        self.max_percent = np.array([limit.output for limit in limits])
        velocity = [limit.velocity for limit in limits]
        self._guard_lower[Row.POSITION] = [limit.lower + GUARD_ZONE for limit in limits]
        self._guard_upper[Row.POSITION] = [limit.upper - GUARD_ZONE for limit in limits]
        self._guard_upper[Row.VELOCITY] = velocity
        self._guard_lower[Row.VELOCITY] = np.negative(velocity)
        for j, joint in enumerate(config.joints):
            self.current.set_gains(0, j, joint.current_pid, config.period)

    def arm(self, j: int, law: Law, *, direct: bool) -> None:
        """Give one joint its law: its gains there, none in the others."""
        joint, period = self._joints[j], self._period
        stiff, compliant = law is Law.POSITION, law is Law.IMPEDANCE
        torque = compliant or law is Law.TORQUE
        position_pid = (joint.direct_pid if direct else None) or joint.position_pid
        self.loops.set_gains(POSITION_LOOP, j, position_pid if stiff else None, period)
        self.loops.set_gains(TORQUE_LOOP, j, joint.torque_pid if torque else None, period)
        self._torque_controlled[j] = torque
        self._kff[j] = joint.torque_pid.kff if torque else 0.0
        on = law is not Law.OFF
        amps = self._current_loop and law is not Law.OUTPUT  # P8: the given PWM, as it is
        self._in_amps[j] = amps
        per_torque = self._amps_per_torque if amps else self._percent_per_torque
        self._per_torque[j] = per_torque[j]
        emf = 0.0 if amps else joint.back_emf_compensation * self._percent_per_speed[j]
        self._compensation[j] = emf * (stiff or torque)
        self._state.powered[j] = float(on)
        self._max_pwm[j] = joint.limits.output * on
        self._min_pwm[j] = 0.0 - self._max_pwm[j]  # never -0.0, which min and max mix up
        # A current reference stays below what would be an overcurrent.
        self._max_output[j] = 0.95 * joint.limits.peak_current * on if amps else self._max_pwm[j]
        self._min_output[j] = 0.0 - self._max_output[j]
        self.laws[j] = law
        self.refresh(j)
        self._bypassed = np.flatnonzero(~self._in_amps)
        self._torque_used = any(one in (Law.IMPEDANCE, Law.TORQUE) for one in self.laws)
        self._guard_used = any(one in GUARDED for one in self.laws)
        self._torque_rate_used = bool(self.loops.kd[TORQUE_LOOP].any())

    def refresh(self, j: int) -> None:
        """Let the user's impedance, torques and outputs of one joint act where they do."""
        law = self.laws[j]
        compliant = law is Law.IMPEDANCE
        self._stiffness[j] = self.stiffness[j] * compliant
        self._damping[j] = self.damping[j] * compliant
        self._torque_base[j] = 0.0
        if compliant:
            self._torque_base[j] = self.torque_offset[j]
        elif law is Law.TORQUE:
            self._torque_base[j] = self.torque_command[j]
        self._feed[j] = 0.0
        if law is not Law.OFF:
            self._feed[j] = self.output_offset[j]
        if law is Law.OUTPUT:
            self._feed[j] += self.output_command[j]
        if self._in_amps[j]:
            self._feed[j] *= 0.01 * self._joints[j].limits.peak_current
        # Adding zeros also turns -0.0, which the bounds of an unpowered joint mix up, into 0.0.
        self._feeding = bool(self._feed.any()) or Law.OFF in self.laws

    def reset(self, j: int) -> None:
        """Start the loops of a joint without a jump of its torque (M9)."""
        measured = float(self._state.torque[j])
        self.loops.reset(POSITION_LOOP, j, measured)
        self.loops.reset(TORQUE_LOOP, j, 0.0)
        self.current.reset(0, j, 0.0)
        self._last_torque_error[j] = 0.0
        self.on_limit[j] = False
        if self.laws[j] is Law.OFF:
            self._state.output[j] = 0.0

    def step(self) -> None:
        """One control period: state.output from the references and measurements of now."""
        state, a, wanted, given = self._state, self._a, self._wanted, self._given
        np.subtract(state.position_reference, state.position, self._position_error)
        np.subtract(state.velocity_reference, state.velocity, self._position_rate)
        if self._torque_used:
            self._torque_reference()
        self.loops.step(wanted)
        if self._torque_used:
            np.multiply(state.torque_reference, self._kff, a)
            np.add(wanted, a, wanted)
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
        state, a, tau = self._state, self._a, self._b
        np.multiply(self._stiffness, self._position_error, tau)
        np.multiply(self._damping, state.velocity, a)
        np.subtract(tau, a, tau)
        np.add(tau, self._torque_base, tau)
        np.minimum(tau, self.max_torque, out=tau)
        np.maximum(tau, self._min_torque, out=tau)
        np.copyto(state.torque_reference, tau, where=self._torque_controlled)
        np.subtract(state.torque_reference, state.torque, self._torque_error)
        if self._torque_rate_used:
            np.subtract(self._torque_error, self._last_torque_error, self._torque_rate)
            np.divide(self._torque_rate, self._period, self._torque_rate)
            self._last_torque_error[:] = self._torque_error

    def _track_current(self, reference: Array) -> None:
        """The inner loop of a board with current output (P10).

        v = R·i_ref + Ke·q̇ + PI(i_ref − i), as PWM in percent.
        """
        state, b, c = self._state, self._b, self._c
        np.subtract(reference, state.current, self.current.error[0])
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
        """The protection at the limits, where no position loop keeps them (P9), in place.

        Towards a software limit the torque that may drive the joint further out falls to zero
        over GUARD_ZONE; beyond it a virtual spring and damper pushes the joint back. Beyond the
        speed limit the output may not drive it faster.
        """
        watched = self._state.block[: Row.VELOCITY + 1]
        np.greater_equal(watched, self._guard_lower, self._above)
        np.less_equal(watched, self._guard_upper, self._below)
        if b"\0" in self._above.tobytes() or b"\0" in self._below.tobytes():
            position = self._state.position
            lower, upper = self._guard_lower[Row.POSITION], self._guard_upper[Row.POSITION]
            depth = position - np.clip(position, lower, upper)
            for j, law in enumerate(self.laws):
                if law in GUARDED and self._state.calibrated[j]:
                    self._guard_joint(j, output, float(depth[j]))
        elif True in self.on_limit:
            self.on_limit = [False] * self._state.n

    def _guard_joint(self, j: int, output: Array, depth: float) -> None:
        """One joint, ``depth`` rad past where the guard begins, positive above."""
        state, joint = self._state, self._joints[j]
        limits, bound = joint.limits, float(self._max_output[j])
        velocity, per_torque = float(state.velocity[j]), float(self._per_torque[j])
        coasting = 0.0 if self._in_amps[j] else float(self._percent_per_speed[j]) * velocity
        wanted = float(output[j])
        if depth != 0.0:
            way = math.copysign(1.0, depth)
            past = abs(depth) - GUARD_ZONE
            allowed = (
                -joint.guard_stiffness * past if past > 0 else limits.torque * -past / GUARD_ZONE
            )
            allowed -= joint.guard_damping * max(0.0, velocity * way)
            allowed = max(allowed, -limits.torque)
            wanted = way * min(wanted * way, allowed * per_torque + coasting * way)
            self.on_limit[j] = past > 0.0 or self.on_limit[j]
        else:
            self.on_limit[j] = False
        if abs(velocity) > limits.velocity:
            way = math.copysign(1.0, velocity)
            wanted = way * min(wanted * way, coasting * way)
        output[j] = max(-bound, min(bound, wanted))

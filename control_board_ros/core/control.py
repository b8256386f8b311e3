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
from .measurement import Array
from .modes import GUARDED, Law
from .state import State

POSITION_LOOP, TORQUE_LOOP = 0, 1

#: Where the protection at a software limit begins, rad inside it (P9).
GUARD_ZONE = math.radians(1.0)


class PidLoops:
    """PIDs with a clamped integral and a filtered derivative, for arrays of loops.

    out = kp·e + I + kd·d;  I += ki·e·dt, clamped;  d += α(rate − d)

    All arrays have shape (loops, n). Attributes: kp, ki_dt, kd, alpha, limit, integral, rate.
    """

    def __init__(self, loops: int, n: int) -> None:
        shape = (loops, n)
        self.kp, self.ki_dt, self.kd = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        self.alpha, self.limit = np.ones(shape), np.zeros(shape)
        self._negative_limit = np.zeros(shape)
        self.integral, self.rate = np.zeros(shape), np.zeros(shape)
        self._previous, self._scratch = np.zeros(shape), np.zeros(shape)

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
        self.rate[loop, j] = 0.0

    def step(self, error: Array, rate: Array, out: Array) -> None:
        """One period; arrays of shape (loops, n), out is overwritten."""
        scratch = self._scratch
        self._previous[:] = self.integral
        np.multiply(self.ki_dt, error, out=scratch)
        np.add(self.integral, scratch, out=self.integral)
        np.minimum(self.integral, self.limit, out=self.integral)
        np.maximum(self.integral, self._negative_limit, out=self.integral)
        np.subtract(rate, self.rate, out=scratch)
        np.multiply(scratch, self.alpha, out=scratch)
        np.add(self.rate, scratch, out=self.rate)
        np.multiply(self.kp, error, out=out)
        np.add(out, self.integral, out=out)
        np.multiply(self.kd, self.rate, out=scratch)
        np.add(out, scratch, out=out)

    def unwind(self, excess: Array, error: Array) -> None:
        """Anti-windup: where the output is cut, an integral that pushes further goes back.

        Args:
            excess: what was cut off, wanted minus given, shape (n,).
            error: as given to step, shape (loops, n).
        """
        pushing = error * excess > 0.0
        self.integral[pushing] = self._previous[pushing]


class Controller:
    """From references and measurements to the output of every motor."""

    def __init__(self, config: BoardConfig, state: State) -> None:
        n = state.n
        self._state = state
        self.loops = PidLoops(2, n)
        self.current = PidLoops(1, n)
        self._current_loop = config.output == "current"
        self._error, self._rate, self._out = np.zeros((2, n)), np.zeros((2, n)), np.zeros((2, n))
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
        self._calm = np.ones(n, dtype=bool)
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
        self._guard_lower = np.array([limit.lower + GUARD_ZONE for limit in limits])
        self._guard_upper = np.array([limit.upper - GUARD_ZONE for limit in limits])
        self._max_velocity = np.array([limit.velocity for limit in limits])
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
        state, a = self._state, self._a
        error, rate, out = self._error, self._rate, self._out
        np.subtract(state.position_reference, state.position, out=error[POSITION_LOOP])
        np.subtract(state.velocity_reference, state.velocity, out=rate[POSITION_LOOP])
        if self._torque_used:
            self._torque_reference(error[POSITION_LOOP])
            np.subtract(state.torque_reference, state.torque, out=error[TORQUE_LOOP])
            if self._torque_rate_used:
                np.subtract(error[TORQUE_LOOP], self._last_torque_error, out=rate[TORQUE_LOOP])
                np.divide(rate[TORQUE_LOOP], self._period, out=rate[TORQUE_LOOP])
                self._last_torque_error[:] = error[TORQUE_LOOP]
        self.loops.step(error, rate, out)
        wanted, given = self._wanted, self._given
        np.add(out[POSITION_LOOP], out[TORQUE_LOOP], out=wanted)
        if self._torque_used:
            np.multiply(state.torque_reference, self._kff, out=a)
            np.add(wanted, a, out=wanted)
        np.minimum(wanted, self.max_torque, out=given)
        np.maximum(given, self._min_torque, out=given)
        cut = wanted.tobytes() != given.tobytes()
        if cut:
            self.loops.unwind(wanted - given, error)
        # From torque to output, with what the user and the motor add.
        np.multiply(given, self._per_torque, out=wanted)
        np.multiply(state.velocity, self._compensation, out=a)
        np.add(wanted, a, out=wanted)
        np.add(wanted, self._feed, out=wanted)
        np.minimum(wanted, self._max_output, out=given)
        np.maximum(given, self._min_output, out=given)
        if wanted.tobytes() != given.tobytes():
            self.loops.unwind(wanted - given, error)
        if self._guard_used:
            self._guard(given)
        if self._current_loop:
            self._track_current(given)
        else:
            state.output[:] = given

    def _torque_reference(self, error: Array) -> None:
        """Torque of a virtual spring and damper (I5; source Fig. 2, second row).

        tau = tau_ff + k·(q_ref − q) − d·q̇, bounded by the joint's torque; where the law is
        TORQUE, k and d are zero and tau_ff is the torque asked for.
        """
        state, a, tau = self._state, self._a, self._b
        np.multiply(self._stiffness, error, out=tau)
        np.multiply(self._damping, state.velocity, out=a)
        np.subtract(tau, a, out=tau)
        np.add(tau, self._torque_base, out=tau)
        np.minimum(tau, self.max_torque, out=tau)
        np.maximum(tau, self._min_torque, out=state.torque_reference)

    def _track_current(self, reference: Array) -> None:
        """The inner loop of a board with current output (P10).

        v = R·i_ref + Ke·q̇ + PI(i_ref − i), as PWM in percent.
        """
        state, a, b, c = self._state, self._a, self._b, self._c
        np.subtract(reference, state.current, out=a)
        a2 = a[None, :]
        self.current.step(a2, a2, b[None, :])
        np.multiply(self._ohms, reference, out=c)
        np.add(b, c, out=b)
        np.multiply(self._emf, state.velocity, out=c)
        np.add(b, c, out=b)
        np.multiply(b, self._percent_per_volt, out=b)
        np.minimum(b, self._max_pwm, out=c)
        np.maximum(c, self._min_pwm, out=state.output)
        if b.tobytes() != state.output.tobytes():
            self.current.unwind(b - state.output, a2)
        if self._bypassed.size:
            state.output[self._bypassed] = reference[self._bypassed]
            self.current.integral[0, self._bypassed] = 0.0

    def _guard(self, output: Array) -> None:
        """The protection at the limits, where no position loop keeps them (P9), in place.

        Towards a software limit the torque that may drive the joint further out falls to zero
        over GUARD_ZONE; beyond it a virtual spring and damper pushes the joint back. Beyond the
        speed limit the output may not drive it faster.
        """
        state, inside, speed = self._state, self._a, self._b
        np.maximum(state.position, self._guard_lower, out=inside)
        np.minimum(inside, self._guard_upper, out=inside)
        np.absolute(state.velocity, out=speed)
        np.less_equal(speed, self._max_velocity, out=self._calm)
        if inside.tobytes() != state.position.tobytes() or b"\0" in self._calm.tobytes():
            for j, law in enumerate(self.laws):
                if law in GUARDED and state.calibrated[j]:
                    self._guard_joint(j, output, float(state.position[j] - inside[j]))
        elif True in self.on_limit:
            self.on_limit = [False] * state.n

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

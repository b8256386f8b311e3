# SPDX-License-Identifier: Apache-2.0
"""The checks of every cycle that raise hardware faults (SPEC F1, F3).

What is measured is compared, as one block, with bounds of the same shape. NaN fails every
comparison, so a broken sensor shows by itself. What changes slowly, or adds up over time (I²t,
the travel of encoder against motor, the hard limits), is looked at every SLOW cycles.

The motor's own travel follows from its equation V = R i + L di/dt + Ke ω, integrated over the
cycles k of period T since the last look, with the currents i_k read at their ends::

    Ke Δq = T Σ V_k − R T Σ i_k − (L − w R T) (i_last − i_first)

w is the weight of a cycle's first current in its mean, exact for a winding that settles
exponentially, mean i = w i_(k−1) + (1−w) i_k: with x = R T/L and a = exp(−x),
w = (1−a)/x − a/(1−a) (1 − (1−a)/x); 1/2 where T is short against L/R, 0 where it is long.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .config import BoardConfig, JointConfig
from .faults import FaultCode
from .heat import STRAINED, Heat
from .measurement import ROWS, Array, Row
from .parts import DEGREE
from .state import Joints, State

#: Cycles from one look at the slow checks to the next.
SLOW = 8

#: Time constant of the forgetting of travel errors, s.
TRAVEL_MEMORY = 0.5

#: What a reading may jump in a cycle beyond four times the speed limit.
JUMP_RADIANS, JUMP_METRES = 0.5 * DEGREE, 1e-3

#: Encoder and current are sampled so far apart at most, s. A reversal at full speed makes a
#: travel error of twice the speed for that time; in simulation it is the physics step.
APART = 1e-3


class Check(IntEnum):
    """Rows of the slow checks."""

    TRAVEL = 0
    OVERLOAD = 1
    OVERRUN = 2


class Cause(NamedTuple):
    """Why a joint must be in HW_FAULT: the code, what was measured against what, the way out."""

    code: FaultCode
    text: str
    advice: str = "remove it"


#: Codes in the order in which a cause is looked for: first the bounds, then the slow checks.
_BOUNDS = {
    Row.ALARM: FaultCode.EXTERNAL,
    Row.CURRENT: FaultCode.OVERCURRENT,
    Row.ENCODER_AGE: FaultCode.ENCODER_SILENT,
    Row.POSITION: FaultCode.ENCODER_SPIKE,
    Row.VELOCITY: FaultCode.ENCODER_INVALID,
    Row.TORQUE_AGE: FaultCode.TORQUE_SENSOR,
    Row.TORQUE: FaultCode.TORQUE_SENSOR,
    Row.TEMPERATURE: FaultCode.OVERHEATING,
}
_CHECKS = {
    Check.TRAVEL: FaultCode.ENCODER_MISMATCH,
    Check.OVERRUN: FaultCode.HARD_LIMIT,
    Check.OVERLOAD: FaultCode.I2T,
}


class Watch:
    """Watches n joints.

    Attributes: travelled (by each motor since power-on as its own equation tells
    while its bridge is on, shape (n,), rad; grows every SLOW cycles), heat (I²t, and warnings).
    """

    def __init__(self, config: BoardConfig, state: State) -> None:
        n = state.n
        self._period = config.period
        self._lower = np.full((ROWS, n), -np.inf)
        self._upper = np.full((ROWS, n), np.inf)
        self._above = np.ones((ROWS, n), dtype=bool)
        self._below = np.ones((ROWS, n), dtype=bool)
        self._jump = np.full(n, np.inf)
        self._slow = np.zeros((len(Check), n))
        self._slow_limit = np.full((len(Check), n), np.inf)
        self._slow_good = np.ones((len(Check), n), dtype=bool)
        self._driven = np.zeros((2, n))  # sums of current and output since the last slow look
        self._mark = np.zeros(n)  # encoder reading where the sums begin
        self._first = np.zeros(n)  # current where they begin
        self._middle = np.zeros(n)
        self._live = np.zeros(n)
        self._switched, self._any_switched = np.zeros(n, dtype=bool), False
        self._countdown = SLOW
        self._forget = math.exp(-SLOW * config.period / TRAVEL_MEMORY)
        self._values = np.zeros((ROWS, n))
        self.travelled: Array = np.zeros(n)
        self.heat = Heat(config, self._slow[Check.OVERLOAD])
        self.reconfigure(config)

    def reconfigure(self, config: BoardConfig) -> None:
        """Take new limits; what has been watched so far is kept."""
        self._joints = config.joints
        motors = [joint.motor for joint in config.joints]
        emf = np.array([motor.back_emf for motor in motors])
        volts = np.array([motor.supply_voltage for motor in motors]) / 100.0
        ohms = np.array([motor.resistance for motor in motors])
        self._travel_per_output = volts / emf * self._period
        self._travel_per_current = ohms / emf * self._period
        henries = np.array([motor.inductance for motor in motors])
        weight = first_weight(ohms * self._period / henries)
        self._travel_per_change = (henries - weight * ohms * self._period) / emf
        self.heat.reconfigure(config)
        self._tables = (np.full_like(self._lower, -np.inf), np.full_like(self._upper, np.inf))
        self._slow_table = np.full_like(self._slow_limit, np.inf)
        self._jump_table = np.zeros(len(motors))
        for j, joint in enumerate(config.joints):
            self._tabulate(j, joint)

    def _tabulate(self, j: int, joint: JointConfig) -> None:
        limits = joint.limits
        lower, upper, slow = (table[:, j] for table in (*self._tables, self._slow_table))
        upper[Row.CURRENT], lower[Row.CURRENT] = limits.peak_current, -limits.peak_current
        upper[Row.TEMPERATURE] = limits.temperature
        upper[Row.ENCODER_AGE] = joint.timeouts.encoder
        upper[Row.ALARM] = 0.0
        if joint.torque_sensor:
            upper[Row.TORQUE_AGE] = joint.timeouts.torque_sensor
            upper[Row.TORQUE], lower[Row.TORQUE] = 100.0 * limits.torque, -100.0 * limits.torque
        slack = JUMP_METRES if joint.kind == "prismatic" else JUMP_RADIANS
        self._jump_table[j] = 4.0 * limits.velocity * self._period + slack
        slow[Check.TRAVEL] = joint.max_travel_error + 2.0 * limits.velocity * APART
        slow[Check.OVERLOAD] = self.heat.budget[j]
        low, high = limits.hard_lower, limits.hard_upper
        self._middle[j] = 0.5 * (low + high) if math.isfinite(high - low) else 0.0
        slow[Check.OVERRUN] = 0.5 * (high - low) + limits.hard_margin

    def arm(self, joints: Joints, *, on: bool, calibrated: NDArray[np.bool_]) -> None:
        """Set the limits of joints, or none while they are not configured (N1).

        The hard limits are known of those only that are calibrated (a flag per joint).
        """
        if not on:
            self._lower[:, joints], self._upper[:, joints] = -np.inf, np.inf
            self._jump[joints], self._slow_limit[:, joints] = np.inf, np.inf
            return
        self._lower[:, joints] = self._tables[0][:, joints]
        self._upper[:, joints] = self._tables[1][:, joints]
        self._jump[joints] = self._jump_table[joints]
        self._slow_limit[:, joints] = self._slow_table[:, joints]
        for j, known in enumerate(calibrated):
            if not known:
                self._slow_limit[Check.OVERRUN, j] = np.inf

    def power(self, joints: Joints, powered: Array) -> None:
        """Say which bridges are on: only then does a motor tell its speed.

        Until the next reading, the motors still run with what they were given before.

        Args:
            joints: whose power may have changed.
            powered: of all joints, shape (n,).
        """
        self._live[:] = powered
        self._switched[joints] = self._any_switched = True

    def let_cool(self, j: int, code: FaultCode) -> None:
        """After a fault by heat the joint must cool some way below the limit, not just to it."""
        limits = self._joints[j].limits
        if code is FaultCode.OVERHEATING:
            cool = limits.temperature - limits.temperature_hysteresis
            self._upper[Row.TEMPERATURE, j] = cool
        elif code is FaultCode.I2T:
            self._slow_limit[Check.OVERLOAD, j] = STRAINED * self.heat.budget[j]

    def healthy(self, state: State, values: Array) -> bool:
        """Watch one reading; false when any joint has a cause to be in HW_FAULT.

        Args:
            state: with the new measurement in its block and the last output still in force.
            values: the measurement as read, no offset taken off, shape (ROWS, n).
        """
        self._values = values
        np.greater_equal(values, self._lower, self._above)
        np.less_equal(values, self._upper, self._below)
        fine = b"\0" not in self._above.tobytes() and b"\0" not in self._below.tobytes()
        # The next reading may be at most a jump away from this one.
        np.subtract(values[0], self._jump, self._lower[0])
        np.add(values[0], self._jump, self._upper[0])
        np.add(self._driven, state.drive, self._driven)
        if self._any_switched:
            self._restart(values)
        self._countdown -= 1
        if self._countdown == 0:
            self._countdown = SLOW
            self._look(state, values)
        return fine and b"\0" not in self._slow_good.tobytes()

    def _restart(self, values: Array) -> None:
        """Compare motor and encoder of joints that were switched from this reading on."""
        np.copyto(self._mark, values[Row.POSITION], where=self._switched)
        np.copyto(self._first, values[Row.CURRENT], where=self._switched)
        self._driven[:, self._switched] = 0.0
        self._switched[:] = self._any_switched = False

    def _look(self, state: State, values: Array) -> None:
        """The slow checks."""
        current, output = self._driven
        travelled = self._travel_per_output * output - self._travel_per_current * current
        travelled -= self._travel_per_change * (values[Row.CURRENT] - self._first)
        travelled *= self._live
        self._first[:] = values[Row.CURRENT]
        self.travelled += travelled
        self._driven[:] = 0.0
        travel, _, overrun = self._slow
        # Travel of the motor against travel of the encoder, forgetting slowly.
        travel *= self._forget
        travel += travelled - (values[Row.POSITION] - self._mark) * self._live
        self._mark[:] = values[Row.POSITION]
        self.heat.look(state.current, self._live, values[Row.TEMPERATURE], SLOW * self._period)
        np.subtract(state.position, self._middle, overrun)
        np.less_equal(np.abs(self._slow), self._slow_limit, self._slow_good)

    def causes(self) -> dict[int, Cause]:
        """The joints that the last reading found unhealthy, each with its first cause."""
        found = {}
        good = (self._above & self._below).all(axis=0) & self._slow_good.all(axis=0)
        for j in np.flatnonzero(~good):
            cause = self.cause(int(j))
            if cause is not None:
                found[int(j)] = cause
        return found

    def cause(self, j: int) -> Cause | None:
        """What the last reading found wrong with a joint; None when nothing (F3)."""
        for row, code in _BOUNDS.items():
            if not (self._above[row, j] and self._below[row, j]):
                return self._describe_bound(row, code, j)
        for check, code in _CHECKS.items():
            if not self._slow_good[check, j]:
                return self._describe_check(check, code, j)
        return None

    def forget(self, j: int) -> None:
        """Start the watching of a joint's encoder afresh: without power nothing can be told of it.

        The reading that raised a fault may have been wrong in what the motor's travel is made of.
        """
        self._slow[Check.TRAVEL, j] = 0.0
        self._slow_good[Check.TRAVEL, j] = True

    def mend(self, state: State, last: Array) -> None:
        """Replace what is not a number by the last good reading; it must not spread.

        Args:
            state: its block holds the new reading.
            last: the measured rows of the reading before, shape (ROWS, n).
        """
        broken = ~np.isfinite(state.measured)
        state.measured[broken] = last[broken]
        lost = ~np.isfinite(self._values[Row.POSITION])
        self._lower[Row.POSITION, lost], self._upper[Row.POSITION, lost] = -np.inf, np.inf
        lost = ~np.isfinite(self._mark)
        self._mark[lost] = (state.position + state.offset)[lost]
        lost = ~np.isfinite(self._slow)
        self._slow[lost], self._slow_good[lost] = 0.0, True
        self._driven[~np.isfinite(self._driven)] = 0.0
        self._first[~np.isfinite(self._first)] = 0.0

    def _describe_bound(self, row: Row, code: FaultCode, j: int) -> Cause:
        value, limit = float(self._values[row, j]), float(self._upper[row, j])
        unit, torque_unit = self._units(j)
        if not math.isfinite(value) and row in (Row.POSITION, Row.VELOCITY):
            return Cause(FaultCode.ENCODER_INVALID, "the reading is not a number")
        if row is Row.ALARM:
            return _alarm(value)
        texts = {
            Row.CURRENT: f"{abs(value):.3g} A > {limit:.3g} A",
            Row.ENCODER_AGE: f"no sample for {value * 1e3:.0f} ms > {limit * 1e3:.0f} ms",
            Row.POSITION: f"the reading jumped by more than {self._jump[j]:.3g} {unit} in a cycle",
            Row.VELOCITY: "the velocity is not a number",
            Row.TORQUE_AGE: f"no sample for {value * 1e3:.0f} ms > {limit * 1e3:.0f} ms",
            Row.TORQUE: f"reads {value:.3g} {torque_unit}, out of its range",
            Row.TEMPERATURE: f"winding at {value:.0f} °C > {limit:.0f} °C",
        }
        if row is Row.TEMPERATURE:
            return Cause(code, texts[row], self.heat.cooling_advice(j, value, limit))
        return Cause(code, texts[row])

    def _describe_check(self, check: Check, code: FaultCode, j: int) -> Cause:
        value, limit = abs(float(self._slow[check, j])), float(self._slow_limit[check, j])
        unit, _ = self._units(j)
        limits = self._joints[j].limits
        past = value - limit + limits.hard_margin
        texts = {
            Check.TRAVEL: f"encoder and motor disagree by {value:.3g} {unit} > {limit:.3g} "
            f"{unit}: frozen, slipping or reversed",
            Check.OVERRUN: f"{past:.3g} {unit} beyond the hard stop > "
            f"{limits.hard_margin:.3g} {unit}",
            Check.OVERLOAD: f"more than {limits.nominal_current:.3g} A nominal for too long "
            f"(I2t: {limits.overload_time:.3g} s at peak)",
        }
        if check is Check.OVERLOAD:
            return Cause(code, texts[check], self.heat.overload_advice(j, SLOW * self._period))
        return Cause(code, texts[check])

    def _units(self, j: int) -> tuple[str, str]:
        return ("m", "N") if self._joints[j].kind == "prismatic" else ("rad", "N·m")


def first_weight(ratio: Array) -> Array:
    """Weight of the first current in a cycle's mean, of R T/L; see the module's text."""
    settled = -np.expm1(-ratio)  # 1 − a
    mean = settled / ratio
    weight = mean - (1.0 - settled) / settled * (1.0 - mean)
    return np.where(ratio < 1e-3, 0.5 - ratio / 12.0, weight)


def _alarm(value: float) -> Cause:
    """What the hardware raises by itself: 1 + a fault code."""
    alarm = int(value) - 1 if math.isfinite(value) else 0
    code = FaultCode(alarm) if alarm in set(FaultCode) else FaultCode.EXTERNAL
    texts = {
        FaultCode.EXTERNAL: "the external fault line is active (emergency stop)",
        FaultCode.DIVERGED: "the simulation diverged; its last good state is back",
    }
    return Cause(code, texts.get(code, "raised by the hardware"))

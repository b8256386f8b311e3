# SPDX-License-Identifier: Apache-2.0
"""The checks of every cycle that raise hardware faults (SPEC F1, F3).

All checks are one comparison: a block of watched quantities against a block of limits of the
same shape. NaN fails every comparison, so a broken sensor shows by itself.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from .config import BoardConfig, JointConfig
from .faults import FaultCode
from .measurement import Array, Row
from .state import State

#: Time constant of the forgetting of travel errors, s.
TRAVEL_MEMORY = 0.5


class Check(IntEnum):
    """Rows of the watched block; the first five are rows CURRENT to ALARM of a measurement."""

    CURRENT = 0
    TEMPERATURE = 1
    ENCODER_AGE = 2
    TORQUE_AGE = 3
    ALARM = 4
    TORQUE = 5
    OVERRUN = 6
    JUMP = 7
    TRAVEL = 8
    OVERLOAD = 9


class Cause(NamedTuple):
    """Why a joint must be in HW_FAULT: the code, and what was measured against what."""

    code: FaultCode
    text: str


_CODES = {
    Check.ALARM: FaultCode.EXTERNAL,
    Check.CURRENT: FaultCode.OVERCURRENT,
    Check.ENCODER_AGE: FaultCode.ENCODER_SILENT,
    Check.JUMP: FaultCode.ENCODER_SPIKE,
    Check.TRAVEL: FaultCode.ENCODER_MISMATCH,
    Check.TORQUE_AGE: FaultCode.TORQUE_SENSOR,
    Check.TORQUE: FaultCode.TORQUE_SENSOR,
    Check.OVERRUN: FaultCode.HARD_LIMIT,
    Check.OVERLOAD: FaultCode.I2T,
    Check.TEMPERATURE: FaultCode.OVERHEATING,
}


class Watch:
    """Watches n joints. ``healthy(state)`` is the whole work of a good cycle."""

    def __init__(self, config: BoardConfig, state: State) -> None:
        n = state.n
        self._period = config.period
        self._watched = np.zeros((len(Check), n))
        self._limits = np.full((len(Check), n), np.inf)
        self._magnitude = np.zeros((len(Check), n))
        self._good = np.ones((len(Check), n), dtype=bool)
        self._raw = np.zeros(n)
        self._seen = False
        self._scratch = np.empty(n)
        self._middle = np.zeros(n)
        self._last_current = np.zeros(n)
        self._live = np.zeros(n)
        self._forget = 1.0 - config.period / TRAVEL_MEMORY
        self.reconfigure(config)

    def reconfigure(self, config: BoardConfig) -> None:
        """Take new limits; what has been watched so far is kept."""
        self._joints = config.joints
        motors = [joint.motor for joint in config.joints]
        nominal = np.array([joint.limits.nominal_current for joint in config.joints])
        self._nominal_squared = nominal**2
        # Speed from the motor's own equation, V = R·i + L·di/dt + Ke·ω, times the period.
        emf = np.array([motor.back_emf for motor in motors])
        volts = np.array([motor.supply_voltage for motor in motors]) / 100.0
        half_ohms = np.array([motor.resistance for motor in motors]) / 2.0
        henries = np.array([motor.inductance for motor in motors]) / self._period
        self._per_output = volts / emf * self._period
        self._per_current = (half_ohms + henries) / emf * self._period
        self._per_last_current = (half_ohms - henries) / emf * self._period
        self.travelled: Array = np.zeros(len(motors))  # by the motor, last period, rad

    def arm(self, j: int, joint: JointConfig, *, on: bool, calibrated: bool) -> None:
        """Set the limits of one joint, or none while it is not configured (N1)."""
        limits, column = joint.limits, self._limits[:, j]
        column[:] = np.inf
        if not on:
            return
        peak, nominal = limits.peak_current, limits.nominal_current
        column[Check.CURRENT] = peak
        column[Check.TEMPERATURE] = limits.temperature
        column[Check.ENCODER_AGE] = joint.timeouts.encoder
        if joint.torque_sensor:
            column[Check.TORQUE_AGE] = joint.timeouts.torque_sensor
            column[Check.TORQUE] = 100.0 * limits.torque
        column[Check.ALARM] = 0.0
        column[Check.JUMP] = 4.0 * limits.velocity * self._period + math.radians(0.5)
        column[Check.TRAVEL] = joint.max_travel_error
        column[Check.OVERLOAD] = (peak**2 - nominal**2) * limits.overload_time / self._period
        if calibrated:
            lower, upper = limits.hard_lower, limits.hard_upper
            self._middle[j] = 0.5 * (lower + upper) if math.isfinite(upper - lower) else 0.0
            column[Check.OVERRUN] = 0.5 * (upper - lower) + limits.hard_margin

    def power(self, j: int, powered: float) -> None:
        """Say whether the bridge of a joint is on: only then does its motor tell its speed."""
        self._live[j] = powered

    def cool_down(self, j: int, joint: JointConfig, *, faulted: bool) -> None:
        """After an over-temperature fault the winding must cool by the hysteresis."""
        limits = joint.limits
        margin = limits.temperature_hysteresis if faulted else 0.0
        self._limits[Check.TEMPERATURE, j] = limits.temperature - margin

    def healthy(self, state: State, raw: Array) -> bool:
        """Watch one reading; false when any joint has a cause to be in HW_FAULT.

        Args:
            state: with the new measurement in its block and the last output still in force.
            raw: the encoder readings, shape (n,), rad.
        """
        w, scratch, current = self._watched, self._scratch, state.current
        if not self._seen:
            self._raw[:], self._seen = raw, True
        w[:5] = state.block[Row.CURRENT : Row.ALARM + 1]
        w[Check.TORQUE] = state.torque
        np.subtract(state.position, self._middle, out=w[Check.OVERRUN])
        jump = w[Check.JUMP]
        np.subtract(raw, self._raw, out=jump)
        self._raw[:] = raw
        # Travel of the motor against travel of the encoder, forgetting slowly.
        travelled = self.travelled
        np.multiply(state.output, self._per_output, out=travelled)
        np.multiply(current, self._per_current, out=scratch)
        np.subtract(travelled, scratch, out=travelled)
        np.multiply(self._last_current, self._per_last_current, out=scratch)
        np.subtract(travelled, scratch, out=travelled)
        self._last_current[:] = current
        travel = w[Check.TRAVEL]
        np.multiply(travel, self._forget, out=travel)
        np.subtract(travelled, jump, out=scratch)
        np.multiply(scratch, self._live, out=scratch)
        np.add(travel, scratch, out=travel)
        # I²t: what is above nominal adds up, what is below lets it go.
        overload = w[Check.OVERLOAD]
        np.multiply(current, current, out=scratch)
        np.subtract(scratch, self._nominal_squared, out=scratch)
        np.add(overload, scratch, out=overload)
        np.maximum(overload, 0.0, out=overload)
        np.absolute(w, out=self._magnitude)
        np.less_equal(self._magnitude, self._limits, out=self._good)
        return b"\0" not in self._good.tobytes()

    def causes(self) -> dict[int, Cause]:
        """The joints that the last reading found unhealthy, each with its first cause."""
        found = {}
        for j in np.flatnonzero(~self._good.all(axis=0)):
            cause = self.cause(int(j))
            if cause is not None:
                found[int(j)] = cause
        return found

    def cause(self, j: int) -> Cause | None:
        """What the last reading found wrong with a joint; None when nothing (F3)."""
        for check, code in _CODES.items():
            if not self._good[check, j]:
                return self._describe(check, code, j)
        return None

    def forget(self, j: int) -> None:
        """Start the watching of a joint's encoder afresh, as when a fault is cleared."""
        self._watched[Check.TRAVEL, j] = 0.0
        self._good[:, j] = True

    def mend(self, state: State, last: Array) -> None:
        """Replace what is not a number by the last good reading; it must not spread.

        Args:
            state: its block holds the new reading.
            last: the measured rows of the reading before, shape (ROWS, n).
        """
        broken = ~np.isfinite(state.measured)
        state.measured[broken] = last[broken]
        lost = ~np.isfinite(self._raw)
        self._raw[lost] = state.position[lost] + state.offset[lost]
        memory = self._watched[Check.TRAVEL :]
        memory[~np.isfinite(memory)] = 0.0
        self._last_current[:] = state.current

    def _describe(self, check: Check, code: FaultCode, j: int) -> Cause:
        value = float(self._magnitude[check, j])
        limit = float(self._limits[check, j])
        joint = self._joints[j]
        unit, torque_unit = ("m", "N") if joint.kind == "prismatic" else ("rad", "N·m")
        match check:
            case Check.ALARM:
                alarm = int(value) - 1 if math.isfinite(value) else 0
                code = FaultCode(alarm) if alarm in set(FaultCode) else FaultCode.EXTERNAL
                text = {
                    FaultCode.EXTERNAL: "the external fault line is active (emergency stop)",
                    FaultCode.DIVERGED: "the simulation diverged; its last good state is back",
                }.get(code, "raised by the hardware")
            case Check.CURRENT:
                text = f"{value:.3g} A > {limit:.3g} A"
            case Check.ENCODER_AGE:
                text = f"no sample for {value * 1e3:.0f} ms > {limit * 1e3:.0f} ms"
            case Check.JUMP if not math.isfinite(value):
                code, text = FaultCode.ENCODER_INVALID, "the reading is not a number"
            case Check.JUMP:
                text = f"a step of {value:.3g} {unit} in one cycle > {limit:.3g} {unit}"
            case Check.TRAVEL:
                text = (
                    f"encoder and motor disagree by {value:.3g} {unit} > {limit:.3g} {unit}: "
                    "frozen, slipping or reversed"
                )
            case Check.TORQUE_AGE:
                text = f"no sample for {value * 1e3:.0f} ms > {limit * 1e3:.0f} ms"
            case Check.TORQUE:
                text = f"reads {value:.3g} {torque_unit}, out of its range"
            case Check.OVERRUN:
                past = value - limit + joint.limits.hard_margin
                margin = joint.limits.hard_margin
                text = f"{past:.3g} {unit} beyond the hard stop > {margin:.3g} {unit}"
            case Check.OVERLOAD:
                text = (
                    f"more than {joint.limits.nominal_current:.3g} A nominal for too long "
                    f"(I2t budget {joint.limits.overload_time:.3g} s at peak)"
                )
            case Check.TEMPERATURE:
                text = f"winding at {value:.0f} °C > {limit:.0f} °C"
        return Cause(code, text)

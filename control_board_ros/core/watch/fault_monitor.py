# SPDX-License-Identifier: Apache-2.0
"""What raises hardware faults (SPEC F1): limits, and when they are in force.

The checks themselves are in ``monitor``, one joint at a time; their causes in words in ``causes``.

The motor's own travel needs w, the weight of a cycle's first current in its mean, exact for a
winding that settles exponentially, mean i = w i_(k−1) + (1−w) i_k: with x = R T/L and a = exp(−x),
w = (1−a)/x − a/(1−a) (1 − (1−a)/x); 1/2 where T is short against L/R, 0 where it is long.

An emergency stop (E2) stops all joints in the next cycle, as a fault that the hardware raises;
a plant's own input is an ALARM of its readings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...text import clean
from ..config.config import BoardConfig, JointConfig
from ..config.parts import DEGREE
from ..state import StateArrays
from ..terms.arguments import Array
from ..terms.faults import Cause, FaultCode
from ..terms.measurement import CREDIBLE, ROWS, Row
from .causes import (
    I2T_WARNING_SHARE,
    ROWS_OF,
    Check,
    alarm_cause,
    bound_cause,
    heat_constants,
    slow_cause,
    warnings,
)
from .monitor import JointMonitor, Monitor

#: Sources of a stop, a program or the silence of the heartbeat: cause and remedy.
REQUESTED_STOP = ("requested", "release it")
HEARTBEAT_SILENCE = ("no heartbeat for {:g} s", "it must come again")


class EmergencyStop:
    """Active while any source requests it.

    Args:
        timeout: Silence of the heartbeat that is a stop, s; 0: no heartbeat is expected.

    Attributes: holds (whether it was active at the last reading), timeout.
    """

    def __init__(self, timeout: float) -> None:
        self.timeout = timeout
        self.holds = False
        self._causes: set[tuple[str, str]] = set()
        self._last_beat: float | None = None

    @property
    def reason(self) -> tuple[str, str]:
        """Cause and remedy."""
        reasons = sorted(self._causes)
        why, way_out = (" and ".join(texts) for texts in zip(*reasons, strict=True))
        return why.format(self.timeout), way_out

    def ask(self, stop: bool) -> None:
        """Request it, or release the request."""
        self._note(REQUESTED_STOP, stop)

    def beat(self, time: float) -> None:
        """Record a heartbeat, at a time of the board, s."""
        self._last_beat = time

    def watch(self, time: float) -> None:
        """Check the silence at the time of a reading, s."""
        if self.timeout > 0.0:
            if self._last_beat is None:  # the first reading: silence counts from now on
                self._last_beat = time
            self._note(HEARTBEAT_SILENCE, time - self._last_beat > self.timeout)

    def _note(self, cause: tuple[str, str], holds: bool) -> None:
        if holds:
            self._causes.add(cause)
        else:
            self._causes.discard(cause)
        self.holds = bool(self._causes)


#: Cycles from one slow check to the next.
SLOW_CHECK_CYCLES = 8

#: Time constant of the forgetting of travel errors, s.
TRAVEL_MEMORY = 0.5

#: What a reading may jump in a cycle, off the motion of the cycle before, beyond four times the
#: speed limit, or, up to the motor's no-load speed, what twice the torque limit makes of the least
#: inertia.
JUMP_RADIANS, JUMP_METRES = 0.5 * DEGREE, 1e-3

#: Encoder and current are sampled so far apart at most, s. A reversal at full speed makes a
#: travel error of twice the speed for that time; in simulation it is the physics step.
SAMPLING_OFFSET = 1e-3

#: Measured speed that is a fault, in speed limits (F7).
OVERSPEED = 1.5


class FaultMonitor:
    """Finds the causes of hardware faults in the readings of n joints.

    Attributes: joints (of JointMonitor), monitor, take (stores a reading in the state), used (part
    of the I²t budget, shape (n,); a fault above 1), reasons (of alarms, by joint, where the plant
    has more than its code).
    """

    def __init__(self, config: BoardConfig, state: StateArrays, emergency: EmergencyStop) -> None:
        self._state = state
        self._period = config.period
        self._values = np.zeros((ROWS, state.n))
        self._before = state.measured.copy()
        self.used: Array = np.zeros(state.n)
        self.joints = [JointMonitor() for _ in config.joints]
        self.reasons: Mapping[int, str] | None = None
        self._emergency = emergency
        self._warned: list[set[str]] = [set() for _ in config.joints]
        rows = (
            state.position,
            state.current,
            state.output,
            state.applied,
            state.travelled,
            self.used,
        )
        self._movers, self._fed = movers_of(config), b""
        self.monitor = Monitor(
            self.joints,
            [self._values, state.measured, self._before, state.motors],
            [self._values[row].data for row in ROWS_OF.values()],
            [row.data for row in rows],
            SLOW_CHECK_CYCLES,
            config.period,
            math.exp(-SLOW_CHECK_CYCLES * config.period / TRAVEL_MEMORY),
        )
        self.take = self.monitor.take
        self._configs = config.joints
        self._limits: list[dict[str, float]] = [{}] * state.n
        self._cooling: dict[int, FaultCode] = {}  # joints that a power-on found too hot
        self.power_on(range(state.n))

    def power_on(self, joints: Sequence[int]) -> None:
        """Restart the monitors of joints (N1); heat is kept (F6)."""
        for j in joints:
            before, monitor = self.joints[j], JointMonitor()
            if before.overload > before.max_overload:
                self._cooling[j] = FaultCode.I2T
            elif before.temperature > before.max_temperature:
                self._cooling[j] = FaultCode.OVERHEATING
                monitor.temperature = before.temperature
            monitor.overload = before.overload
            monitor.set(UNLIMITED)
            self.joints[j], self._warned[j] = monitor, set()
            self._configure(j)

    def reconfigure(self, config: BoardConfig) -> None:
        """Apply new constants; the history is kept.

        The limits come into force by ``arm`` or ``bound``. Joints whose configuration is as before
        are left alone.
        """
        before, self._configs = self._configs, config.joints
        for j, joint in enumerate(config.joints):
            if joint != before[j]:
                self._configure(j)

    def _configure(self, j: int) -> None:
        joint = self._configs[j]
        self.joints[j].set(travel_constants(joint, self._period))
        self.joints[j].set(heat_constants(joint.limits))
        self._limits[j] = checked_limits(joint, self._period)

    def arm(self, joints: Sequence[int], *, on: bool, calibrated: NDArray[np.bool_]) -> None:
        """Set the limits of joints, or none while they are not configured (N1).

        The hard limits are known of those only that are calibrated (a flag per joint).
        """
        for j in joints:
            self.set_limits(j, on=on, calibrated=bool(calibrated[j]))
            self.joints[j].expect_anything()

    def set_limits(self, j: int, *, on: bool, calibrated: bool) -> None:
        """As :meth:`arm`, without a restart of the checks: no reading is left out."""
        self.joints[j].set(self._limits[j] if on else UNLIMITED)
        if on and j in self._cooling:
            self.let_cool(j, self._cooling.pop(j))
        if not calibrated:
            self.joints[j].max_overrun = math.inf

    def power(self, joints: Sequence[int], powered: Array) -> None:
        """Set which bridges are on: only then does a motor show its speed.

        Until the next reading, the motors still run with what they were given before.

        Args:
            joints: whose power may have changed.
            powered: of all joints, shape (n,).
        """
        for j in joints:
            joint, on = self.joints[j], float(powered[j])
            joint.live = joint.fed = on
            joint.switched, joint.since, self._fed = True, 0.0, b""

    def set_supplied(self, powered: Array) -> None:
        """Set which bridges of coupled motors are on, whatever the power of their axes."""
        if (fed := powered.tobytes()) != self._fed:
            self._fed = fed
            for joint, on in zip(self.joints, powered.tolist(), strict=True):
                joint.fed = on

    def let_cool(self, j: int, code: FaultCode) -> None:
        """After a fault by heat the joint must cool some way below the limit, not just to it."""
        monitor, limits = self.joints[j], self._configs[j].limits
        if code is FaultCode.OVERHEATING:
            monitor.max_temperature = limits.temperature - limits.temperature_hysteresis
        elif code is FaultCode.I2T:
            monitor.max_overload = I2T_WARNING_SHARE * monitor.budget

    def healthy(self) -> bool:
        """Watch the reading; false when any joint has a cause to be in HW_FAULT.

        The last output is still in force.
        """
        if self._emergency.holds:
            self._values[Row.ALARM] = 1.0 + FaultCode.EMERGENCY_STOP
        healthy: bool = self.monitor.step(self._state.periods)
        return healthy

    def unhealthy(self) -> list[int]:
        """The joints that the last reading found to have a cause to be in HW_FAULT."""
        faulty = {j for j, monitor in enumerate(self.joints) if monitor.failed()}
        faulty |= {j for j in self._movers if self._failed_mover(j) is not None}
        return sorted(faulty)

    def _failed_mover(self, j: int) -> int | None:
        """Another motor that moves a joint and has failed (Y3)."""
        for k in self._movers.get(j, ()):
            if self.joints[k].failed() in OF_MOTORS:
                return k
        return None

    def cause(self, j: int) -> Cause | None:
        """The cause of a fault in a joint's last reading; None: there is none (F3)."""
        monitor, joint = self.joints[j], self._configs[j]
        failed = monitor.failed()
        if not failed:
            if (k := self._failed_mover(j)) is None:
                return None
            cause = self.cause(k)
            name = self._configs[k].name
            return cause and cause._replace(text=f"the motor of {name}: {cause.text}")
        check = Check(failed)
        if check is Check.ALARM and self._emergency.holds:
            return Cause(FaultCode.EMERGENCY_STOP, *self._emergency.reason)
        if check is Check.ALARM and self.reasons and j in self.reasons:
            value = float(self._values[ROWS_OF[check], j])
            return alarm_cause(value)._replace(text=clean(self.reasons[j]))
        if check in ROWS_OF:
            return bound_cause(check, monitor, joint, float(self._values[ROWS_OF[check], j]))
        return slow_cause(check, monitor, joint, SLOW_CHECK_CYCLES * self._period)

    def stop(self, j: int) -> Cause | None:
        """The emergency stop that holds, also of a joint that is not configured (E2)."""
        if self._emergency.holds:
            return Cause(FaultCode.EMERGENCY_STOP, *self._emergency.reason)
        alarm = float(self._values[Row.ALARM, j])
        return alarm_cause(alarm) if alarm == 1.0 + FaultCode.EMERGENCY_STOP else None

    def has_news(self) -> bool:
        """Whether a joint has approached a fault by heat since the last call (F6)."""
        news = bool(self.monitor.news)
        self.monitor.news = False
        return news

    def warnings(self, j: int) -> dict[str, str]:
        """The warnings of a joint that are new since the last call (F6)."""
        texts = warnings(self.joints[j])
        new = {key: text for key, text in texts.items() if key not in self._warned[j]}
        self._warned[j] = set(texts)
        return new

    def forget(self, j: int) -> None:
        """Restart the check of a joint's encoder, which is not observable without power.

        The reading that raised a fault may have been wrong in a component of the motor's travel.
        """
        self.joints[j].forget_travel()

    def replace_broken(self) -> None:
        """Replace invalid values by the last valid reading, before the laws read them."""
        measured = self._state.measured
        np.copyto(measured, self._before, where=~(np.abs(measured) <= CREDIBLE))


#: Faults of a motor, which are faults of every axis that it moves.
OF_MOTORS = (Check.ALARM, Check.CURRENT, Check.TEMPERATURE, Check.OVERLOAD)


def movers_of(config: BoardConfig) -> dict[int, list[int]]:
    """The other motors that move each joint, of those that have any."""
    if config.motor_coupling is None:
        return {}
    shares = config.motor_coupling.matrix != 0.0
    np.fill_diagonal(shares, False)
    return {j: np.flatnonzero(row).tolist() for j, row in enumerate(shares.T) if row.any()}


def travel_constants(joint: JointConfig, period: float) -> dict[str, float]:
    """Observer of a motor's travel from voltage and current; attributes of JointMonitor."""
    motor, limits = joint.motor, joint.limits
    low, high = limits.hard_lower, limits.hard_upper
    weight = first_weight(motor.resistance * period / motor.inductance)
    change = motor.inductance - weight * motor.resistance * period
    return {
        "travel_per_output": motor.supply_voltage / 100.0 / motor.back_emf * period,
        "travel_per_current": motor.resistance / motor.back_emf * period,
        "travel_per_change": change / motor.back_emf,
        "travel_per_age": 2.0 * limits.velocity,
        "middle": 0.5 * (low + high) if math.isfinite(high - low) else 0.0,
    }


def checked_limits(joint: JointConfig, period: float) -> dict[str, float]:
    """The limits of a joint that is configured; attributes of JointMonitor."""
    limits, timeouts = joint.limits, joint.timeouts
    slack = joint.kind.choose(JUMP_RADIANS, JUMP_METRES)
    fastest = joint.motor.supply_voltage / joint.motor.back_emf
    thrown = min(2.0 * limits.torque / joint.inertia_min * period, fastest) * period
    bounds = {
        "max_alarm": 0.0,
        "max_current": limits.peak_current,
        "max_encoder_age": timeouts.encoder,
        "max_jump": max(4.0 * limits.velocity * period, thrown) + slack,
        "max_velocity": OVERSPEED * limits.velocity,
        "max_torque_age": timeouts.torque_sensor if joint.torque_sensor else CREDIBLE,
        "max_torque": 100.0 * limits.torque if joint.torque_sensor else CREDIBLE,
        "max_temperature": limits.temperature,
    }
    return {name: min(bound, CREDIBLE) for name, bound in bounds.items()} | {
        "max_travel": joint.max_travel_error + 2.0 * limits.velocity * SAMPLING_OFFSET,
        "max_overrun": 0.5 * (limits.hard_upper - limits.hard_lower) + limits.hard_margin,
        "max_overload": heat_constants(limits)["budget"],
    }


#: The limits of a joint that is not configured: readings must be numbers, nothing else.
UNLIMITED = dict.fromkeys(
    (
        "max_alarm",
        "max_current",
        "max_encoder_age",
        "max_jump",
        "max_velocity",
        "max_torque_age",
        "max_torque",
        "max_temperature",
    ),
    CREDIBLE,
) | dict.fromkeys(("max_travel", "max_overrun", "max_overload"), math.inf)


def first_weight(ratio: float) -> float:
    """Weight of the first current in a cycle's mean, of x = R T/L; see the module's text."""
    if ratio < 1e-3:
        return 0.5 - ratio / 12.0
    settled = -math.expm1(-ratio)  # 1 − a
    mean = settled / ratio
    return mean - (1.0 - settled) / settled * (1.0 - mean)

# SPDX-License-Identifier: Apache-2.0
"""Gains of a stable loop at its rate and inertia: warnings, since a body may have friction.

A rigid joint of inertia J under u = kp e + ki ∫e dt + kd ė, held for a period T, is stable for

    kd < 2 J_min/T        kp < 2 kd/T        ki < kp kd/J_max

Growth slower than GROWTH is left to friction: kp < (2 kd + 4 GROWTH J_min)/T and
ki < kp (kd/J_max + 2 GROWTH). A torque follows the torque loop within a cycle: kp < 2, ki T < 2.
A winding follows the current loop as i' = a i + (1 − a) v/R, a = exp(−T R/L):
kp < R (1 + a)/(1 − a), ki T likewise.
"""

from __future__ import annotations

import math

from ..core.config.config import BoardConfig, JointConfig
from ..core.config.parts import DERIVATIVE_CUTOFF, Pid

#: Growth rate that friction can still damp, 1/s.
GROWTH = 10.0
#: Lowest useful cutoff of the rate's low pass, Hz.
LEAST_CUTOFF = 0.1
#: An integral part of this many torque limits is unbounded.
MOST_INTEGRAL = 10.0


def warnings(config: BoardConfig) -> dict[str, str]:
    """Gains unstable at this rate and inertia: by full parameter name, one line each."""
    texts: dict[str, str] = {}
    for joint in config.joints:
        for name, (value, limit) in bounds(joint, config.period).items():
            if value > limit:
                texts[f"{joint.name}.{name}"] = (
                    f"{joint.name}.{name}: {value:.4g} makes the loop unstable at "
                    f"{config.control_rate:g} Hz and this joint's inertia; up to about "
                    f"{limit:.3g} can be stable"
                )
        for name, pid in loops(joint).items():
            texts |= {
                f"{joint.name}.{name}.{key}": f"{joint.name}.{name}.{key}: {text}"
                for key, text in filters(pid, joint.limits.torque, config.control_rate).items()
            }
    return texts


def loops(joint: JointConfig) -> dict[str, Pid]:
    """The loops of a joint whose output is a torque."""
    pids = {"position_pid": joint.position_pid, "torque_pid": joint.torque_pid}
    return pids | ({"direct_pid": joint.direct_pid} if joint.direct_pid else {})


def bounds(joint: JointConfig, period: float) -> dict[str, tuple[float, float]]:
    """For each gain its value, and its stability limit."""
    least, greatest = joint.inertia_min, joint.inertia_max
    most_kd = 2.0 * least / period
    limits = {
        "impedance.max_damping": (joint.impedance.max_damping, most_kd),
        "impedance.max_stiffness": (joint.impedance.max_stiffness, 2.0 * most_kd / period),
    }
    for name, pid in loops(joint).items():
        if name == "torque_pid":
            limits |= {
                f"{name}.kp": (pid.kp, 2.0),
                f"{name}.ki": (pid.ki, 2.0 / period),
                f"{name}.kd": (pid.kd, 2.0 * period),
                f"{name}.kff": (pid.kff, 10.0),
            }
            continue
        kd = min(pid.kd, most_kd)
        most_kp = (2.0 * kd + 4.0 * GROWTH * least) / period
        kp = min(pid.kp, most_kp)
        limits |= {
            f"{name}.kp": (pid.kp, most_kp),
            f"{name}.ki": (pid.ki, kp * (kd / greatest + 2.0 * GROWTH)),
            f"{name}.kd": (pid.kd, most_kd),
            f"{name}.kff": (pid.kff, most_kp),
        }
    kept = math.exp(-period * joint.motor.resistance / joint.motor.inductance)
    resistance = joint.motor.resistance * (1.0 + kept) / max(1.0 - kept, 1e-9)
    current = joint.current_pid
    return limits | {
        "current_pid.kp": (current.kp, resistance),
        "current_pid.ki": (current.ki, resistance / period),
    }


def filters(pid: Pid, torque: float, rate: float) -> dict[str, str]:
    """Warnings of the low pass and the integral bound of a loop."""
    texts = {}
    highest = max(0.5 * rate, DERIVATIVE_CUTOFF)
    if pid.kd > 0.0 and not LEAST_CUTOFF <= pid.derivative_cutoff <= highest:
        texts["derivative_cutoff"] = (
            f"{pid.derivative_cutoff:.4g} Hz leaves no rate, or filters nothing; "
            f"{LEAST_CUTOFF:g} to {highest:g} Hz act at {rate:g} Hz"
        )
    if pid.ki > 0.0 and pid.integral_limit > MOST_INTEGRAL * torque:
        texts["integral_limit"] = (
            f"{pid.integral_limit:.4g} bounds nothing; the joint's torque limit is {torque:.4g}"
        )
    return texts

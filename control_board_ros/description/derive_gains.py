# SPDX-License-Identifier: Apache-2.0
"""Derivation of missing gains of a joint.

With the least inertia J felt by the motor and the greatest J_M, the torque limit τ and the control
period T, including the delay of a drive that leaves the position loop to the board::

    C  = min(600, 0.6/T)                1/s, crossover of the velocity loop at J: hold, winding
                                        and filter leave it a phase margin of some 40 degrees
                                        there, in the worst pose, and more in all others
    kd ≤ C J
    kp = min(kd C/8, kd²/1.5 J_M, τ/x)  damped at J_M, too; the torque limit is worth an error x
    kd = min(C J, 2.2 √(kp J_M))
    ki = kp · min(C/20, 0.22 kd/J_M)
    k  ≤ kp/4                           stiffness limit from the torque loop's lag
    d  = 2 ζ √(k J_M)                   released, a joint overshoots by no more than a tenth

The shipped robots use these gains; a gain in a parameter file is an exception with a reason.
"""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

from ..core.config.config import spring_damping
from ..core.config.parts import DERIVATIVE_CUTOFF, Pid
from ..core.terms.drives import CLOSE_POSITION
from ..core.terms.joint_kind import JointKind

MAX_CROSSOVER = 600.0  # 1/s
CROSSOVER_PHASE = 0.6  # rad
LEAST_ERROR = 8e-3  # rad, least error at which the torque limit is reached
LEAST_SLIDE_ERROR = 2e-3  # m, likewise
START_STIFFNESS_SHARE = 0.2  # initial stiffness, share of the greatest
MAX_STIFFNESS_SHARE = 0.25  # greatest stiffness, share of the position loop's


def gains(values: dict[str, Any], period: float, kind: JointKind) -> None:
    """Complete the gains of one joint, in place."""

    def give(name: str, value: float) -> float:
        number: float = values.setdefault(name, float(f"{value:.3g}"))
        return number

    torque, least, greatest = (
        values[name] for name in ("limits.torque", "inertia_min", "inertia_max")
    )
    if not {kind.code for kind in CLOSE_POSITION}.intersection(values["drive"]):
        period += values["drive_delay"]
    crossover = min(MAX_CROSSOVER, CROSSOVER_PHASE / period)
    kd_max = crossover * least
    kp = give(
        "position_pid.kp",
        min(
            kd_max * crossover / 8.0,
            kd_max**2 / (1.5 * greatest),
            torque / kind.choose(LEAST_ERROR, LEAST_SLIDE_ERROR),
        ),
    )
    kd = give("position_pid.kd", min(kd_max, 2.2 * math.sqrt(kp * greatest)))
    give("position_pid.ki", kp * min(crossover / 20.0, 0.22 * kd / greatest))
    give("position_pid.integral_limit", torque)
    give("position_pid.derivative_cutoff", DERIVATIVE_CUTOFF)
    for gain in fields(Pid):
        values.setdefault(f"direct_pid.{gain.name}", values[f"position_pid.{gain.name}"])
    give("torque_pid.integral_limit", torque)
    max_stiffness = give("impedance.max_stiffness", MAX_STIFFNESS_SHARE * kp)
    stiffness = give("impedance.stiffness", START_STIFFNESS_SHARE * max_stiffness)
    give("impedance.max_damping", max(kd, spring_damping(max_stiffness, greatest)))
    damping = min(values["impedance.max_damping"], spring_damping(stiffness, greatest))
    give("impedance.damping", damping)

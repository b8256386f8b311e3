# SPDX-License-Identifier: Apache-2.0
"""A joint of the laws by itself, as plain Python: each of its numbers is another one."""

from __future__ import annotations

from typing import Any

from joint_parts import numbers as joint_numbers
from joint_parts import read, write
from pure import LAWS

#: Parts whose numbers a test sets itself.
PARTS = ("position_pid", "torque_pid", "current_pid", "direct.stream", "history")
NUMBERS = [path for path in joint_numbers(LAWS.Joint()) if not path.startswith(PARTS)]
INFINITE = LAWS.INFINITE
GIVEN = {
    "clock.period": 0.01,
    "limits.velocity": 3.0,
    "limits.acceleration": 20.0,
    "limits.torque": 60.0,
    "drive.max": 80.0,
    "motor.inertia": 0.5,
    "velocity": 0.0,
    "law": LAWS.POSITION,
}


def joint(**changes: float) -> Any:
    """A joint each of whose numbers is another one, from 100 on, unless given."""
    made = LAWS.Joint()
    for k, name in enumerate(NUMBERS):
        write(made, name, 100.0 + k)
    quiet = ("wire.age", "wire.max_age", "wire.silence", "wire.blind", "wire.coasts",
    "direct.stepping", "stop.smooth", "sampled", "behind",
             "external.contact", "external.had_contact", "limits.jerk",
             "trajectory.start_acceleration", "clock.gap", "clock.max_elapsed",
             "clock.hold_time", "trajectory.acceleration", "admittance.dead_band",
             "set_point.sag", "set_point.trail", "reference.comes_to_rest",
             "wire.outage")  # fmt: skip
    fresh = dict.fromkeys(quiet, 0.0) | {
        "wire.bandwidth_share": 1.0,
        "wire.stiffness_share": 1.0,
        "wire.speed_share": 1.0,
    }
    for name, value in (GIVEN | fresh | changes).items():
        write(made, name, value)
    made.clock.elapsed = made.clock.span = made.clock.period
    for pid in (made.position_pid, made.torque_pid, made.current_pid):
        pid.limit, pid.integral, pid.previous = 1e3, 5.0, 5.0
        pid.error = pid.reference = pid.derivative = pid.room = 9.0
        pid.kp, pid.kff, pid.kd = 0.0, 0.5, 0.0
    made.direct.stream.begin(0.3, 0.4, True)
    return made


def numbers(one: Any) -> dict[str, float]:
    return {name: read(one, name) for name in NUMBERS}


def changes(one: Any, method: str, *arguments: Any) -> dict[str, float]:
    """What a request changes."""
    before = numbers(one)
    getattr(one, method)(*arguments)
    return {name: value for name, value in numbers(one).items() if value != before[name]}

# SPDX-License-Identifier: Apache-2.0
"""A joint of the laws by itself, as plain Python: each of its numbers is another one."""

from __future__ import annotations

from typing import Any

from pure import LAWS

PARTS = ("position_pid", "torque_pid", "current_pid", "stream", "fed", "fed_now", "drawn")
NUMBERS = [
    name
    for name, value in vars(LAWS.Joint).items()
    if isinstance(value, int | float) and name not in PARTS
]
INFINITE = LAWS.INFINITE
GIVEN = {
    "period": 0.01,
    "max_velocity": 3.0,
    "max_acceleration": 20.0,
    "max_torque": 60.0,
    "max_drive": 80.0,
    "inertia": 0.5,
    "velocity": 0.0,
    "law": LAWS.POSITION,
}


def joint(**changes: float) -> Any:
    """A joint each of whose numbers is another one, from 100 on, unless given."""
    made = LAWS.Joint()
    for k, name in enumerate(NUMBERS):
        setattr(made, name, 100.0 + k)
    quiet = ("age", "wire", "missed", "blind", "coasts", "stepping", "smooth", "sampled", "behind",
             "contact", "had_contact", "max_jerk", "move_acceleration", "gap", "usual",
             "hold_time", "moved_acceleration", "dead_band", "sag", "trail", "comes_to_rest",
             "outage")  # fmt: skip
    fresh = dict.fromkeys(quiet, 0.0) | {"calm": 1.0, "spring": 1.0, "steady": 1.0}
    for name, value in (GIVEN | fresh | changes).items():
        setattr(made, name, value)
    made.elapsed = made.span = made.period
    for pid in (made.position_pid, made.torque_pid, made.current_pid):
        pid.limit, pid.integral, pid.previous = 1e3, 5.0, 5.0
        pid.error = pid.reference = pid.derivative = pid.room = 9.0
        pid.kp, pid.kff, pid.kd = 0.0, 0.5, 0.0
    made.stream.begin(0.3, 0.4, True)
    return made


def numbers(one: Any) -> dict[str, float]:
    return {name: getattr(one, name) for name in NUMBERS}


def changes(one: Any, method: str, *arguments: Any) -> dict[str, float]:
    """What a request changes."""
    before = numbers(one)
    getattr(one, method)(*arguments)
    return {name: value for name, value in numbers(one).items() if value != before[name]}

# SPDX-License-Identifier: Apache-2.0
"""One joint of the laws alone: constants, readings in, references and outputs out.

``OneJoint`` is the joint, measured to be where a test says; ``Body`` is a mass that it drives.
"""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
from joint_parts import read, write
from pure import INSTALLED

from control_board_ros.core.laws.control import set_protection

ROWS = (
    "position",
    "velocity",
    "torque",
    "current",
    "position_reference",
    "velocity_reference",
    "torque_reference",
    "output",
    "age",
)

#: A joint of 1 kg·m² whose drive is its torque, in percent.
CONSTANTS = {
    "clock.period": 0.001,
    "limits.lower": -2.0,
    "limits.upper": 2.0,
    "limits.velocity": 3.0,
    "limits.acceleration": 20.0,
    "limits.torque": 60.0,
    "limits.output": 100.0,
    "drive.max": 100.0,
    "motor.inertia_min": 1.0,
    "motor.inertia": 1.0,
    "motor.torque_per_ampere": 1.0,
    "motor.has_torque_sensor": True,
    "drive.per_torque": 1.0,
    "drive.per_feed": 1.0,
    "calibrated": True,
    "feeds": True,
    "reference.lower": -2.0,
    "reference.upper": 2.0,
    "motor.slip": 0.03,
}


class OneJoint:
    """A joint that is measured to be where ``set`` says; ``module`` holds the laws."""

    def __init__(self, module: Any = INSTALLED, **constants: Any) -> None:
        self.joint = module.Joint()
        for name, value in (CONSTANTS | constants).items():
            write(self.joint, name, value)
        set_protection(self.joint.motor)
        self.rows = {name: array("d", [0.0]) for name in ROWS}
        self.done = array("B", [1])
        views = [memoryview(row) for row in self.rows.values()]
        self._laws = module.Laws([self.joint], views, memoryview(self.done))

    def set(self, **measured: float) -> None:
        """What is measured from now on; without friction the current is that of the torque."""
        if "torque" in measured:
            measured = {
                "current": measured["torque"] / self.joint.motor.torque_per_ampere
            } | measured
        for name, value in measured.items():
            self.rows[name][0] = value

    def step(self, cycles: int = 1) -> None:
        """Some control cycles."""
        for _ in range(cycles):
            self._laws.step()

    def get(self, name: str) -> float:
        """The last value of a row."""
        return self.rows[name][0]

    def record(self, cycles: int, *attributes: str) -> np.ndarray:
        """Attributes of the joint after each cycle, shape (cycles, k)."""
        rows = []
        for _ in range(cycles):
            self.step()
            rows.append([read(self.joint, name) for name in attributes])
        return np.array(rows, dtype=float)


def gains(pid: Any, **values: float) -> None:
    """Set gains of a PID: its rate unfiltered, its integral part without bound by default."""
    for name, value in ({"alpha": 1.0, "limit": 1e9} | values).items():
        setattr(pid, name, value)


def resting(torque: float = 0.0, **constants: Any) -> OneJoint:
    """A joint at 0, unpowered, that has rested under a load long enough to know it."""
    one = OneJoint(**constants)
    one.set(torque=torque)
    one.step(40)
    return one


def started(law: int, torque: float = 0.0, **constants: Any) -> OneJoint:
    """The same, with a law running; its torque PID gives the reference itself."""
    one = resting(torque, **constants)
    gains(one.joint.torque_pid, kff=1.0)
    one.joint.start(law)
    return one


def outputs(one: OneJoint, cycles: int) -> np.ndarray:
    """The output after each cycle, shape (cycles,)."""
    return one.record(cycles, "output")[:, 0]


class Body:
    """A mass that a joint drives, J q̈ = τ + load − friction; what is measured is exact.

    Args:
        one: the joint; its output, in percent, is the motor's torque in N·m and current in A.
        inertia: kg·m².
        load: torque from outside (gravity, a push), N·m.
        friction: of Coulomb, N·m.
    """

    def __init__(
        self, one: OneJoint, *, inertia: float = 1.0, load: float = 0.0, friction: float = 0.0
    ) -> None:
        self.one, self.inertia, self.load, self.friction = one, inertia, load, friction
        self.position = self.velocity = 0.0

    def step(self, cycles: int = 1) -> np.ndarray:
        """Some cycles of joint and mass; position, velocity, torque of each, shape (cycles, 3)."""
        period, rows = self.one.joint.clock.period, []
        for _ in range(cycles):
            torque = self.one.get("output")
            self.one.set(
                position=self.position, velocity=self.velocity, torque=torque, current=torque
            )
            self.one.step()
            torque = self.one.get("output")
            free = self.velocity + (torque + self.load) / self.inertia * period
            rubbed = self.friction / self.inertia * period
            self.velocity = float(np.sign(free) * max(0.0, abs(free) - rubbed))
            self.position += self.velocity * period
            rows.append((self.position, self.velocity, torque))
        return np.array(rows)


class Winding:
    """A mass driven through a winding, di/dt = (u − i) R/L, in steps of 50 µs or less.

    Args:
        one: the joint; its output, in percent, is the torque in N·m that the winding settles at.
        time: L/R, s.

    Attributes: position, velocity, torque (of the motor, N·m).
    """

    def __init__(self, one: OneJoint, time: float) -> None:
        self.one, self.time = one, time
        self.position = self.velocity = self.torque = 0.0

    def step(
        self, cycles: int, *, inertia: float, load: float = 0.0, blocked: bool = False
    ) -> np.ndarray:
        """Some cycles of joint, winding and mass; the velocity after each, shape (cycles,)."""
        period, rows = self.one.joint.clock.period, []
        parts = max(5, round(period / 5e-5))
        part = period / parts
        for _ in range(cycles):
            self.one.set(position=self.position, velocity=self.velocity, torque=self.torque)
            self.one.step()
            for _ in range(parts):
                self.torque += (self.one.get("output") - self.torque) * part / self.time
                self.velocity += (self.torque + load) / inertia * part
                self.velocity *= not blocked
                self.position += self.velocity * part
            rows.append(self.velocity)
        return np.array(rows)

# SPDX-License-Identifier: Apache-2.0
"""Logs of an arm that is not there, as people keep them: friction, noise, payload, pushes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from control_board_ros.identification.robot import Robot

NAMES = ("turn", "lift", "bend")
#: Of the motors, which the URDF does not have: N·m/A at the joint over the gear ratio of 100.
CONSTANTS = (0.12, 0.15, 0.05)
COULOMB, VISCOUS = (6.0, 8.0, 2.0), (4.0, 6.0, 1.5)
ROTORS = (1e-4, 1.2e-4, 4e-5)
#: Standard deviations: rad, rad/s, A, N·m.
NOISE = (1e-5, 2e-3, 0.03, 0.1)
#: Harmonics of the motion: Hz and rad, for each joint.
TONES = ((0.11, 0.9), (0.29, 0.5), (0.53, 0.25))


def link(name: str, mass: float, x: float, size: float) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="{x} 0 0"/><mass value="{mass}"/>'
        f'<inertia ixx="{size / 5}" iyy="{size}" izz="{size}" ixy="0" ixz="0" iyz="0"/>'
        "</inertial></link>"
    )


def joint(name: str, parent: str, child: str, x: float, axis: str, effort: float) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="{axis}"/>'
        f'<limit lower="-3" upper="3" effort="{effort}" velocity="3"/></joint>'
    )


URDF = (
    '<robot name="logged">'
    + link("base", 5.0, 0.0, 0.1)
    + link("column", 6.0, 0.02, 0.1)
    + link("upper", 9.0, 0.25, 0.3)
    + link("fore", 4.0, 0.2, 0.12)
    + joint("turn", "base", "column", 0.0, "0 0 1", 300.0)
    + joint("lift", "column", "upper", 0.1, "0 1 0", 300.0)
    + joint("bend", "upper", "fore", 0.5, "0 1 0", 120.0)
    + "</robot>"
)


def urdf_of(folder: Path) -> Path:
    path = folder / "logged.urdf"
    path.write_text(URDF, "utf-8")
    return path


def truth() -> dict[str, float]:
    """The parameters of the arm in the logs."""
    rows = {
        "torque_constant": CONSTANTS,
        "coulomb": COULOMB,
        "viscous": VISCOUS,
        "inertia": ROTORS,
    }
    return {
        f"{name}.motor.{key}": row[k] for key, row in rows.items() for k, name in enumerate(NAMES)
    }


class Log:
    """A log of all joints in motion.

    Args:
        urdf: Of the arm.
        rate: Of readings, Hz.
        seconds: Its length.
        seed: Of motion and noise.
        payload: At the last link, kg, 0.4 m from its joint.
        push: Torque from outside on each joint, N·m.
        pushed: From and until, s.
        still: Joints that do not move.

    Attributes: time (s), position, velocity, current, torque (at a sensor beyond the gearbox),
    shape (m, 3).
    """

    def __init__(
        self,
        urdf: Path,
        rate: float = 100.0,
        seconds: float = 90.0,
        seed: int = 1,
        payload: float = 0.0,
        push: Sequence[float] = (0.0, 0.0, 0.0),
        pushed: tuple[float, float] = (0.0, 0.0),
        still: Sequence[str] = (),
    ) -> None:
        random, n = np.random.default_rng(seed), len(NAMES)
        period = 1.0 / rate
        self.time = np.arange(0.0, seconds, period)
        self.time = self.time + random.uniform(-0.1, 0.1, self.time.size) * period  # its jitter
        q, dq, ddq = (np.zeros((self.time.size, n)) for _ in range(3))
        for k in range(n):
            for frequency, size in TONES if NAMES[k] not in still else ():
                w = 2.0 * math.pi * frequency * random.uniform(0.85, 1.15)
                a, phase = size * random.uniform(0.7, 1.0), random.uniform(0.0, 6.0)
                q[:, k] += a * np.sin(w * self.time + phase)
                dq[:, k] += a * w * np.cos(w * self.time + phase)
                ddq[:, k] -= a * w * w * np.sin(w * self.time + phase)
        values = truth() | {"bend.payload.mass": payload, "bend.payload.center": [0.4, 0.0, 0.0]}
        robot = Robot.of_metal(str(urdf)).with_values(values)
        arm = robot.loaded_model().arm()
        rows = [np.asarray(row) for row in arm.rows]
        self.torque = np.empty_like(q)
        for m in range(self.time.size):
            rows[0][:], rows[1][:], rows[2][:] = q[m], dq[m], ddq[m]
            arm.inverse(1.0)
            self.torque[m] = rows[3]
        touched = (self.time >= pushed[0]) & (self.time < pushed[1])
        self.torque[touched] -= push
        friction = np.array(COULOMB) * np.tanh(dq / 0.01) + np.array(VISCOUS) * dq
        current = (self.torque + friction) / (100.0 * np.array(CONSTANTS))
        noisy = (
            values + size * random.standard_normal(q.shape)
            for values, size in zip((q, dq, current, self.torque), NOISE, strict=True)
        )
        self.position, self.velocity, self.current, self.torque = noisy

    def csv(self, path: Path, *, torn: bool = False) -> Path:
        """A table in degrees and mA of the other direction; ``torn``: as one finds them.

        A hole of 2 s, a cell that is garbage, an empty one, and a last row that is cut off.
        """
        columns = [self.time, *np.degrees(self.position).T, *self.velocity.T]
        rows = np.column_stack([*columns, *(-1e3 * self.current).T])
        head = ["t", *(f"{name} {n}" for name in ("q", "dq", "mA") for n in range(3))]
        lines = [",".join(head)]
        lines += [",".join(f"{value:.6f}" for value in row) for row in rows]
        if torn:
            cells = lines[500].split(",")
            lines[500] = ",".join([*cells[:5], "5.9e293", *cells[6:]])
            lines[900] = ",".join(["", *lines[900].split(",")[1:]])
            del lines[1500 : 1500 + round(2.0 / (self.time[1] - self.time[0]))]
            lines[-1] = lines[-1][: len(lines[-1]) // 2]
        path.write_text("\n".join(lines) + ("" if torn else "\n"), "utf-8")
        return path

# SPDX-License-Identifier: Apache-2.0
"""The torques of the arm's masses, linear in their unknowns.

τ = τ_0 + Σ_j J_j y_j + m y_m + h·y_h + I·y_I: rotors J_j, and a point mass at one link with
h = m c and I = m (c·c 1 − c cᵀ). The columns y are differences of recursive Newton-Euler
(``core.model.dynamics``), which is linear in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.model.arm_model import COLUMNS, PLACES, ROWS, ArmModel
from ..core.model.dynamics import Arm, Body
from ..protocols import Floats
from .samples import Samples

#: Of a body's numbers: mass, moment, tensor.
OF_MASS = ("mass", *PLACES["moment"], *PLACES["tensor"])


@dataclass(frozen=True, slots=True, eq=False)
class Loads:
    """Torques of samples, m of them, of the k identified joints.

    Attributes: known (of the given masses, shape (m, k)), rotors (per kg·m² of each of the k
    rotors, shape (k, m, k)), payload (per mass, h and I of the point mass, shape (10, m, k); in
    the axes of the URDF's link).
    """

    known: Floats
    rotors: Floats
    payload: Floats


def loads_of(
    samples: Samples, model: ArmModel, columns: Sequence[int], carrier: int, in_links: bool
) -> Loads:
    """The torques of samples.

    Args:
        samples: Of the board's joints.
        model: Of the arm, without their rotors.
        columns: The identified joints.
        carrier: The joint whose link carries the payload.
        in_links: Whether rotors turn with their whole link, as in pybullet.
    """
    arm = model.arm()
    bodies: list[Body] = arm.bodies
    motion = samples.position, samples.velocity, samples.acceleration
    known = torques(arm, *motion)[:, columns]
    link = model.links[carrier]

    def added(body: Body, **numbers: float) -> Floats:
        before = {name: getattr(body, name) for name in numbers}
        for name, value in numbers.items():
            setattr(body, name, before[name] + value)
        loads = torques(arm, *motion)[:, columns] - known
        for name, value in before.items():
            setattr(body, name, value)
        return loads

    rotors = [
        added(bodies[j], **{"izz" if in_links and not model.links[j].slides else "rotor": 1.0})
        for j in columns
    ]
    axes = np.reshape(link.axes, (3, 3))
    payload = []
    for unit in np.eye(10):
        mass, moment, tensor = unit[0], axes @ unit[1:4], np.zeros((3, 3))
        tensor[ROWS, COLUMNS] = tensor[COLUMNS, ROWS] = unit[4:]
        turned = (axes @ tensor @ axes.T)[ROWS, COLUMNS]
        numbers = np.concatenate([[mass], moment, turned])
        payload.append(added(bodies[carrier], **dict(zip(OF_MASS, numbers.tolist(), strict=True))))
    return Loads(known, np.array(rotors), np.array(payload))


def torques(arm: Arm, position: Floats, velocity: Floats, acceleration: Floats) -> Floats:
    """Torques of a motion, shape (m, n), as all arguments."""
    rows = [np.asarray(row) for row in arm.rows]
    loads = np.empty_like(position)
    for k, moving in enumerate(zip(position, velocity, acceleration, strict=True)):
        for row, values in zip(rows, moving, strict=False):
            row[:] = values
        arm.inverse(1.0)
        loads[k] = rows[-1]
    return loads

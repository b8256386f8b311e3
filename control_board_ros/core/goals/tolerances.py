# SPDX-License-Identifier: Apache-2.0
"""By how much joints may be away from a trajectory: pure functions of arrays (SPEC T1).

The meaning is that of ros2_controllers' joint_trajectory_controller: 0 in a goal leaves the
default, which is a parameter; a negative number removes the limit. Accelerations are not measured,
so there is no tolerance of theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..selection import RequestError
from ..terms.joint_kind import JointKind
from ..terms.measurement import Array

#: What the numbers of a tolerance are about.
QUANTITIES = ("position", "velocity")


class Wish(NamedTuple):
    """The tolerance that a goal names for one joint: rad and rad/s, 0 = default, < 0 = none."""

    name: str
    position: float
    velocity: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tolerances:
    """Of k joints; 0 means no limit.

    Attributes: path and goal (rows position, rad, and velocity, rad/s; shape (2, k)), goal_time (s
    after the last point until which the joints may arrive).
    """

    path: Array
    goal: Array
    goal_time: float


class Excess(NamedTuple):
    """The joint that is farthest beyond its tolerance: column, quantity, error and tolerance."""

    column: int
    quantity: str
    error: float
    tolerance: float


def resolve(default: float, wish: float) -> float:
    """The tolerance in force: 0 leaves the default, a negative number removes it."""
    return default if wish == 0.0 else max(wish, 0.0)


def chosen(
    defaults: Tolerances,
    names: Sequence[str],
    known: Sequence[str],
    *,
    path: Sequence[Wish],
    goal: Sequence[Wish],
    goal_time: float,
) -> Tolerances:
    """The tolerances of a goal.

    Args:
        defaults: of the goal's joints.
        names: of the goal's joints, in the order of the columns.
        known: names of all joints of the board; wishes for those outside the goal are passed over.
        path: what the goal names for the way.
        goal: likewise for the last point.
        goal_time: likewise, s.

    Raises:
        RequestError: a wish is not a number, or for a joint that is not there.
    """
    return replace(
        defaults,
        path=_with("path_tolerance", defaults.path, names, known, path),
        goal=_with("goal_tolerance", defaults.goal, names, known, goal),
        goal_time=resolve(defaults.goal_time, goal_time),
    )


def _with(
    what: str, rows: Array, names: Sequence[str], known: Sequence[str], wishes: Sequence[Wish]
) -> Array:
    made = rows.copy()
    if len(wishes) > len(known):
        raise RequestError(
            f"{what} has {len(wishes)} entries for {len(known)} joints; name each at most once"
        )
    for wish in wishes:
        if wish.name not in known:
            raise RequestError(f"{what} names {wish.name!r}, which is no joint of this board")
        if not np.isfinite([wish.position, wish.velocity]).all():
            raise RequestError(f"{what} of {wish.name} is not finite; send numbers")
        if wish.name in names:
            k = names.index(wish.name)
            made[:, k] = [resolve(made[0, k], wish.position), resolve(made[1, k], wish.velocity)]
    return made


def excess(errors: Array, tolerances: Array) -> Excess | None:
    """The joint that is farthest beyond its tolerance; None where all are within.

    Args:
        errors: desired − actual, rows position and velocity, shape (2, k).
        tolerances: of the same shape; 0 means no limit.
    """
    limited = tolerances > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(limited, np.abs(errors) / tolerances, 0.0)
    if not (ratios > 1.0).any():
        return None
    row, column = (int(i) for i in np.unravel_index(np.argmax(ratios), ratios.shape))
    error, tolerance = float(abs(errors[row, column])), float(tolerances[row, column])
    return Excess(column, QUANTITIES[row], error, tolerance)


def explain(found: Excess, name: str, kind: JointKind, which: str) -> str:
    """What is beyond which tolerance, and by how much.

    Args:
        found: the excess.
        name: of the joint.
        kind: of the joint, for the unit.
        which: ``path`` or ``goal``.
    """
    rate = "/s" if found.quantity == "velocity" else ""
    units = kind.unit + rate
    return (
        f"{name} is {found.error:.4g} {units} away from the {found.quantity} it should have; "
        f"its {which} tolerance is {found.tolerance:.4g} {units}"
    )

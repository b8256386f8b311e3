# SPDX-License-Identifier: Apache-2.0
"""A planar four-bar linkage, as in a finger whose first joint turns the next one.

The ground link joins two pivots; the crank a turns about the first by θ, the rocker c
about the second by ψ, and the coupler b joins their ends. With e the distance from the crank's end
to the second pivot, in the direction δ::

    cos(ψ − δ) = (b² − e² − c²)/(2 e c)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from ..terms.measurement import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class FourBar:
    """The rocker's turn for the crank's, rad; 0 for 0.

    Args:
        ground: distance of the pivots; all lengths in one unit, whatever it is.
        crank: length of the link that is turned.
        coupler: length of the link between crank and rocker.
        rocker: length of the link that follows.
        zero: angle of the crank at 0, from the direction of the second pivot, rad.
    """

    ground: float
    crank: float
    coupler: float
    rocker: float
    zero: float

    def value(self, x: Array) -> Array:
        """The rocker's turn; NaN where the links do not reach each other."""
        turn = self._rocker(x) - self._rocker(np.zeros(1))
        wrapped: Array = (turn + math.pi) % (2.0 * math.pi) - math.pi
        return wrapped

    def slope(self, x: Array) -> Array:
        """dψ/dθ."""
        above, below, *_ = self._rates(x)
        found: Array = above / below
        return found

    def bend(self, x: Array) -> Array:
        """d²ψ/dθ²."""
        above, below, path, tip, arm = self._rates(x)
        slope = above / below
        turned_tip, turned_arm = _quarter(tip), _quarter(arm)
        moved = turned_arm * slope - turned_tip
        above_rate = _dot(moved, turned_tip) - _dot(path, tip)
        below_rate = _dot(moved, turned_arm) - _dot(path, arm) * slope
        found: Array = (above_rate - slope * below_rate) / below
        return found

    def _rates(self, x: Array) -> tuple[Array, Array, Array, Array, Array]:
        """P·A' and P·C' of the coupler P, with P, the crank A and the rocker C, shape (2, …)."""
        theta, psi = x + self.zero, self._rocker(x)
        tip = self.crank * np.array([np.cos(theta), np.sin(theta)])
        arm = self.rocker * np.array([np.cos(psi), np.sin(psi)])
        path = arm - tip
        path[0] += self.ground
        return _dot(path, _quarter(tip)), _dot(path, _quarter(arm)), path, tip, arm

    def _rocker(self, x: Array) -> Array:
        """ψ, rad."""
        theta = x + self.zero
        across = self.ground - self.crank * np.cos(theta)
        down = -self.crank * np.sin(theta)
        reach = np.hypot(across, down)
        cosine = (self.coupler**2 - reach**2 - self.rocker**2) / (2.0 * reach * self.rocker)
        with np.errstate(invalid="ignore"):
            found: Array = np.arctan2(down, across) + np.arccos(cosine)
        return found


def _quarter(vectors: Array) -> Array:
    """Turned by a quarter turn, shape (2, …)."""
    return np.array([-vectors[1], vectors[0]])


def _dot(a: Array, b: Array) -> Array:
    found: Array = a[0] * b[0] + a[1] * b[1]
    return found


#: What a coupling can name, by name.
FUNCTIONS = {"four_bar": FourBar}
ARGUMENTS = {name: tuple(one.name for one in fields(made)) for name, made in FUNCTIONS.items()}

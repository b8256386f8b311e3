# SPDX-License-Identifier: Apache-2.0
"""The masses of an arm in the board's configuration; ``dynamics`` evaluates them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .dynamics import Arm, Body

#: The places of the six numbers of a tensor in it.
ROWS, COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """A joint and the rigid body that it moves, in axes whose z is the joint's.

    Attributes:
        parent: Index of the joint that carries it; -1: the base.
        slides: Prismatic.
        rotation: E, of the axes at q = 0 in those of the parent, row by row, 9 numbers.
        offset: p, of the origin in the axes of the parent, m.
        mass: kg.
        moment: h = m c, kg·m.
        tensor: About the origin: xx, yy, zz, xy, xz, yz, kg·m².
        rotor: Inertia that acts on this joint only, kg·m²; kg where it slides.
        coulomb, viscous: Friction, N·m and N·m·s/rad.
        axes: Of the URDF's link in these axes, row by row, 9 numbers.
    """

    parent: int
    slides: bool
    rotation: tuple[float, ...]
    offset: tuple[float, ...]
    mass: float
    moment: tuple[float, ...]
    tensor: tuple[float, ...]
    rotor: float = 0.0
    coulomb: float = 0.0
    viscous: float = 0.0
    axes: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

    def with_payload(self, mass: float, center: tuple[float, float, float]) -> Link:
        """The link with a point mass (kg), at a place in the URDF's axes (m)."""
        c = np.reshape(self.axes, (3, 3)) @ center
        tensor = mass * (c @ c * np.eye(3) - np.outer(c, c))
        return replace(
            self,
            mass=self.mass + mass,
            moment=tuple((np.array(self.moment) + mass * c).tolist()),
            tensor=tuple((np.array(self.tensor) + tensor[ROWS, COLUMNS]).tolist()),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmModel:
    """The masses of a board's joints; undriven joints are fixed.

    Attributes:
        links: One per joint, in the board's order.
        gravity: In the base's axes, m/s².
        trusted: Whether feed-forward, loads and durations use it; else only gravity compensation
            does (G1).
    """

    links: tuple[Link, ...]
    gravity: tuple[float, float, float]
    trusted: bool = True

    def arm(self) -> Arm:
        """The dynamics of the arm."""
        base = Body()
        bodies = [body_of(link) for link in self.links]
        for body, link in zip(bodies, self.links, strict=True):
            body.hang(base if link.parent < 0 else bodies[link.parent])
        order = outwards_of([link.parent for link in self.links])
        rows = [row.data for row in np.zeros((4, len(bodies)))]
        return Arm(base, bodies, [bodies[j] for j in order], self.gravity, rows)


def outwards_of(parents: list[int]) -> list[int]:
    """The joints in an order in which each comes after the one that carries it."""
    order: list[int] = []
    while len(order) < len(parents):
        order += [j for j, p in enumerate(parents) if j not in order and (p < 0 or p in order)]
    return order


#: Fields of a Body by the numbers of a Link.
PLACES = {
    "rotation": ("e0", "e1", "e2", "e3", "e4", "e5", "e6", "e7", "e8"),
    "offset": ("px", "py", "pz"),
    "moment": ("hx", "hy", "hz"),
    "tensor": ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"),
}


def body_of(link: Link) -> Body:
    """The body of a link, for the passes."""
    body = Body()
    fill(link, body)
    return body


def fill(
    link: Link, body: Body, mass: float = 0.0, center: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> None:
    """Set the inertial properties of a body from its link and payload."""
    link = link.with_payload(mass, center) if mass else link
    for key, names in PLACES.items():
        for name, value in zip(names, getattr(link, key), strict=True):
            setattr(body, name, value)
    for name in ("slides", "mass", "rotor", "coulomb", "viscous"):
        setattr(body, name, getattr(link, name))
    body.turned = float("nan")

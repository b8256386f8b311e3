# SPDX-License-Identifier: Apache-2.0
"""arm_model.py: links, what they carry, and their order (SPEC G1)."""

from __future__ import annotations

import numpy as np
import pytest

from control_board_ros.core.model.arm_model import ArmModel, Link, body_of, fill, outwards_of

#: A quarter turn about z, and a link whose URDF axes are turned like that.
QUARTER = (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
LINK = Link(
    parent=-1,
    slides=False,
    rotation=tuple(float(k) for k in range(9)),
    offset=(0.1, 0.2, 0.3),
    mass=2.0,
    moment=(0.4, 0.5, 0.6),
    tensor=(1.0, 2.0, 3.0, 0.1, 0.2, 0.3),
    rotor=0.7,
    coulomb=0.8,
    viscous=0.9,
    axes=QUARTER,
)


def test_a_payload_is_a_point_mass_in_the_axes_of_the_urdf() -> None:
    """Mass and moment grow by the mass and its moment, the tensor by m (c² 1 − c cᵀ), c turned."""
    loaded = LINK.with_payload(3.0, (0.5, -0.2, 0.1))
    x, y, z = 0.2, 0.5, 0.1  # turned by the quarter
    assert loaded.mass == 5.0
    assert loaded.moment == pytest.approx((0.4 + 3 * x, 0.5 + 3 * y, 0.6 + 3 * z))
    about = (y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z)
    expected = [old + 3.0 * new for old, new in zip(LINK.tensor, about, strict=True)]
    assert loaded.tensor == pytest.approx(expected)
    assert (loaded.rotation, loaded.rotor) == (LINK.rotation, LINK.rotor)


def test_a_body_has_the_numbers_of_its_link() -> None:
    body = body_of(LINK)
    assert [getattr(body, f"e{k}") for k in range(9)] == list(range(9))
    assert (body.px, body.py, body.pz) == LINK.offset
    assert (body.hx, body.hy, body.hz) == LINK.moment
    tensor = (body.ixx, body.iyy, body.izz, body.ixy, body.ixz, body.iyz)
    assert tensor == LINK.tensor
    assert (body.mass, body.rotor, body.coulomb, body.viscous) == (2.0, 0.7, 0.8, 0.9)
    assert not body.slides
    fill(LINK, body, 3.0, (0.5, -0.2, 0.1))
    loaded = LINK.with_payload(3.0, (0.5, -0.2, 0.1))
    assert (body.mass, body.hx) == (loaded.mass, loaded.moment[0])
    assert (body.ixx, body.iyz) == (loaded.tensor[0], loaded.tensor[5])
    fill(LINK, body)
    assert body.mass == 2.0


@pytest.mark.parametrize(
    ("parents", "order"),
    [
        ([-1, 0, 1], [0, 1, 2]),
        ([2, 0, -1], [2, 0, 1]),
        ([-1, 2, 0, -1], [0, 3, 2, 1]),
        ([], []),
    ],
)
def test_each_link_comes_after_the_one_that_carries_it(
    parents: list[int], order: list[int]
) -> None:
    assert outwards_of(parents) == order
    places = np.argsort(order)
    assert all(p < 0 or places[p] < places[j] for j, p in enumerate(parents))


def test_the_axes_of_a_link_are_those_of_the_urdf_unless_given() -> None:
    plain = Link(
        parent=-1, slides=False, rotation=QUARTER, offset=(0.0,) * 3, mass=1.0,
        moment=(0.0,) * 3, tensor=(0.0,) * 6,
    )  # fmt: skip
    assert plain.axes == (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    assert (plain.rotor, plain.coulomb, plain.viscous) == (0.0, 0.0, 0.0)
    assert plain.with_payload(2.0, (1.0, 2.0, 3.0)).moment == (2.0, 4.0, 6.0)
    assert ArmModel(links=(plain,), gravity=(0.0, 0.0, -9.81)).trusted
    body = body_of(plain)
    fill(plain, body, 3.0)
    assert (body.mass, body.hx, body.hy, body.hz) == (4.0, 0.0, 0.0, 0.0)

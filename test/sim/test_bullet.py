# SPDX-License-Identifier: Apache-2.0
"""What only pybullet cannot do is reported in one line."""

from __future__ import annotations

import pytest
from in_bullet import in_bullet
from plants import board, chain, described, link, robot, simulation

from control_board_ros.sim.plant import PlantError, SimulatedPlant


def test_a_description_that_pybullet_refuses_is_one_line():
    text = robot(
        link("rod", 1, "0 0 0", "1 1 1 0 0 0"),
        '<joint name="hinge" type="revolute"><child link="rod"/></joint>',
    )
    with (
        pytest.raises(PlantError, match="pybullet cannot load it") as caught,
        in_bullet(text, simulation(board("hinge"))),
    ):
        pass
    assert "\n" not in str(caught.value)


def test_a_chain_too_long_for_pybullet_is_one_line():
    urdf, names = chain(128)
    config = board(*names)
    with pytest.raises(PlantError, match=r"128 joints move.* at most 127; name those") as caught:
        SimulatedPlant(config, simulation(config, urdf=described(urdf), physics="pybullet"))
    assert "\n" not in str(caught.value)
    assert "<robot" not in str(caught.value)

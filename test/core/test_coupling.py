# SPDX-License-Identifier: Apache-2.0
"""Couplings of axes and physical joints (SPEC Y3): positions, velocities, torques, both ways."""

from __future__ import annotations

import numpy as np
import pytest

from control_board_ros.core.board import Board
from control_board_ros.core.config.layout import joined
from control_board_ros.core.model.coupling import Coupling, side_by_side
from control_board_ros.settings.loading import load

#: Three motors, three axes, as an iCub's shoulder has them.
SHOULDER = Coupling(
    ("pitch", "roll", "yaw"),
    ("m0", "m1", "m2"),
    ((1.0, 0.0, 0.0), (-1.71, 1.71, 0.0), (-1.71, 1.71, -1.71)),
)
#: One axis closes three joints of a finger, another one spreads it.
FINGER = Coupling(
    ("close", "spread"),
    ("proximal", "middle", "distal", "abduction"),
    ((1.0, 0.0), (1.13, 0.0), (0.77, 0.0), (0.0, 2.0)),
    (0.0, 0.1, -0.2, 0.0),
)


@pytest.mark.parametrize("coupling", [SHOULDER, FINGER], ids=["shoulder", "finger"])
def test_there_and_back(coupling: Coupling) -> None:
    """Y3: what the physical joints show of the axes is that of the axes again."""
    rng = np.random.default_rng(1)
    for _ in range(10):
        axes = rng.normal(size=len(coupling.axes))
        assert coupling.axis_positions(coupling.positions(axes)) == pytest.approx(axes)
        assert coupling.axis_velocities(coupling.velocities(axes)) == pytest.approx(axes)
        assert coupling.axis_torques(coupling.torques(axes)) == pytest.approx(axes)


@pytest.mark.parametrize("coupling", [SHOULDER, FINGER], ids=["shoulder", "finger"])
def test_power_is_the_same_on_both_sides(coupling: Coupling) -> None:
    """Y3: whatever torques act on the physical joints: no power comes or goes."""
    rng = np.random.default_rng(2)
    for _ in range(10):
        speed, torque = rng.normal(size=len(coupling.axes)), rng.normal(size=len(coupling.rows))
        there = coupling.velocities(speed) @ torque
        assert speed @ coupling.axis_torques(torque) == pytest.approx(there)


def test_the_smallest_torques_make_those_of_the_axes() -> None:
    """Y3: a finger's joints share the load as their ways go; none works against another."""
    torques = FINGER.torques(np.array([1.0, 0.0]))
    assert torques / np.array([1.0, 1.13, 0.77, 1.0]) == pytest.approx([torques[0]] * 3 + [0.0])


def test_parts_side_by_side_do_not_meet() -> None:
    """Y3, R1: the coupling of a robot is that of its parts."""
    whole = side_by_side([FINGER, SHOULDER])
    assert whole.axes == (*FINGER.axes, *SHOULDER.axes)
    axes = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    assert whole.positions(axes) == pytest.approx(
        [*FINGER.positions(axes[:2]), *SHOULDER.positions(axes[2:])]
    )


def test_joints_that_follow_are_coupled_to_their_leader() -> None:
    """Y3: the panda's second finger, which its URDF lets follow the first."""
    config = load("panda").board
    coupling = Board(config).get_coupling()
    assert coupling.axes == config.names
    assert coupling.physical_joints == (*config.names, "panda_finger_joint2")
    axes = np.arange(8.0)
    assert coupling.positions(axes).tolist() == [*range(8), 7.0]


def test_without_followers_axes_are_physical_joints() -> None:
    """Y3: of a board, and of a part of a robot."""
    config = load("iiwa").board
    board = Board(joined({"arm": config}))
    for group in (board, board.group("arm")):
        coupling = group.get_coupling()
        assert coupling.axes == coupling.physical_joints == config.names
        assert np.array_equal(coupling.matrix, np.eye(7))

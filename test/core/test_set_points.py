# SPDX-License-Identifier: Apache-2.0
"""Which loop runs where: the fixed row of each law, and what a drive is handed (S1 to S3)."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import chain, combinations

import numpy as np
import pytest
from plants import board as board_of

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import BoardConfig, ConfigError
from control_board_ros.core.terms.drives import KINDS, SetPoint
from control_board_ros.core.terms.measurement import (
    HAS,
    ROWS,
    Measurement,
    Row,
)
from control_board_ros.core.terms.modes import SET_POINTS, Law, reachable, set_point_of
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.core.terms.vocabs import InteractionMode as I

S = SetPoint
DRIVES = [*chain.from_iterable(combinations(KINDS, k) for k in range(1, len(KINDS) + 1))]


def one(*drive: SetPoint, **rest) -> BoardConfig:
    """A board whose joint has such a drive, which does not report its PWM."""
    config = board_of("joint", **rest)
    joint = replace(config.joints[0], drive=drive, max_travel_error=math.inf)
    return replace(config, joints=(joint,))


@pytest.mark.parametrize("law", set(Law) - {Law.OFF})
def test_a_law_uses_the_first_set_point_a_drive_accepts(law: Law) -> None:
    """S1: of all 63 drives that there can be."""
    for drive in DRIVES:
        found = set_point_of(law, drive)
        before = SET_POINTS[law][: SET_POINTS[law].index(found)] if found else SET_POINTS[law]
        assert found is None or found in drive
        assert not set(before) & set(drive)


def test_a_joint_has_the_modes_that_its_drive_reaches() -> None:
    """S1, B2: the others it does not implement (M5, I7)."""
    for drive in DRIVES:
        joint = one(*drive).joints[0]
        for mode in joint.control_modes:
            assert reachable(mode, I.STIFF, drive)
        assert (M.OPENLOOP in joint.control_modes) is (S.PWM in drive)
        loops = {S.IMPEDANCE, S.TORQUE, S.CURRENT, S.PWM} & set(drive)
        assert (M.TORQUE in joint.control_modes) is bool(loops)
        assert (I.COMPLIANT in joint.interaction_modes) is bool(loops)
        assert {M.POSITION, M.VELOCITY, M.MIXED, M.POSITION_DIRECT} < set(joint.control_modes)


def test_which_loop_runs_where_is_shown() -> None:
    """S1."""
    use = one(S.VELOCITY, S.TORQUE).joints[0].drive_use
    assert (use.position, use.impedance, use.torque, use.output) == (
        "velocity", "torque", "torque", None,
    )  # fmt: skip
    assert use.set_points == ("velocity", "torque")
    assert use.loops == "velocity: position; torque: impedance torque"
    assert one().joints[0].drive_use.loops.startswith("pwm: position impedance torque")


def test_a_start_that_no_set_point_reaches_is_refused() -> None:
    """S1, N3: one line, as of any configuration."""
    joint = one(S.POSITION).joints[0]
    with pytest.raises(ConfigError, match="startup_interaction: 'comp' is not allowed; one of"):
        replace(joint, startup_interaction=I.COMPLIANT)


# What is handed down --------------------------------------------------------------------------


class Hands:
    """A board whose drive is the test's, with what it hands down."""

    def __init__(self, *drive: SetPoint, **at: float) -> None:
        self.board = Board(one(*drive))
        self.values = np.zeros((ROWS, 1))
        for row, value in at.items():
            self.values[Row[row.upper()]] = value
        self.time = 0.0
        self.cycle(3)

    def cycle(self, count: int = 1):
        for _ in range(count):
            self.time += 1e-3
            found = self.board.tick(Measurement(self.time, self.values))
        return found.set_points()


@pytest.mark.parametrize("kind", KINDS)
def test_a_drive_receives_only_its_own_values(kind: SetPoint) -> None:
    """S1: those that its kind does not have are 0."""
    hands = Hands(kind)
    assert hands.board.position_move("joint", 0.5)
    found = hands.cycle(20)
    assert S(found.kinds[0]) is kind
    assert not found.values[HAS[kind] == 0.0].any()
    assert found.values[HAS[kind] > 0.0].any()


@pytest.mark.parametrize("kind", KINDS)
def test_without_power_nothing_is_handed_down(kind: SetPoint) -> None:
    """M10."""
    hands = Hands(kind)
    assert hands.board.set_control_mode("joint", "idl")
    found = hands.cycle()
    assert S(found.kinds[0]) is S.OFF
    assert not found.values.any()


def test_a_change_of_mode_is_one_exchange() -> None:
    """S3, M9: the new set-point comes with the law; the place and the load are in it."""
    hands = Hands(S.POSITION, S.TORQUE, position=0.3, torque=12.0)
    hands.cycle(200)
    assert hands.board.set_control_mode("joint", "torq")
    found = hands.cycle()
    assert S(found.kinds[0]) is S.TORQUE
    assert found.torque[0] == pytest.approx(12.0, abs=1e-6)
    assert hands.board.set_control_mode("joint", "pos")
    found = hands.cycle()
    assert S(found.kinds[0]) is S.POSITION
    assert found.position[0] == pytest.approx(0.3, abs=1e-9)
    assert found.velocity[0] == 0.0
    assert found.torque[0] == pytest.approx(12.0, abs=1e-6)


def test_an_impedance_set_point_equals_the_torque_of_the_laws() -> None:
    """S1, I5, P9: k and d are the joint's; what bounds add is in τ_ff."""
    hands = Hands(S.IMPEDANCE)
    assert hands.board.set_interaction_mode("joint", "comp")
    assert hands.board.set_impedance("joint", 50.0, 3.0)
    hands.cycle(100)
    hands.values[Row.POSITION], hands.values[Row.VELOCITY] = 2e-4, 0.2
    found = hands.cycle()
    assert (found.stiffness[0], found.damping[0]) == (50.0, 3.0)
    torque = (
        found.torque
        + found.stiffness * (found.position - 2e-4)
        + found.damping * (found.velocity - 0.2)
    )
    assert torque[0] == pytest.approx(50.0 * (0.0 - 2e-4) - 3.0 * 0.2, rel=1e-6)


def test_a_torque_by_impedance_has_neither_spring_nor_damper() -> None:
    """S1: TORQUE by impedance with k = d = 0."""
    hands = Hands(S.IMPEDANCE)
    assert hands.board.set_control_mode("joint", "torq")
    hands.cycle(100)
    assert hands.board.set_ref_torque("joint", 7.0)
    found = hands.cycle()
    assert (found.stiffness[0], found.damping[0], found.torque[0]) == (0.0, 0.0, 7.0)


def test_a_reference_at_a_limit_stays_within_it_on_every_row() -> None:
    """S2, P9, P14: the board bounds what the drive is handed."""
    for kind in (S.POSITION, S.VELOCITY, S.IMPEDANCE):
        hands = Hands(kind)
        assert hands.board.set_control_mode("joint", "posd")
        assert hands.board.set_position("joint", 9.0)
        for _ in range(3000):
            found = hands.cycle()
            hands.values[Row.VELOCITY] = found.velocity
            hands.values[Row.POSITION] += 1e-3 * found.velocity
            assert abs(found.velocity[0]) <= 3.0 * 1.021
        assert hands.values[Row.POSITION, 0] == pytest.approx(2.0, abs=1e-3)

# SPDX-License-Identifier: Apache-2.0
"""Couplings of axes and physical joints (SPEC Y3): positions, velocities, torques, both ways."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import joined
from control_board_ros.core.model.coupling import Coupling, FourBar, MotorMix, side_by_side
from control_board_ros.core.terms.measurement import Array
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


#: A finger whose last joint is turned by the first through a four-bar linkage.
BAR = FourBar(ground=36.0, crank=12.0, coupler=30.0, rocker=14.0, zero=0.9)
LINKED = Coupling(("bend",), ("proximal", "distal"), ((0.8,), (0.8,)), (0.05, 0.05), (None, BAR))
ALL = pytest.mark.parametrize("coupling", [SHOULDER, FINGER, LINKED], ids=["3", "finger", "bar"])


@ALL
@settings(deadline=None, max_examples=40)
@given(data=st.data())
def test_rates_are_those_of_the_positions(coupling: Coupling, data: st.DataObject) -> None:
    """Y3: velocities are the derivatives of the positions, both ways."""
    n = len(coupling.axes)
    small = st.floats(-0.4, 0.4, allow_nan=False)
    at, rate = (np.array(data.draw(st.lists(small, min_size=n, max_size=n))) for _ in range(2))
    step = 1e-4

    def place(t: float) -> Array:
        return coupling.positions(at + rate * t)

    velocity = coupling.velocities(rate, at)
    assert velocity == pytest.approx((place(step) - place(-step)) / (2 * step), abs=1e-6)
    assert coupling.axis_positions(place(0.0)) == pytest.approx(at, abs=1e-9)
    assert coupling.axis_velocities(velocity, at) == pytest.approx(rate, abs=1e-9)


@ALL
@settings(deadline=None, max_examples=40)
@given(data=st.data())
def test_power_is_conserved(coupling: Coupling, data: st.DataObject) -> None:
    """Y3: torque times velocity is the same on both sides, for torques of either side."""
    n, m = len(coupling.axes), len(coupling.rows)
    numbers = st.floats(-0.4, 0.4, allow_nan=False)
    at, speed, axes = (
        np.array(data.draw(st.lists(numbers, min_size=n, max_size=n))) for _ in range(3)
    )
    joints = np.array(data.draw(st.lists(numbers, min_size=m, max_size=m)))
    moved = coupling.velocities(speed, at)
    assert joints @ coupling.jacobian(at) @ speed == pytest.approx(joints @ moved, abs=1e-12)
    assert coupling.torques(axes, at) @ moved == pytest.approx(axes @ speed, abs=1e-12)


def test_a_four_bar_linkage_keeps_its_lengths() -> None:
    """Y3: crank, coupler and rocker are as long as they were, wherever the crank is."""
    for x in np.linspace(-0.5, 0.8, 7):
        crank = BAR.zero + x
        start = BAR._rocker(np.zeros(1))[0]
        rocker = start + BAR.value(np.array([x]))[0]
        tip = BAR.crank * np.array([np.cos(crank), np.sin(crank)])
        end = np.array([BAR.ground, 0.0]) + BAR.rocker * np.array([np.cos(rocker), np.sin(rocker)])
        assert np.linalg.norm(end - tip) == pytest.approx(BAR.coupler)
    assert BAR.value(np.zeros(1)) == pytest.approx([0.0])


def test_joints_follow_by_gears() -> None:
    """Y3: what leads is a joint, and the others follow it, along a curve where there is one."""
    assert FINGER.leads == (0, 3)
    gears = {gear.follower: gear for gear in FINGER.gears}
    assert set(gears) == {"middle", "distal"}
    assert gears["middle"].place(0.5) == pytest.approx((0.1 + 1.13 * 0.5, 1.13))
    (gear,) = LINKED.gears
    at = np.array([0.3])
    leader, follower = LINKED.positions(at)
    place, slope = gear.place(leader)
    assert place == pytest.approx(follower)
    assert slope == pytest.approx(LINKED.jacobian(at)[1, 0] / LINKED.jacobian(at)[0, 0])
    mixed = Coupling(("a", "b"), ("x", "y", "z"), ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0)))
    with pytest.raises(ValueError, match="z following one joint; it follows x and y"):
        _ = mixed.gears
    (idle,) = Coupling(("a",), ("x", "y"), ((2.0,), (0.0,)), (0.0, 0.3)).gears
    assert idle.leader == "x"
    assert idle.place(1.5) == (0.3, 0.0)  # no axis moves it


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        (((1.0, 0.0), (0.0, 1.0), (0.0,)), "6 numbers: 3 rows of 2.*it has 5"),
        (((1.0, 0.0), (0.0, 1.0)), "it has 4"),
        (((1.0, 1.0), (2.0, 2.0), (3.0, 3.0)), "not singular"),
        (((1.0, float("nan")), (2.0, 2.0), (3.0, 3.0)), "not singular"),
    ],
)
def test_invalid_couplings(rows: tuple[tuple[float, ...], ...], text: str) -> None:
    """Y3: sizes, and a singular matrix."""
    with pytest.raises(ValueError, match=text):
        Coupling(("a", "b"), ("x", "y", "z"), rows)


def test_motors_share_the_demand_of_the_axes() -> None:
    """Y3: unlike motors give the torques of the axes, at standstill and in motion."""
    rng = np.random.default_rng(3)
    torque_per_ampere, ohms, emf, percent = rng.uniform(0.5, 2.0, size=(4, 3))
    mix = MotorMix(SHOULDER, torque_per_ampere, ohms, emf, percent)
    wanted, speed = rng.normal(size=3), rng.normal(size=3)
    output = percent * (ohms / torque_per_ampere * wanted + emf * speed)
    mix.drive(output, speed, np.ones(3), np.full(3, 1e6))
    turning = SHOULDER.velocities(speed)
    currents = (mix.pwm / percent - emf * turning) / ohms
    assert torque_per_ampere * currents @ SHOULDER.matrix == pytest.approx(wanted)
    mix.axis_currents(currents)
    assert currents * torque_per_ampere == pytest.approx(wanted)


def test_an_axis_without_power_asks_for_no_torque() -> None:
    """Y3: its motors run along for the others, and have no power where none needs them."""
    ones = np.ones(3)
    mix = MotorMix(SHOULDER, ones, ones, ones, ones)
    speed = np.array([0.3, -0.2, 0.1])
    powered = np.array([0.0, 1.0, 0.0])
    mix.drive(np.array([5.0, 2.0, 7.0]), speed, powered, np.full(3, 100.0))
    assert mix.powered.tolist() == [1.0, 1.0, 0.0]
    currents = (mix.pwm - SHOULDER.velocities(speed)) * mix.powered
    torques = currents @ SHOULDER.matrix
    assert torques == pytest.approx([0.0, 2.0 - speed[1], 0.0])
    mix.drive(np.zeros(3), speed, np.zeros(3), np.full(3, 100.0))
    assert mix.powered.tolist() == mix.pwm.tolist() == [0.0] * 3


def test_a_linkage_that_turns_right_round() -> None:
    """Its ground is the shortest link: the rocker follows all round, read from −π to π."""
    bar = FourBar(ground=10.0, crank=30.0, coupler=30.0, rocker=25.0, zero=0.3)
    turns = np.linspace(-2.0 * np.pi, 2.0 * np.pi, 2001)
    values = bar.value(turns)
    assert np.isfinite(values).all()
    assert values.min() >= -np.pi
    assert values.max() < np.pi
    whole = np.unwrap(values)
    assert np.abs(np.diff(whole)).max() < 0.05
    assert abs(whole[-1] - whole[0]) == pytest.approx(4.0 * np.pi)
    assert values[1000] == 0.0


def test_a_motor_of_its_own_beside_coupled_ones() -> None:
    """Y3: its output and its power are those of its axis."""
    names = ("a", "b", "c")
    coupling = Coupling(names, names, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 2.0)))
    ones = np.ones(3)
    mix = MotorMix(coupling, ones, ones, ones, ones)
    for on in (1.0, 0.0):
        mix.drive(np.array([7.0, 1.0, 1.0]), np.zeros(3), np.array([on, 1.0, 1.0]), 90.0 * ones)
        assert (mix.pwm[0], mix.powered[0]) == (7.0, on)
    currents = np.array([3.0, 4.0, 5.0])
    mix.axis_currents(currents)
    assert currents.tolist() == pytest.approx([3.0, 4.0 - 5.0, 2.0 * 5.0])


def test_one_motor_at_its_bound_is_enough() -> None:
    """Y3: of unlike motors; the outputs of the axes become what acts on them."""
    names = ("a", "b")
    torque, ohms = np.array([1.0, 4.0]), np.array([2.0, 1.0])
    emf, percent = np.array([0.5, 0.25]), np.array([2.0, 3.0])
    coupling = Coupling(names, names, ((1.0, 0.0), (1.0, 1.0)))
    mix = MotorMix(coupling, torque, ohms, emf, percent)
    speed = np.array([0.3, -0.2])
    output = np.array([4.0, 60.0])
    mix.drive(output, speed, np.ones(2), np.array([400.0, 20.0]))
    assert mix.pwm[0] > -400.0
    assert mix.pwm[1] == 20.0
    currents = (mix.pwm / percent - emf * coupling.velocities(speed)) / ohms
    torques = torque * currents @ coupling.matrix
    assert output == pytest.approx(percent * (ohms / torque * torques + emf * speed))


def test_a_linkage_is_not_crossed() -> None:
    """Y3: a parallelogram's rocker turns as its crank does."""
    bar = FourBar(ground=30.0, crank=10.0, coupler=30.0, rocker=10.0, zero=0.9)
    turns = np.array([-0.5, 0.0, 0.1, 0.5])
    assert bar.value(turns) == pytest.approx(turns)


@pytest.mark.parametrize("function", [None, BAR])
def test_an_axis_that_was_never_read_hides_its_own_joints_only(function: FourBar | None) -> None:
    """B7, Y3: NaN reaches what depends on it, and no torque is an error."""
    coupling = Coupling(
        ("bend", "wrist"),
        ("proximal", "distal", "wrist"),
        ((0.8, 0.0), (0.8, 0.0), (0.0, 1.0)),
        functions=(None, function, None),
    )
    whole = np.array([0.2, 0.3])
    for missing, hidden in ((0, [True, True, False]), (1, [False, False, True])):
        at = whole.copy()
        at[missing] = np.nan
        for made, expected in (
            (coupling.positions(at), coupling.positions(whole)),
            (coupling.velocities(at, at), coupling.velocities(whole, whole)),
        ):
            assert np.isnan(made).tolist() == hidden
            shown = ~np.array(hidden)
            assert made[shown] == pytest.approx(expected[shown])
        torques = coupling.torques(whole, at)
        assert np.isfinite(torques[~np.array(hidden)]).all()

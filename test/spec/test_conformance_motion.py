# SPDX-License-Identifier: Apache-2.0
"""References and motion as a user meets them, in process and over ROS."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from rig import COMMANDS, COMPLIANT, STIFF, TAKES, M

NAN, INF = math.nan, math.inf
HOME = {mode: kind for mode, kinds in TAKES.items() for kind in kinds if mode is not M.MIXED}


def test_a_move_takes_distance_over_speed(board: Any) -> None:
    """P1, P3: a move ends after |Δ|/v, at rest on its target; motion done is false until then."""
    assert board.set_control_mode("left", "pos")
    assert board.position_move("left", 0.8, 0.8)
    assert board.check_motion_done("left") == [False]
    board.run(0.5)
    assert board.check_motion_done("left") == [False]
    assert board.reference("left") == pytest.approx(0.4, abs=0.03)
    board.run(0.45)
    assert board.check_motion_done("left") == [False]
    board.run(0.1)
    assert board.check_motion_done("left") == [True]
    board.run(0.5)
    assert board.get_encoder("left") == pytest.approx(0.8, abs=0.005)
    assert board.get_encoder_speed("left") == pytest.approx(0.0, abs=0.005)


def test_reference_speeds(board: Any) -> None:
    """P2, A: defaults of 10 deg/s and 10 deg/s²; set and read; a speed ≤ 0 is an error."""
    ten = math.radians(10.0)
    assert board.get_ref_speed() == pytest.approx([ten] * 3)
    assert board.get_ref_acceleration() == pytest.approx([ten] * 3)
    assert board.set_ref_speed(["left", "right"], [0.5, 1.0])
    assert board.set_ref_acceleration("bare", 2.0)
    for bad in (0.0, -0.5, NAN, INF):
        assert not board.set_ref_speed(None, [0.7, bad, 0.7])
        assert not board.set_ref_acceleration(None, [0.7, bad, 0.7])
        assert not board.position_move("left", 0.1, bad)
    assert board.get_ref_speed() == pytest.approx([0.5, 1.0, ten])
    assert board.get_ref_acceleration() == pytest.approx([ten, ten, 2.0])
    assert board.set_control_mode(None, "pos")
    assert board.position_move(None, 0.5)
    board.run(0.51)
    assert board.check_motion_done() == [False, True, False]
    board.run(0.5)
    assert board.check_motion_done() == [True, True, False]


def test_stop(board: Any) -> None:
    """P3, A: stop sets the position reference to the measured position; the mode stays."""
    assert board.set_control_mode(["left", "right"], ["pos", "mix"])
    assert board.position_move(["left", "right"], 1.0, 1.0)
    board.run(0.5)
    assert board.stop("left")
    here = float(board.get_encoder("left")[0])
    assert board.check_motion_done(["left", "right"]) == [True, False]
    assert board.reference("left") == pytest.approx(here, abs=0.02)
    board.run(1.0)
    assert board.get_encoder("left") == pytest.approx(here, abs=0.05)
    assert board.get_encoder("right") == pytest.approx(1.0, abs=0.01)
    assert board.get_control_mode("left") == [M.POSITION]


def test_direct_positions_step(board: Any) -> None:
    """P4, P9: the reference is the step itself, bounded by the joint limits."""
    assert board.set_control_mode("left", "posd")
    assert board.set_position("left", 0.2)
    board.run(0.002)
    assert board.reference("left") == pytest.approx(0.2)
    assert board.set_position("left", 5.0)
    board.run(0.002)
    assert board.reference("left") == pytest.approx(2.0)
    assert board.get_ref_position("left") == pytest.approx(2.0)


def test_velocities_are_ramped_and_integrated(board: Any) -> None:
    """P5, P12: v grows with the reference acceleration, moves the joint, and expires."""
    assert board.set_control_mode("left", "vel")
    assert board.velocity_move("left", 0.5, 5.0)
    board.run(0.1)
    assert board.reference("left") == pytest.approx(0.025, abs=6e-3)
    for _ in range(10):
        assert board.velocity_move("left", 0.5, 5.0)
        board.run(0.1)
    assert board.get_encoder_speed("left") == pytest.approx(0.5, abs=0.02)
    assert board.reference("left") == pytest.approx(0.525, abs=5e-3)
    board.run(0.4)
    assert board.get_encoder_speed("left") == pytest.approx(0.0, abs=0.02)
    assert board.reference("left") == pytest.approx(0.525 + 0.05 + 0.006, abs=0.01)
    assert board.get_control_mode("left") == [M.VELOCITY]
    assert not board.get_faults("left")[0].active


def test_mixed_adds_up(board: Any) -> None:
    """P6: the trajectory and the integrated velocity add up."""
    assert board.set_control_mode("left", "mix")
    assert board.position_move("left", 0.5, 1.0)
    for _ in range(10):
        assert board.velocity_move("left", 0.2, 20.0)
        board.run(0.1)
    assert board.reference("left") == pytest.approx(0.7, abs=0.01)
    assert board.check_motion_done("left") == [True]


def test_a_new_move_in_mixed_starts_where_the_joint_is(board: Any) -> None:
    """P6: a new position move takes the velocity part's contribution as its starting point."""
    assert board.set_control_mode("left", "mix")
    for _ in range(5):
        assert board.velocity_move("left", 0.5, 20.0)
        board.run(0.1)
    board.run(0.5)
    before = float(board.reference("left")[0])
    assert before > 0.2
    assert board.position_move("left", 0.1, 1.0)
    board.run(0.002)
    assert board.reference("left") == pytest.approx(before, abs=1e-3)
    board.run(1.0)
    assert board.reference("left") == pytest.approx(0.1, abs=1e-6)


def test_torque_is_tracked(board: Any) -> None:
    """P7: the measured joint torque follows its reference."""
    assert board.set_control_mode("left", "torq")
    assert board.set_ref_torque("left", 2.0)
    board.run(0.2)
    assert board.get_torque("left") == pytest.approx(2.0, abs=0.1)
    assert board.get_encoder_speed("left")[0] > 0.1


def test_limits_in_torque_and_open_loop(board: Any) -> None:
    """P9: at a limit the protection pushes back in TORQUE and OPENLOOP; the mode is unchanged."""
    for mode, method, value in (("torq", "set_ref_torque", 20.0), ("open", "set_output", 10.0)):
        for way in (1.0, -1.0):
            assert board.set_control_mode("left", mode)
            assert getattr(board, method)("left", way * value)
            board.run(6.0)
            assert 1.95 < way * board.get_encoder("left")[0] < 2.05
            board.run(0.5)
            assert board.get_encoder_speed("left") == pytest.approx(0.0, abs=0.05)
            assert board.get_control_mode("left")[0].code == mode


def test_limits_of_positions(board: Any) -> None:
    """P9: the limits bound every position reference, moves and velocities alike."""
    assert board.set_control_mode(None, ["pos", "vel", "mix"])
    assert board.position_move("left", -9.0, 3.0)
    assert board.get_target_position("left") == pytest.approx(-2.0)
    for _ in range(20):
        assert board.velocity_move(["right", "bare"], [2.0, -2.0], 20.0)
        board.run(0.1)
        assert np.all(np.abs(board.reference()) <= 2.0)
    assert board.get_encoder() == pytest.approx([-2.0, 2.0, -2.0], abs=0.02)


@pytest.mark.parametrize("mode", list(HOME), ids=str)
@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_what_is_not_finite_is_ignored(board: Any, mode: Any, value: float) -> None:
    """P13, M4: NaN and infinite references are ignored with the reason; others are served."""
    method, getter, good = COMMANDS[HOME[mode]]
    assert board.set_control_mode(["left", "right"], mode)
    before = getattr(board, getter)("left")[0]
    reply = getattr(board, method)(["left", "right"], [value, good])
    assert not reply
    assert "finite" in reply.message
    assert getattr(board, getter)(["left", "right"]) == pytest.approx([before, good])
    assert board.rejected() == [1, 0, 0]
    assert board.get_control_mode("left") == [mode]


@pytest.mark.parametrize("mode", list(HOME), ids=str)
def test_wrong_lengths_are_ignored(board: Any, mode: Any) -> None:
    """P13: references of a wrong length are ignored as a whole, with the reason."""
    method, getter, good = COMMANDS[HOME[mode]]
    assert board.set_control_mode(["left", "right"], mode)
    before = getattr(board, getter)(["left", "right"])
    reply = getattr(board, method)(["left", "right"], [good, good, good])
    assert not reply
    assert reply.message
    assert getattr(board, getter)(["left", "right"]) == pytest.approx(before)
    assert board.rejected(["left", "right"]) == [1, 1]


def test_each_kind_keeps_its_own_reference(board: Any) -> None:
    """M11, A: getters return the last accepted reference of each kind, whatever came since."""
    for mode, kind in HOME.items():
        assert board.set_control_mode(["left", "right"], mode)
        method, _, value = COMMANDS[kind]
        assert getattr(board, method)(["left", "right"], [value, -value])
    for _, getter, value in COMMANDS.values():
        assert getattr(board, getter)(["right", "left"]) == pytest.approx([-value, value])
    assert board.set_control_mode("left", "idl")
    for method, getter, value in COMMANDS.values():
        assert not getattr(board, method)("left", 2 * value)
        assert getattr(board, getter)("left") == pytest.approx(value)


def test_a_spring(board: Any) -> None:
    """I5, I6: a compliant joint is a spring: k acts at once, without a mode change."""
    assert board.set_interaction_mode("left", COMPLIANT)
    assert board.set_control_mode("left", "posd")
    assert board.set_feedforward("left", torques=5.0)
    assert board.set_impedance("left", 50.0, 10.0)
    board.run(3.0)
    assert board.get_encoder("left") == pytest.approx(5.0 / 50.0, rel=0.06)
    assert board.set_impedance("left", 100.0, 20.0)
    board.run(3.0)
    assert board.get_encoder("left") == pytest.approx(5.0 / 100.0, rel=0.06)
    assert board.get_control_mode("left") == [M.POSITION_DIRECT]
    assert board.set_interaction_mode("left", STIFF)


def test_feedforward(board: Any) -> None:
    """P11: u_ff adds to the output in an active mode, and gives nothing in IDLE."""
    assert board.set_control_mode(["left", "right"], ["open", "idl"])
    assert board.set_feedforward(["left", "right"], outputs=1.5)
    assert board.set_output("left", 2.0)
    board.run(0.01)
    assert board.power(["left", "right"]) == pytest.approx([3.5, 0.0])

# SPDX-License-Identifier: Apache-2.0
"""Pushes, blocked and blind joints, switches at full speed, broken physics: on the shipped arm.

It has masses, gravity, friction and obstacles; the ideal plant of the other tests has none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from rig import STANDARD

from control_board_ros.core.terms.faults import FaultCode as F
from control_board_ros.core.terms.measurement import Array
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.sim.errors import PlantGone
from control_board_ros.simulation import Simulation

pytestmark = pytest.mark.physics

DEGREE = math.radians(1.0)

J1, J2, J4 = (f"lbr_iiwa_joint_{k}" for k in (1, 2, 4))


@contextmanager
def iiwa(**overrides: Any) -> Iterator[Simulation]:
    """The iiwa, configured and at rest; ``overrides`` are parameters, ``__`` for the dots."""
    with Simulation.load("iiwa", **overrides) as simulation:
        simulation.run(0.2)
        yield simulation


def truth(simulation: Simulation) -> Array:
    """Where the joints truly are, whatever the encoders say, shape (n,), rad."""
    plant: Any = simulation.plant
    return plant._motors.position.copy()


def enter(simulation: Simulation, mode: M | str, joints: Any = None) -> None:
    """Set a mode, from a fault too."""
    assert simulation.board.set_control_mode(joints, M.FORCE_IDLE)
    reply = simulation.board.set_control_mode(joints, mode)
    assert reply, reply.message


# --- pushes ---------------------------------------------------------------------------------


@pytest.mark.parametrize("interaction", ["stif", "comp"])
@pytest.mark.parametrize("mode", STANDARD)
def test_a_push_within_the_range_never_faults(mode, interaction):
    """P9, F1: pushed by hand, a joint yields or holds as its mode says; nothing faults."""
    with iiwa() as simulation:
        board = simulation.board
        assert board.set_interaction_mode(J1, interaction)
        enter(simulation, mode, J1)
        simulation.plant.push(J1, 30.0)
        simulation.run(0.4)
        simulation.plant.push(J1, 0.0)
        simulation.run(0.4)
        assert board.get_control_mode(J1) == [mode]
        assert np.isfinite(board.snapshot().block).all()


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("mode", "interaction"),
    [(M.TORQUE, "stif"), (M.OPENLOOP, "stif"), (M.POSITION, "comp"), (M.VELOCITY, "comp")],
)
def test_a_push_against_a_limit_is_pushed_back(mode, interaction, side):
    """P9: beyond the limit the protection pushes back, the mode stays, one warning reports it."""
    with iiwa(lbr_iiwa_joint_1__limits__lower=-0.5, lbr_iiwa_joint_1__limits__upper=0.5) as sim:
        board = sim.board
        assert board.set_interaction_mode(J1, interaction)
        enter(sim, mode, J1)
        board.take_events()
        sim.plant.push(J1, side * 40.0)
        for _ in range(30):
            if mode is M.VELOCITY:
                board.velocity_move(J1, 0.0)
            sim.run(0.1)
            assert abs(board.get_encoder(J1)[0]) < 0.5 + 10 * DEGREE
        if mode in (M.TORQUE, M.OPENLOOP):
            texts = [event.text for event in board.take_events() if event.key == "limit"]
            assert texts
            assert "the protection pushes it back" in texts[0]
        sim.plant.push(J1, 0.0)
        sim.run(1.0)
        assert abs(board.get_encoder(J1)[0]) < 0.5 + 1.0 * DEGREE
        assert board.get_control_mode(J1) == [mode]


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(("joint", "mode"), [(J2, "torq"), (J2, "open"), (J4, "torq")])
def test_full_power_stops_at_the_limit(joint, mode, way):
    """P9 (promise P7): all the torque there is, with gravity, from far away into the limit."""
    with iiwa() as simulation:
        board, j = simulation.board, simulation.board.names.index(joint)
        enter(simulation, mode, joint)
        limits = board.config.joints[j].limits
        fastest = 0.0
        for _ in range(3000):
            if mode == "torq":
                board.set_ref_torque(joint, way * limits.torque)
            else:
                board.set_output(joint, way * 100.0)
            simulation.step()
            state = board.snapshot()
            assert limits.lower - DEGREE < state.position[j] < limits.upper + DEGREE
            fastest = max(fastest, abs(float(state.velocity[j])))
        assert 0.8 * limits.velocity < fastest < 1.1 * limits.velocity
        assert min(state.position[j] - limits.lower, limits.upper - state.position[j]) < DEGREE
        assert board.get_control_mode(joint)[0].code == mode


def test_a_push_through_the_hard_margin_is_a_fault():
    """F1, F2: beyond the hard stop by more than the margin the joint loses its power."""
    narrow = {
        f"lbr_iiwa_joint_1__limits__{key}": value
        for key, value in {
            "hard_lower": -0.5,
            "lower": -0.4,
            "hard_upper": 0.5,
            "upper": 0.4,
            "hard_margin": 0.001,
            "velocity": 20.0,  # it meets the stop before it is too fast (F7)
        }.items()
    }
    with iiwa(**narrow) as simulation:
        enter(simulation, "torq", J1)
        simulation.plant.push(J1, 600.0)
        simulation.run(1.0)
        record = simulation.board.get_faults(J1)[0]
        assert record.active
        assert record.code == F.HARD_LIMIT


# --- switches at full speed -------------------------------------------------------------------


@pytest.mark.parametrize("way", [-1.0, 1.0])
@pytest.mark.parametrize("into", STANDARD)
def test_switching_at_full_speed_stays_within_the_torque_limit(into, way):
    """M9 (promise P7): no torque beyond the joint's limit, no fault, no jump of the reference."""
    with iiwa() as simulation:
        board = simulation.board
        limits = board.config.joints[0].limits
        enter(simulation, M.VELOCITY, J1)
        for _ in range(8):
            assert board.velocity_move(J1, way * 0.98 * limits.velocity, limits.acceleration)
            simulation.run(0.1)
        before = board.snapshot()
        assert abs(before.velocity[0]) > 0.9 * limits.velocity
        assert board.set_control_mode(J1, into)
        for cycle in range(800):
            simulation.step()
            snapshot = board.snapshot()
            assert abs(snapshot.torque[0]) <= 1.02 * limits.torque, cycle
            if cycle == 0:
                travel = abs(snapshot.position[0] - before.position[0])
                assert abs(snapshot.position_reference[0] - before.position[0]) <= travel + 1e-6
        assert board.get_control_mode(J1) == [into]
        assert not board.get_faults(J1)[0].active


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_changing_the_interaction_mode_at_full_speed(way):
    """I4 (promise P7): it stops the joint, within the torque limit, both ways round."""
    with iiwa() as simulation:
        board = simulation.board
        limits = board.config.joints[0].limits
        for interaction in ("comp", "stif"):
            enter(simulation, M.VELOCITY, J1)
            for _ in range(6):
                board.velocity_move(J1, way * 0.98 * limits.velocity, limits.acceleration)
                simulation.run(0.1)
            assert board.set_interaction_mode(J1, interaction)
            for _ in range(1500):
                simulation.step()
                assert abs(board.snapshot().torque[0]) <= 1.02 * limits.torque
            assert abs(board.snapshot().velocity[0]) < 0.1
            assert not board.get_faults(J1)[0].active
            way = -way


# --- calibration ------------------------------------------------------------------------------


def calibrated_arm(**changes):
    """The iiwa, whose second joint goes from its home, 0.5, to 0.9 when it is calibrated."""
    given = {"start": 0.9, "timeout": 3.0, "speed": 0.35} | changes
    return iiwa(**{f"{J2}__calibration__{key}": value for key, value in given.items()})


def test_a_calibration_can_be_repeated():
    """K1, K3: once, twice, and from another pose."""
    with calibrated_arm() as simulation:
        board = simulation.board
        for pose in (None, 0.2, 1.2):
            if pose is not None:
                assert board.position_move(J2, pose, 1.0)
                simulation.run(1.5)
            assert board.calibrate(J2)
            simulation.run(2.9)
            assert board.get_control_mode(J2) == [M.POSITION]
            assert board.get_calibration(J2)[0].done
            assert board.get_encoder(J2)[0] == pytest.approx(0.9, abs=0.02)


def test_a_calibration_blocked_by_an_obstacle_fails_with_its_reason():
    """K4: the joint stops at the obstacle, within its torque, and says what it was doing."""
    with calibrated_arm(start=1.6) as simulation:
        board, body = simulation.board, simulation.plant.body
        x, _, z = body.link_position(5)
        body.add_obstacle((x + 0.3, 0.0, z - 0.2), (0.1, 0.5, 0.3))
        assert board.calibrate(J2)
        worst = 0.0
        for _ in range(3200):
            simulation.step()
            worst = max(worst, abs(board.snapshot().torque[1]))
        record = board.get_faults(J2)[0]
        assert board.get_control_mode(J2) == [M.HW_FAULT]
        assert record.code == F.CALIBRATION
        assert not board.get_calibration(J2)[0].done
        assert worst <= 1.5 * board.config.joints[1].limits.torque  # the blow itself included
        assert "moving to the start position" in record.text


def test_a_calibration_during_a_fast_motion_begins_smoothly():
    """K1, M9: requested in full motion, it stops the joint and then does its work."""
    with calibrated_arm(timeout=6.0) as simulation:
        board = simulation.board
        limits = board.config.joints[1].limits
        assert board.position_move(J2, -1.0, 0.5 * limits.velocity)
        simulation.run(1.0)
        assert abs(board.snapshot().velocity[1]) > 0.5
        assert board.calibrate(J2)
        for _ in range(2900):
            simulation.step()
            assert abs(board.snapshot().torque[1]) <= 1.02 * limits.torque
        simulation.run(3.0)
        assert board.get_calibration(J2)[0].done
        assert not board.get_faults(J2)[0].active


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("kind", ["encoder_frozen", "encoder_reversed"])
@pytest.mark.parametrize("joint", [J2, J4])
def test_a_blind_joint_never_runs_away_under_power(joint, kind, moving):
    """K4, F1: with a frozen or reversed encoder it is driven less than 5 degrees."""
    far = {
        f"{joint}__calibration__{key}": value
        for key, value in {"start": -0.3, "timeout": 8.0}.items()
    }
    with iiwa(**far) as simulation:
        board = simulation.board
        j = board.names.index(joint)
        if moving:
            assert board.position_move(joint, -0.3, 0.5)
            simulation.run(0.5)
        simulation.plant.inject(joint, kind, persistent=True)
        start = truth(simulation)[j]
        assert board.calibrate(joint)
        for _ in range(8100):
            simulation.step()
            if board.get_control_mode(joint) == [M.HW_FAULT]:
                break
            assert abs(truth(simulation)[j] - start) < 5.0 * DEGREE
        record = board.get_faults(joint)[0]
        assert record.active
        assert record.code in (F.ENCODER_MISMATCH, F.CALIBRATION)
        assert board.state.powered[j] == 0.0


# --- physics ----------------------------------------------------------------------------------


def test_a_diverged_simulation_comes_back():
    """F1: NaN in the physics faults every joint; the last good pose is back; it moves again."""
    with iiwa() as simulation:
        board = simulation.board
        assert board.position_move(J1, 1.0, 1.0)
        simulation.run(0.5)
        before = truth(simulation)
        simulation.plant.inject(J1, "diverged")
        simulation.run(0.002)
        assert set(board.get_control_mode()) == {M.HW_FAULT}
        assert {record.code for record in board.get_faults()} == {F.DIVERGED}
        assert np.isfinite(board.snapshot().block).all()
        np.testing.assert_allclose(truth(simulation), before, atol=0.1)
        simulation.run(0.1)
        enter(simulation, "pos")
        assert board.position_move(J1, 0.2, 0.5)
        simulation.run(4.0)
        assert board.get_encoder(J1)[0] == pytest.approx(0.2, abs=0.01)


def test_a_server_that_is_gone_says_so():
    """The physics ends under the board, in either engine: one exception of its own, one line."""
    with iiwa() as simulation:
        simulation.plant.body.close()
        text = "^the physics (server is gone|is closed); restart the board$"
        with pytest.raises(PlantGone, match=text):
            simulation.run(0.1)


def test_the_same_commands_give_bit_identical_states():
    """Promise P9: two arms in two physics servers, the same commands, the same bits."""

    def run():
        with iiwa() as simulation:
            board, rows = simulation.board, []
            for cycle in range(1200):
                if cycle == 5:
                    board.position_move(None, [0.3, 0.7, -0.2, -1.0, 0.4, 0.5, 0.1], 0.5)
                if cycle == 400:
                    board.set_interaction_mode([J1, J4], "comp")
                if cycle == 500:
                    board.set_control_mode(J2, "torq")
                if cycle == 700:
                    simulation.plant.push(J4, 20.0)
                if cycle == 800:
                    simulation.plant.inject(J1, "overcurrent")
                simulation.step()
                rows.append(board.snapshot().block.tobytes())
            return rows

    assert run() == run()

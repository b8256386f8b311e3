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
from control_board_ros.simulation import Simulation

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

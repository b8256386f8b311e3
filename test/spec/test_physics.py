# SPDX-License-Identifier: Apache-2.0
"""Rules in which motion matters, on every engine: a pendulum under gravity."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from plants import ENGINES
from rig import COMPLIANT, M, Rig, board_config, joint

from control_board_ros.description.urdf import parse
from control_board_ros.sim.config import JointSimulation, SimulationConfig
from control_board_ros.sim.plant import SimulatedPlant

MASS, LENGTH, GRAVITY, INERTIA = 2.0, 0.5, 9.81, 0.02
#: θ is measured from the upright: gravity pulls with m g l sin θ.
PENDULUM = f"""<robot name="pendulum">
<link name="base"/>
<link name="rod"><inertial><origin xyz="0 0 {LENGTH}"/><mass value="{MASS}"/>
<inertia ixx="{INERTIA}" iyy="{INERTIA}" izz="{INERTIA}" ixy="0" ixz="0" iyz="0"/></inertial>
</link>
<joint name="left" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<limit lower="-2.2" upper="2.2" effort="60" velocity="3"/></joint>
</robot>"""


def weight(angle: float) -> float:
    """The torque of gravity, N·m."""
    return MASS * GRAVITY * LENGTH * math.sin(angle)


@pytest.fixture(params=ENGINES)
def pendulum(request: pytest.FixtureRequest) -> Iterator[Rig]:
    config = board_config(joint("left", startup_mode=M.POSITION), control_rate=1000.0)
    simulation = SimulationConfig(
        joints=(JointSimulation(name="left"),),
        urdf=parse(PENDULUM.encode(), "pendulum", Path()),
        physics=request.param,
        physics_rate=1000.0,
    )
    plant = SimulatedPlant(config, simulation)
    yield Rig(config, plant)
    plant.close()


def held_at(rig: Rig, angle: float) -> Any:
    """Move there in POSITION, and wait until it is still."""
    rig.tick(2)
    assert rig.board.position_move("left", angle, 1.0)
    return rig.run(4.0)


@pytest.mark.parametrize("angle", [-1.5, -0.7, 0.4, 1.2])
def test_a_pendulum_is_held_by_its_weight(pendulum: Rig, angle: float) -> None:
    """P7, I5, M9: held, the torque is −m g l sin θ; TORQUE takes it over without a drop."""
    shown = held_at(pendulum, angle)
    assert shown.position[0] == pytest.approx(angle, abs=2e-3)
    assert shown.torque[0] == pytest.approx(-weight(angle), rel=0.01)
    pendulum.board.set_control_mode("left", "torq")
    shown = pendulum.run(0.2)
    assert shown.position[0] == pytest.approx(angle, abs=0.01)
    assert shown.torque[0] == pytest.approx(-weight(angle), rel=0.02)


@pytest.mark.parametrize("angle", [0.3, 1.0])
def test_a_pendulum_in_torque_mode(pendulum: Rig, angle: float) -> None:
    """P7: θ'' = (m g l sin θ + τ) / (m l² + I), for τ = 0 and for others."""
    inertia = MASS * LENGTH**2 + INERTIA
    for torque in (0.0, -weight(angle), 4.0):
        start = held_at(pendulum, angle)
        pendulum.board.set_control_mode("left", "torq")
        pendulum.board.set_ref_torque("left", torque)
        shown = pendulum.run(0.06)
        speed = (weight(angle) + torque) / inertia * 0.06
        assert shown.velocity[0] == pytest.approx(speed, rel=0.12, abs=0.02)
        assert shown.torque[0] == pytest.approx(torque, abs=0.2)
        assert start.velocity[0] == pytest.approx(0.0, abs=1e-3)
        pendulum.enter("pos")


def test_a_compliant_pendulum_hangs_on_its_spring(pendulum: Rig) -> None:
    """I5, I6, P11: k (q_ref − q) + τ_ff carries m g l sin q."""
    held_at(pendulum, 0.5)
    board = pendulum.board
    board.set_impedance("left", 100.0, 10.0)
    assert board.set_interaction_mode("left", COMPLIANT)
    shown = pendulum.run(2.0)
    assert shown.position[0] == pytest.approx(0.5, abs=5e-3)  # its load is carried
    board.set_feedforward("left", torques=0.0)
    shown = pendulum.run(4.0)
    sag = float(shown.position[0]) - float(shown.position_reference[0])
    assert sag > 0.02
    assert 100.0 * sag == pytest.approx(weight(float(shown.position[0])), rel=0.05)


def test_idle_lets_it_fall(pendulum: Rig) -> None:
    """M10, F1: without power nothing holds the joint but its own weight decides."""
    held_at(pendulum, 0.5)
    pendulum.board.set_control_mode("left", "idl")
    shown = pendulum.run(0.1)
    assert shown.torque[0] == pytest.approx(0.0, abs=0.05)
    speed = weight(0.5) / (MASS * LENGTH**2 + INERTIA) * 0.1
    assert shown.velocity[0] == pytest.approx(speed, rel=0.1)

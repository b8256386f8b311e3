# SPDX-License-Identifier: Apache-2.0
"""Robots from elsewhere, by the path of their URDF, at speed and without a fault (F1, F6).

Here for seconds of simulated time; CONTROL_BOARD_SECONDS=120 makes it minutes.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from plants import joint, link, robot

from control_board_ros.simulation import Simulation

DATA = Path(pybullet_data.getDataPath())
HERE = Path(__file__).parent
SECONDS = float(os.environ.get("CONTROL_BOARD_SECONDS", "6"))
ROBOTS = {
    "cartpole": DATA / "cartpole.urdf",
    "r2d2": DATA / "r2d2.urdf",
    "kuka": DATA / "kuka_iiwa" / "model.urdf",
    "gantry": HERE / "gantry.urdf",
    "chain": None,
}


def chain(count: int) -> str:
    """A snake of links of 0.2 kg, 0.1 m long, that bends sideways and up in turn."""
    parts = []
    for number in range(count):
        axis = ("0 0 1", "0 1 0")[number % 2]
        parent = f"link_{number - 1}" if number else "base"
        at = f'<origin xyz="{0.1 if number else 0.0} 0 0"/>'
        moments = "1e-4 3e-4 3e-4 0 0 0"
        parts.append(link(f"link_{number}", 0.2, "0.05 0 0", moments))
        parts.append(joint(f"joint_{number}", parent, f"link_{number}", axis=axis, rest=at))
    return robot(*parts)


def path_of(name: str, folder: Path) -> str:
    """The robot's file; the chain's is written."""
    if (found := ROBOTS[name]) is not None:
        return str(found)
    (folder / "chain.urdf").write_text(chain(20))
    return str(folder / "chain.urdf")


def wander(simulation: Simulation, random: np.random.Generator) -> None:
    """Give every joint something else to do: a move, a step or a velocity."""
    board = simulation.board
    for j, one in enumerate(board.config.joints):
        limits = one.limits
        low, high = max(limits.lower, -3.0), min(limits.upper, 3.0)
        mode = str(random.choice(["pos", "posd", "vel"]))
        assert board.set_control_mode(j, mode)
        if mode == "pos":
            board.set_ref_speed(j, limits.velocity * random.uniform(0.1, 1.0))
            assert board.position_move(j, random.uniform(low, high))
        elif mode == "posd":
            step = random.uniform(-0.05, 0.05) * min(high - low, 1.0)
            assert board.set_position(j, board.state.position[j] + step)
        else:
            assert board.velocity_move(j, limits.velocity * random.uniform(-0.5, 0.5))


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_from_elsewhere_moves_at_speed_without_a_fault(name: str, tmp_path: Path) -> None:
    """F1, F6: no false alarm; the motor's own travel agrees with the encoder's."""
    random = np.random.default_rng(7)
    with Simulation.load(None, robot=path_of(name, tmp_path)) as simulation:
        board = simulation.board
        simulation.step(3)
        travelled = np.zeros(board.count)
        while simulation.time < SECONDS:
            wander(simulation, random)
            for _ in range(int(random.integers(50, 800))):
                simulation.step()
                travelled += np.abs(board.state.velocity) * board.period
                for monitor in board.engine.monitor.joints:
                    assert abs(monitor.travel) < 0.5 * monitor.max_travel
            faults = [
                f"{fault.name}: {fault.text}" for fault in board.get_faults() if fault.active
            ]
            assert faults == [], simulation.time
        assert (travelled > 0.02).all()


@pytest.mark.parametrize("output", ["pwm", "current"])
@pytest.mark.parametrize("rate", [200.0, 300.0, 1000.0, 4000.0])
@pytest.mark.parametrize("name", ["iiwa", "panda", "kuka"])
def test_gains_hold_from_200_to_4000_hz(name: str, rate: float, output: str) -> None:
    """P10: an arm moves at half its speed limit, is at rest afterwards, and nothing faults."""
    robot_name = path_of(name, Path()) if name in ROBOTS else name
    with Simulation.load(None, robot=robot_name, control_rate=rate, output=output) as simulation:
        board = simulation.board
        simulation.step(3)
        for j, one in enumerate(board.config.joints):
            board.set_ref_speed(j, 0.5 * one.limits.velocity)
            here = float(board.state.position[j])
            way = 0.3 * one.limits.velocity
            away = here + way if here + way < one.limits.upper else here - way
            assert board.position_move(j, away)
        lasting = float(board.get_remaining_time(None).max())  # as long as the torques ask for
        simulation.run(lasting + (0.5 if rate > 500.0 else 2.5))  # slow loops settle slowly
        fastest = np.zeros(board.count)
        for _ in range(round(0.2 * rate)):
            simulation.step()
            fastest = np.maximum(fastest, np.abs(board.state.velocity))
        assert [fault.text for fault in board.get_faults() if fault.active] == []
        assert fastest.max() < 0.01

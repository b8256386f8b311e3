# SPDX-License-Identifier: Apache-2.0
"""B19: the whole iCub with hands, 53 axes and 75 joints, beside the bare physics of the same."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.util import find_spec
from statistics import median
from typing import Any

import numpy as np
from common import Effort, Figure, at_most, number

from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.settings import loading as settings
from control_board_ros.sim.plant import make_body
from control_board_ros.simulation import Simulation, made_board

#: Cycles that are timed at a time, one after the other of each.
CHUNK = 200
#: Cycles until every joint is calibrated, and the arms have moved.
READY, MOVED = 12_000, 3_000
#: Largest share of a core at 1 kHz, %, and largest ratio to the bare cycle.
PROCESSOR, RATIO = 60.0, 1.5


def run(effort: Effort) -> list[Figure]:
    """Time cycles of board, motors and couplings in turns with the engine's (extra icub)."""
    if find_spec("icub_models") is None:
        return []
    engines = [name for name in ("pybullet", "mujoco") if find_spec(name) is not None]
    return [figure for engine in engines for figure in _with(engine, effort)]


def _with(engine: str, effort: Effort) -> list[Figure]:
    made = settings.load("icub_hands", {"physics": engine})
    with Simulation(made_board(made), made.simulation) as simulation:
        simulation.step(effort.of(READY, READY, CHUNK))
        _move(simulation)
        simulation.step(effort.of(MOVED, MOVED, CHUNK))
        alone = make_body(simulation.board.config, made.simulation)
        alone.attach(np.zeros((2, simulation.board.count)))
        alone.restore(_state(simulation))
        physics = _bare(engine, alone, _state(simulation))
        ours: list[float] = []
        bare: list[float] = []
        for _ in range(effort.of(15, 7, 1)):
            ours.append(_timed(lambda: simulation.step(CHUNK)))
            bare.append(_timed(physics))
        alone.close()
    ratio = median(mine / other for mine, other in zip(ours, bare, strict=True))
    text = f"{number(median(ours))} against {number(median(bare))} µs of CPU"
    return [
        Figure(
            "B19",
            f"iCub with hands, 53 axes and 75 joints: a cycle beside the engine's ({engine})",
            ratio,
            "×",
            at_most(RATIO),
            text,
        ),
        Figure(
            "B19",
            f"iCub with hands: processor of these cycles at 1 kHz ({engine})",
            0.1 * median(ours),
            "%",
            at_most(PROCESSOR),
            "of one core, without ROS",
        ),
    ]


def _move(simulation: Simulation) -> None:
    """A part of the range of each axis of arms, hands and head, from where it is."""
    board = simulation.board
    legs = ("hip", "knee", "ankle", "torso")
    moved = [name for name in board.names if not any(word in name for word in legs)]
    where = [board.names.index(name) for name in moved]
    limits = board.engine.limits
    lower, upper = limits.lower[where], limits.upper[where]
    board.set_control_mode(moved, ControlMode.POSITION)
    target = board.get_encoder(moved) + 0.25 * (upper - lower)
    board.position_move(moved, np.clip(target, lower, upper), 0.3)


def _state(simulation: Simulation) -> Any:
    """Positions and velocities of the axes, shape (2, n)."""
    board = simulation.board
    return np.array([board.get_encoder(), board.get_encoder_speed()])


def _bare(engine: str, body: Any, state: Any) -> Callable[[], None]:
    """What the engine does in as many cycles: torques in, one step, positions and velocities out.

    The torques are zeros: what they are costs the engine nothing.
    """
    world = body.engine
    if engine == "mujoco":
        import mujoco

        model, data, torques = world._model, world._data, np.zeros(world._model.nv)

        def in_mujoco() -> None:
            body.restore(state)
            for _ in range(CHUNK):
                data.qfrc_applied[:] = torques
                mujoco.mj_step(model, data)
                data.qpos.copy()
                data.qvel.copy()

        return in_mujoco
    from control_board_ros.sim.bodies.world import bullet

    robot, joints, client = world._body, world._joints, world._client
    nothing = [0.0] * len(joints)

    def in_pybullet() -> None:
        body.restore(state)
        for _ in range(CHUNK):
            bullet.setJointMotorControlArray(
                robot, joints, bullet.TORQUE_CONTROL, forces=nothing, physicsClientId=client
            )
            bullet.stepSimulation(client)
            bullet.getJointStates(robot, joints, client)

    return in_pybullet


def _timed(work: Callable[[], None]) -> float:
    """CPU time of a cycle of a chunk, µs."""
    begin = time.process_time()
    work()
    return 1e6 * (time.process_time() - begin) / CHUNK

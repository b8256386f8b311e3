# SPDX-License-Identifier: Apache-2.0
"""Robots whose true properties the board does not know, with noise and steps in their sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from motion_bench import Bench
from scara import SCARA

from control_board_ros.core.terms.measurement import Measurement, Motor, Row
from control_board_ros.identification.motions import bounds_of, motions_of
from control_board_ros.identification.outcome import Outcome, identify, little_of
from control_board_ros.identification.robot import Robot
from control_board_ros.identification.samples import Record
from control_board_ros.settings.loading import load
from control_board_ros.sim.plant import SimulatedPlant
from control_board_ros.simulation import Simulation
from control_board_ros.tuning.scenes import with_payload

#: Noise (standard deviation) of position, rad, and velocity, rad/s; of torque and current as
#: shares of the torque limit and of the nominal current; steps of both, likewise.
NOISE = (1e-5, 1e-3, 1e-3, 2e-3)
STEPS = (2e-4, 5e-4)
#: Of the board: gains for a delay, which those of drives are within.
CAUTIOUS = {"joint_defaults.drive_delay": 0.004}
Bent = Callable[[Measurement, np.ndarray], Measurement]


#: Robots of the grid: what is loaded, and the payload, kg; scara is a derived URDF.
ROBOTS = {"iiwa": ("iiwa", 1.5), "panda": ("panda", 0.6), "scara": (str(SCARA), 0.5)}
#: Joints of each seed, from 1: those of all seeds are the whole arm. An arm of less has all.
GRID = {1: (2, 4, 6), 2: (1, 4, 5), 3: (3, 6, 7)}
ENGINES = ("mujoco", "pybullet")
FRICTION = ("coulomb", "viscous", "breakaway")


class HiddenPlant(SimulatedPlant):
    """A simulated plant with noisy sensors; ``bent`` changes its readings: a loose belt."""

    random: np.random.Generator
    torques: np.ndarray
    currents: np.ndarray
    bent: Bent | None = None

    def read(self) -> Measurement:
        found = super().read()
        values, random = found.values.copy(), self.random
        scales = (1.0, 1.0, self.torques, self.currents)
        rows = (Row.POSITION, Row.VELOCITY, Row.TORQUE, Row.CURRENT)
        for row, noise, scale in zip(rows, NOISE, scales, strict=True):
            values[row] += noise * scale * random.standard_normal(values.shape[1])
        for row, step, scale in zip(rows[2:], STEPS, scales[2:], strict=True):
            values[row] = np.rint(values[row] / (step * scale)) * (step * scale)
        made = replace(found, values=values)
        return made if self.bent is None else self.bent(made, values)


class Hidden:
    """A board with the parameters of its file, and a plant with other ones.

    Args:
        robot: A shipped robot, or the path of a URDF.
        physics: The engine.
        joints: That are identified.
        truth: Parameters of the plant, by full name.
        payload: At its last link, kg.
        seed: Of the noise.
        believed: Parameters of the board, beyond its file.
    """

    def __init__(
        self,
        robot: str,
        physics: str,
        joints: Sequence[str],
        truth: Mapping[str, Any],
        payload: float = 0.0,
        seed: int = 1,
        believed: Mapping[str, Any] | None = None,
    ) -> None:
        base = {"physics": physics, "joint_defaults.calibration.required": False}
        base |= {"robot": robot} if Path(robot).suffix == ".urdf" else {}
        source = None if "robot" in base else robot
        board = load(source, base | CAUTIOUS | dict(believed or {}))
        true = load(source, base | dict(truth))
        plant = replace(true.simulation, joints=tuple(true.simulation.joints))
        if payload:
            assert plant.urdf is not None
            plant = replace(plant, urdf=with_payload(plant.urdf, true.board.names, payload))
        self.payload = payload
        self.robot, self.joints, self.truth = Robot.of(board), list(joints), true.values
        self.simulation = Simulation(board.board, board.simulation)
        self.simulation.plant.close()
        hidden = HiddenPlant(true.board, plant)
        hidden.random = np.random.default_rng(seed)
        hidden.torques = np.array([one.limits.torque for one in true.board.joints])
        hidden.currents = np.array([one.limits.nominal_current for one in true.board.joints])
        self.plant = self.simulation.plant = hidden
        self.simulation.step(3)

    def records(self, **shares: float) -> list[Record]:
        """Play all motions."""
        bench, names = Bench(self.simulation), self.robot.names
        state = self.simulation.board.state
        bounds = [
            bounds_of(
                joint,
                self.robot.kind(joint),
                bench.limits(joint),
                float(state.position[names.index(joint)]),
                **shares,
            )
            for joint in self.joints
        ]
        try:
            return bench.play(motions_of(bounds), bounds)
        finally:
            self.simulation.close()

    def identified(self, *, payload: bool = True, **shares: float) -> Outcome:
        """Play all motions and identify."""
        return identify(self.robot, self.records(**shares), self.joints, payload=payload)


def of_grid(robot: str, physics: str, seed: int) -> Hidden:
    """A cell of the grid: some joints of an arm, and what it carries."""
    source, payload = ROBOTS[robot]
    own = load(None, {"robot": source}) if robot == "scara" else load(source)
    names = own.board.names
    joints = list(names) if len(names) < 7 else [names[k - 1] for k in GRID[seed]]
    truth = drawn(source, joints, seed, physics)
    return Hidden(source, physics, joints, truth, payload, seed)


@dataclass(frozen=True, slots=True)
class Miss:
    """How far a finding is from the truth.

    Attributes: joint, quantity, truth and found (SI units), sure (half width of the interval),
    why (it is not written; empty: it is), least (what does not matter).
    """

    joint: str
    quantity: str
    truth: float
    found: float
    sure: float
    why: str
    least: float

    @property
    def error(self) -> float:
        """As a share of the truth."""
        return abs(self.found - self.truth) / abs(self.truth) if self.truth else float("inf")

    @property
    def allowed(self) -> bool:
        """Within 10 % (friction) or 5 %."""
        share = 0.1 if self.quantity in FRICTION else 0.05
        return abs(self.found - self.truth) <= max(share * abs(self.truth), self.least)


def misses(hidden: Hidden, outcome: Outcome) -> list[Miss]:
    """Every finding against its truth."""
    found = []
    for one in outcome.findings:
        least = 1e-2 if one.quantity == "center" else 0.0
        least = least or little_of(hidden.robot, one.joint, one.quantity)
        truths: Sequence[float] = [0.0]
        if one.quantity == "center":
            truths = [0.0, 0.0, 0.0]
        elif one.quantity == "mass":
            truths = [hidden.payload]
        else:
            truths = [float(hidden.truth[one.parameter])]
        for truth, value, sure in zip(truths, one.value, one.sure, strict=True):
            found.append(Miss(one.joint, one.quantity, truth, value, sure, one.why, least))
    return found


def drawn(robot: str, joints: Sequence[str], seed: int, physics: str) -> dict[str, float]:
    """Truths of joints, drawn around the parameters of a robot."""
    base = {"physics": physics}
    base |= {"robot": robot} if Path(robot).suffix == ".urdf" else {}
    settings, random = load(None if "robot" in base else robot, base), np.random.default_rng(seed)
    truth: dict[str, float] = {}
    for joint in settings.board.joints:
        if joint.name not in joints:
            continue
        name, limits = joint.name, joint.limits
        coulomb = random.uniform(0.005, 0.012) * limits.torque
        truth |= {
            f"{name}.motor.coulomb": coulomb,
            f"{name}.motor.breakaway": coulomb * random.uniform(1.2, 1.5),
            f"{name}.motor.viscous": random.uniform(0.01, 0.03) * limits.torque / limits.velocity,
            f"{name}.motor.inertia": settings.values[f"{name}.motor.inertia"]
            * random.uniform(0.7, 1.5),
            f"{name}.motor.torque_constant": joint.motor.torque_constant
            * random.uniform(0.94, 1.06),
            f"{name}.drive_delay": 1e-3 * float(random.integers(1, 3)),
        }
    return truth


class LooseBelt:
    """Play between a joint and its motor: the joint follows when the play is taken up.

    Args:
        column: The joint.
        play: rad.
        ratio: Motor turns per joint turn.
    """

    def __init__(self, column: int, play: float, ratio: float) -> None:
        self._column, self._half, self._ratio, self._joint = column, 0.5 * play, ratio, np.nan

    def __call__(self, measurement: Measurement, values: np.ndarray) -> Measurement:
        motor = float(values[Row.POSITION, self._column])
        if not np.isfinite(self._joint):
            self._joint = motor
        self._joint = min(max(self._joint, motor - self._half), motor + self._half)
        values[Row.POSITION, self._column] = self._joint
        return measurement


class WrongGear:
    """A motor that turns other than the parameters say, as its encoder reads it."""

    def __init__(self, column: int, factor: float) -> None:
        self._column, self._factor = column, factor

    def __call__(self, measurement: Measurement, values: np.ndarray) -> Measurement:
        assert measurement.motors is not None
        motors = measurement.motors.copy()
        motors[Motor.POSITION : Motor.VELOCITY + 1, self._column] *= self._factor
        return replace(measurement, motors=motors)

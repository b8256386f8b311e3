# SPDX-License-Identifier: Apache-2.0
"""How hard a hand must push an SO-101 whose servos take positions only: decision 35's table.

    python benchmark/guided_servos.py

A board in COMPLIANT with the parameters of docs/howto/guide_and_replay.md, in simulated time, on
six servos in MuJoCo. A hand pushes the gripper with a force that rises by 0.5 N/s, along x, y and
z both ways in five poses, until it has moved by 5 cm; then it lets go. Servos, of an STS3215 at
7.4 V: Rhoban's BAM (params/feetech_sts3215_7_4V/m1.json at 1b5a1ce), with dry friction that really
sticks.
"""

from __future__ import annotations

import math
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import mujoco
import numpy as np

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import BoardConfig
from control_board_ros.core.terms.drives import OnSilence, SetPoint
from control_board_ros.core.terms.measurement import ROWS, Actuation, Measurement, Row, Value
from control_board_ros.core.terms.vocabs import InteractionMode
from control_board_ros.plants.interface import Description, JointDescription
from control_board_ros.plants.offers import within
from control_board_ros.settings.loading import load

#: N·m/A, Ω, V, N·m, N·m·s/rad, kg·m² at the output; duty per rad of error and unit of its gain.
CONSTANT, RESISTANCE, SUPPLY = 1.21164, 2.67617, 7.4
DRY, VISCOUS, ROTOR, GAIN, DUTY = 0.0523930, 0.0590852, 0.0284034, 0.166, 0.97
#: Of the readings: rad, A, Hz of a new velocity, and its low pass; Hz of the exchanges.
COUNT, AMPERE, SPEEDS, SMOOTH, RATE = 2.0 * math.pi / 4096.0, 6.5e-3, 100, 0.4, 200
#: s of a physics step.
STEP = 1e-3
#: N/s, N, m of the hand; s after it lets go, and without a hand.
RISE, HARDEST, WAY, AFTER, ALONE = 0.5, 10.0, 0.05, 10.0, 60.0
Poses = Sequence[tuple[float, ...]]
POSES: Poses = (
    (0.0, -0.5, 0.5, 0.3, 0.0, 0.3),
    (0.5, 0.0, 0.0, 0.0, 0.0, 0.3),
    (0.0, 0.8, -0.8, 0.5, 0.0, 0.3),
    (-0.7, -1.2, 1.2, -0.5, 0.5, 0.3),
    (0.0, 0.0, -1.2, 1.2, 0.0, 0.3),
)
HAND = "gripper_frame_link"
URDF = Path(__file__).resolve().parent.parent / "test" / "support" / "so101.urdf"
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
NOTHING = np.zeros(3)
#: Parameters of a board with such servos.
SERVOS: dict[str, Any] = {
    "control_rate": float(RATE),
    "plant": "feetech",
    "joint_defaults.calibration.required": False,
    "joint_defaults.on_silence": "braked",
    "joint_defaults.motor.gear_ratio": 345.0,
    "joint_defaults.motor.torque_constant": CONSTANT / 345.0,
    "joint_defaults.motor.resistance": RESISTANCE,
    "joint_defaults.motor.supply_voltage": SUPPLY,
    "joint_defaults.motor.coulomb": DRY,
    "joint_defaults.motor.viscous": VISCOUS,
    "joint_defaults.motor.inertia": ROTOR / 345.0**2,
    "joint_defaults.limits.torque": 1.6,
    "joint_defaults.limits.velocity": 3.0,
    "joint_defaults.admittance.dead_band": 0.08,
}


@dataclass(frozen=True, slots=True)
class Case:
    """A case: gain of the servos, error of the weight that the board knows, friction by load."""

    name: str
    gain: int = 32
    error: float = 0.0
    by_load: float = 0.0

    @property
    def stiffness(self) -> float:
        """Of a servo, N·m/rad."""
        return self.gain * GAIN * SUPPLY / RESISTANCE * CONSTANT


CASES = (
    Case("as published"),
    Case("weight known 10 % too great", error=0.1),
    Case("weight known 10 % too small", error=-0.1),
    Case("gain 16, as LeRobot sets it", gain=16),
    Case("friction grows by 15 % of the load", by_load=0.15),
    Case("friction grows by 25 % of the load", by_load=0.25),
)


class Servos:
    """An SO-101 on its servos, a plant that a hand pushes."""

    def __init__(self, case: Case, pose: tuple[float, ...]) -> None:
        self._model, self._case = true_arm(), case
        self.data = mujoco.MjData(self._model)
        n = self._model.nv
        self.data.qpos[:] = pose[:n]
        mujoco.mj_forward(self._model, self.data)
        self._speed, self._seen = np.zeros(n), np.array(pose[:n])
        self._current, self._goal = np.zeros(n), np.array(pose[:n])
        self._values, self._cycle = np.zeros((ROWS, n)), 0
        self._values[Row.TEMPERATURE] = 30.0
        self._body = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, HAND)
        self.force, self.powered = NOTHING, np.zeros(n)

    @property
    def hand(self) -> np.ndarray:
        """Where it is, m."""
        return np.array(self.data.xpos[self._body])

    def read(self) -> Measurement:
        place = np.rint(self.data.qpos / COUNT) * COUNT
        if self._cycle % (RATE // SPEEDS) == 0:
            self._speed += SMOOTH * ((place - self._seen) * SPEEDS - self._speed)
            self._seen = place
        self._values[Row.POSITION], self._values[Row.VELOCITY] = place, self._speed
        self._values[Row.CURRENT] = np.rint(self._current / AMPERE) * AMPERE
        return Measurement(self._cycle / RATE, self._values)

    def write(self, actuation: Actuation) -> None:
        model, data, case = self._model, self.data, self._case
        assert actuation.values is not None
        self._goal = np.rint(actuation.values[Value.POSITION] / COUNT) * COUNT
        self._cycle += 1
        for _ in range(round(1.0 / (RATE * STEP))):
            duty = np.clip((self._goal - data.qpos) * case.gain * GAIN, -DUTY, DUTY)
            current = (duty * SUPPLY - CONSTANT * data.qvel) / RESISTANCE
            self._current = np.where(actuation.powered > 0.0, current, 0.0)
            data.qfrc_applied[:] = CONSTANT * self._current
            model.dof_frictionloss[:] = DRY + case.by_load * np.abs(data.qfrc_bias)
            data.xfrc_applied[self._body, :3] = self.force
            mujoco.mj_step(model, data)


class Arm:
    """A board that drives the servos, in POSITION."""

    def __init__(
        self, config: BoardConfig, case: Case = CASES[0], pose: tuple[float, ...] = POSES[0]
    ) -> None:
        self.servos, self.board = Servos(case, pose), Board(config)
        self.run(1.0)  # it sags

    def guide(self) -> None:
        """COMPLIANT, as ``cbctl guide`` makes it."""
        nothing = [0.0] * len(self.board.config.joints)
        self._expect(self.board.set_impedance(None, nothing, nothing))
        self._expect(self.board.set_interaction_mode(None, InteractionMode.COMPLIANT))
        self.run(0.5)

    @property
    def places(self) -> np.ndarray:
        """Of the joints, rad."""
        return np.array(self.servos.data.qpos)

    @property
    def goals(self) -> np.ndarray:
        """Of the servos, rad."""
        return np.array(self.board.state.set_points[Value.POSITION])

    def run(self, seconds: float, force: np.ndarray = NOTHING) -> None:
        self.servos.force = force
        for _ in range(round(seconds * RATE)):
            self.servos.write(self.board.tick(self.servos.read()))

    def _expect(self, reply: Any) -> None:
        if not reply:
            raise RuntimeError(reply.message)


def true_arm() -> mujoco.MjModel:
    """The arm with the servos' friction and rotors."""
    root = ET.parse(URDF).getroot()
    compiler = {"fusestatic": "false", "boundmass": "1e-6", "boundinertia": "1e-9"}
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", compiler)
    made = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    made.opt.timestep = STEP
    made.dof_damping[:], made.dof_armature[:] = VISCOUS, ROTOR
    made.dof_solref[:] = 2.0 * STEP, 1.0
    made.dof_solimp[:, :2] = 0.995, 0.999
    return made


def known(case: Case = CASES[0], **values: Any) -> BoardConfig:
    """The configuration of a board of the servos, with a case's error of the masses.

    Args:
        case: What it knows.
        values: Parameters on top, ``__`` for the dots.
    """
    root = ET.parse(URDF).getroot()
    for inertial in root.iter("inertial"):
        for part in (*inertial.findall("mass"), *inertial.findall("inertia")):
            for key, text in part.attrib.items():
                part.set(key, repr(float(text) * (1.0 + case.error)))
    more = {key.replace("__", "."): value for key, value in values.items()}
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / URDF.name
        target.write_text(ET.tostring(root, encoding="unicode"), "utf-8")
        more |= {"joint_defaults.position_pid.kp": case.stiffness}
        settings = load(None, SERVOS | {"robot": str(target), "joints": list(JOINTS)} | more)
    servos = [
        JointDescription(
            name=name,
            set_points=(SetPoint.POSITION,),
            on_silence=(OnSilence.BRAKED,),
            current_sensor=True,
        )
        for name in JOINTS
    ]
    return within(settings, "servos", Description(joints=tuple(servos))).board


def pushes(case: Case, poses: Poses = POSES) -> Iterator[tuple[float, float]]:
    """Of each push: N at which the hand has moved by WAY, and ° a joint moves after letting go."""
    config = known(case)
    for pose in poses:
        for direction in (*np.eye(3), *-np.eye(3)):
            arm = Arm(config, case, pose)
            arm.guide()
            begin, force = arm.servos.hand, 0.0
            while (arm.servos.hand - begin) @ direction < WAY and force < HARDEST:
                force += RISE / RATE
                arm.run(1.0 / RATE, force * direction)
            left = arm.places
            arm.run(AFTER)
            moved = math.degrees(float(np.abs(arm.places - left).max()))
            yield (force if force < HARDEST else math.inf), moved


def drift(case: Case, poses: Poses = POSES) -> float:
    """The most that a servo's goal moves by itself in ALONE s, °."""
    most, config = 0.0, known(case)
    for pose in poses:
        arm = Arm(config, case, pose)
        arm.guide()
        begin = arm.goals
        arm.run(ALONE)
        most = max(most, math.degrees(float(np.abs(arm.goals - begin).max())))
    return most


def cost() -> tuple[float, float]:
    """CPU time of a cycle in COMPLIANT and in POSITION, s: the least of 40."""
    arm = Arm(known())
    reading, cycles, least = arm.servos.read(), 500, []
    for mode in (InteractionMode.COMPLIANT, InteractionMode.STIFF):
        arm.board.set_interaction_mode(None, mode)
        times = []
        for _ in range(40):
            begin = process_time()
            for _ in range(cycles):
                arm.board.tick(reading)
            times.append((process_time() - begin) / cycles)
        least.append(min(times))
    return least[0], least[1]


def main() -> None:
    print("| case | push, median | greatest | not moved by 10 N | after letting go | alone |")
    print("|---|---|---|---|---|---|")
    for case in CASES:
        found = list(pushes(case))
        forces = [force for force, _ in found if math.isfinite(force)]
        moved = [one for force, one in found if math.isfinite(force)]
        print(
            f"| {case.name} | {median(forces):.1f} N | {max(forces):.1f} N | "
            f"{len(found) - len(forces)} of {len(found)} | {median(moved):.1f}°, "
            f"{max(moved):.1f}° at most | {drift(case):.2f}° in {ALONE:.0f} s |",
            flush=True,
        )
    yielding, stiff = (1e6 * seconds for seconds in cost())
    print(f"\n{yielding:.2f} µs a cycle of six joints, {stiff:.2f} µs in STIFF")


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""How hard a hand must push an SO-101 whose servos take positions only: decision 35's table.

    python benchmark/guided_servos.py so101_new_calib.urdf

A prototype of COMPLIANT as an admittance, in simulated time (MuJoCo), without a board: each
position goal moves by what the current says of the hand, d ġ = τ − D sign τ where |τ| exceeds D,

    τ = M q̈ + g(q) + F(q̇) − kₜ i,  low-passed at 5 Hz,  D = 1.5 F₀ + 0.1 |g(q)|

A hand pushes the gripper with a force that rises by 0.5 N/s, along x, y and z both ways in five
poses, until it has moved by 5 cm; then it lets go. Servos, of an STS3215 at 7.4 V: Rhoban's BAM
(params/feetech_sts3215_7_4V/m1.json at 1b5a1ce), with dry friction that really sticks.
"""

from __future__ import annotations

import argparse
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import mujoco
import numpy as np

#: N·m/A, Ω, V, N·m, N·m·s/rad, kg·m² at the output; duty per rad of error and unit of its gain.
CONSTANT, RESISTANCE, SUPPLY = 1.21164, 2.67617, 7.4
DRY, VISCOUS, ROTOR, GAIN, DUTY = 0.0523930, 0.0590852, 0.0284034, 0.166, 0.97
#: Of the readings: rad, A; and their rate, Hz.
COUNT, AMPERE, RATE = 2.0 * math.pi / 4096.0, 6.5e-3, 100
#: s of a physics step; bandwidth, Hz; N·m·s/rad; rad/s that goals move at most.
STEP, BANDWIDTH, DAMPING, FASTEST = 1e-3, 5.0, 0.5, 1.5
#: Not felt: share of the weight, times dry friction. rad/s up to which a joint rests.
WEIGHT, STUCK, SLIP = 0.1, 1.5, 0.05
#: N/s, N, m of the hand; s after it lets go, and without a hand.
RISE, HARDEST, WAY, AFTER, ALONE = 0.5, 10.0, 0.05, 10.0, 60.0
POSES = (
    (0.0, -0.5, 0.5, 0.3, 0.0, 0.3),
    (0.5, 0.0, 0.0, 0.0, 0.0, 0.3),
    (0.0, 0.8, -0.8, 0.5, 0.0, 0.3),
    (-0.7, -1.2, 1.2, -0.5, 0.5, 0.3),
    (0.0, 0.0, -1.2, 1.2, 0.0, 0.3),
)
HAND = "gripper_frame_link"
NOTHING = np.zeros(3)


@dataclass(frozen=True, slots=True)
class Case:
    """A case: gain of the servos, error of the weight that the board knows, friction by load."""

    name: str
    gain: int = 32
    error: float = 0.0
    by_load: float = 0.0


CASES = (
    Case("as published"),
    Case("weight known 10 % too great", error=0.1),
    Case("weight known 10 % too small", error=-0.1),
    Case("gain 16, as LeRobot sets it", gain=16),
    Case("friction grows by 15 % of the load", by_load=0.15),
    Case("friction grows by 25 % of the load", by_load=0.25),
)


class Arm:
    """An SO-101 on its servos, and the admittance that moves their goals."""

    def __init__(self, path: Path, case: Case, pose: tuple[float, ...]) -> None:
        self.model, self._case = bare(path), case
        self.data, self._known = mujoco.MjData(self.model), mujoco.MjData(self.model)
        n = self.model.nv
        self.data.qpos[:] = pose[:n]
        mujoco.mj_forward(self.model, self.data)
        stiffness = case.gain * GAIN * SUPPLY / RESISTANCE * CONSTANT
        self._goal = self.data.qpos + self.data.qfrc_bias / stiffness
        self._current, self._felt, self._speed = np.zeros(n), np.zeros(n), np.zeros(n)
        self._seen, self._mass, self._count = np.array(pose[:n]), np.zeros((n, n)), 0
        self._hand = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, HAND)

    @property
    def hand(self) -> np.ndarray:
        """Where it is, m."""
        return np.array(self.data.xpos[self._hand])

    def run(self, seconds: float, force: np.ndarray = NOTHING, *, guided: bool = True) -> None:
        model, data, case = self.model, self.data, self._case
        for _ in range(round(seconds / STEP)):
            if guided and self._count % round(1.0 / (RATE * STEP)) == 0:
                self._yield()
            self._count += 1
            duty = np.clip((self._goal - data.qpos) * case.gain * GAIN, -DUTY, DUTY)
            self._current = (duty * SUPPLY - CONSTANT * data.qvel) / RESISTANCE
            data.qfrc_applied[:] = CONSTANT * self._current
            model.dof_frictionloss[:] = DRY + case.by_load * np.abs(data.qfrc_bias)
            data.xfrc_applied[self._hand, :3] = force
            mujoco.mj_step(model, data)

    def _yield(self) -> None:
        """One exchange: read, observe, move the goals."""
        model, known, period = self.model, self._known, 1.0 / RATE
        place = np.rint(self.data.qpos / COUNT) * COUNT
        current = np.rint(self._current / AMPERE) * AMPERE
        speed = self._speed + 0.4 * ((place - self._seen) / period - self._speed)
        known.qpos[:] = place
        mujoco.mj_forward(model, known)
        mujoco.mj_fullM(model, known, self._mass)
        weight = (1.0 + self._case.error) * known.qfrc_bias
        rubbing = DRY * np.clip(speed / SLIP, -1.0, 1.0) + VISCOUS * speed
        raw = self._mass @ ((speed - self._speed) / period) + weight + rubbing
        raw -= CONSTANT * current
        self._felt += -math.expm1(-2.0 * math.pi * BANDWIDTH * period) * (raw - self._felt)
        least = STUCK * DRY + WEIGHT * np.abs(weight)
        moved = np.sign(self._felt) * np.maximum(np.abs(self._felt) - least, 0.0) / DAMPING
        low, high = model.jnt_range.T
        goal = self._goal + period * np.clip(moved, -FASTEST, FASTEST)
        self._goal = np.clip(goal, low, high)
        self._seen, self._speed = place, speed


def bare(path: Path) -> mujoco.MjModel:
    """The arm without shapes, with the servos' friction and rotors."""
    root = ET.parse(path).getroot()
    for link in root.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    compiler = {"fusestatic": "false", "boundmass": "1e-6", "boundinertia": "1e-9"}
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", compiler)
    made = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    made.opt.timestep = STEP
    made.dof_damping[:], made.dof_armature[:] = VISCOUS, ROTOR
    made.dof_solref[:] = 2.0 * STEP, 1.0
    made.dof_solimp[:, :2] = 0.995, 0.999
    return made


def pushes(path: Path, case: Case) -> Iterator[tuple[float, float]]:
    """Of each push: N at which the hand has moved by WAY, and ° a joint moves after letting go."""
    for pose in POSES:
        for direction in (*np.eye(3), *-np.eye(3)):
            arm = Arm(path, case, pose)
            arm.run(1.0, guided=False)
            begin, force = arm.hand, 0.0
            while (arm.hand - begin) @ direction < WAY and force < HARDEST:
                force += RISE / RATE
                arm.run(1.0 / RATE, force * direction)
            left = np.array(arm.data.qpos)
            arm.run(AFTER)
            moved = math.degrees(float(np.abs(arm.data.qpos - left).max()))
            yield (force if force < HARDEST else math.inf), moved


def drift(path: Path, case: Case) -> float:
    """The most that a joint moves by itself in ALONE s, °."""
    most = 0.0
    for pose in POSES:
        arm = Arm(path, case, pose)
        arm.run(1.0, guided=False)
        begin = np.array(arm.data.qpos)
        arm.run(ALONE)
        most = max(most, math.degrees(float(np.abs(arm.data.qpos - begin).max())))
    return most


def main() -> None:
    parser = argparse.ArgumentParser(allow_abbrev=False)
    parser.add_argument("urdf", type=Path)
    given = parser.parse_args()
    print("| case | push, median | greatest | not moved by 10 N | after letting go | alone |")
    print("|---|---|---|---|---|---|")
    for case in CASES:
        found = list(pushes(given.urdf, case))
        forces = [force for force, _ in found if math.isfinite(force)]
        moved = [one for force, one in found if math.isfinite(force)]
        print(
            f"| {case.name} | {median(forces):.1f} N | {max(forces):.1f} N | "
            f"{len(found) - len(forces)} of {len(found)} | {median(moved):.1f}°, "
            f"{max(moved):.1f}° at most | {drift(given.urdf, case):.2f}° in {ALONE:.0f} s |",
            flush=True,
        )


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""Compare the engines: 30 s of the same motion in pybullet and in MuJoCo.

    python docs/bodies.py

Writes docs/images/bodies.png, and the table of docs/bodies.md between its markers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import mujoco

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from control_board_ros.description.geometry import numbers_of, rotation_of_rpy
from control_board_ros.description.rotor import add_rotor_inertia
from control_board_ros.settings.loading import Settings, load
from control_board_ros.sim.bodies.bullet import BulletBody
from control_board_ros.sim.bodies.mujoco import MujocoBody
from control_board_ros.sim.bodies.mujoco_spec import LINK, quaternion
from control_board_ros.sim.bodies.prepare import fit
from control_board_ros.sim.plant import Body
from control_board_ros.simulation import Simulation

DOCS = Path(__file__).parent
BEGIN, END = "<!-- figures -->", "<!-- /figures -->"
SHOULDER, ELBOW = 1, 3
#: s between two velocities.
SEND_PERIOD = 0.01
JOINTS = {SHOULDER: "joint 2", ELBOW: "joint 4"}


@dataclass(frozen=True)
class Phase:
    """A phase: name, start in s, action in each cycle."""

    name: str
    start: float
    act: Callable[[Simulation, float], None]


def at_start(act: Callable[[Simulation], None]) -> Callable[[Simulation, float], None]:
    """An action at the start of its phase only."""

    def once(simulation: Simulation, since: float) -> None:
        if since < 0.5e-3:
            act(simulation)

    return once


def moves(simulation: Simulation, since: float) -> None:
    """Fast moves of all joints, forth and back."""
    cycle = round(since * 1000)
    if cycle % 2000 == 0:
        sign = 1.0 if cycle % 4000 == 0 else -1.0
        targets = [0.8 * sign, 0.6 * sign, 0.0, -1.0 - 0.6 * sign, 0.5, 0.8 * sign, 0.0]
        assert simulation.board.position_move(None, targets, 1.2)


def velocities(simulation: Simulation, since: float) -> None:
    """Velocities on a sine of 0.7 Hz, each with the acceleration that leads to the next."""
    board, joints = simulation.board, list(JOINTS)
    if since < 0.5e-3:
        assert board.set_control_mode(joints, "vel")
    if round(since * 1000) % 10 == 0:
        velocity, before = np.cos(4.4 * since), np.cos(4.4 * (since - SEND_PERIOD))
        acceleration = abs(velocity - before) / SEND_PERIOD if since >= 0.5e-3 else 5.0
        assert board.velocity_move(joints, velocity, max(acceleration, 0.1))


def compliant(simulation: Simulation, since: float) -> None:
    """COMPLIANT, pushed for 3 s."""
    board, joints = simulation.board, list(JOINTS)
    if since < 0.5e-3:
        board.set_control_mode(joints, "pos")
        board.set_impedance(joints, 150.0, 8.0)
        board.set_interaction_mode(joints, "comp")
    simulation.plant.push(SHOULDER, 25.0 if 1.0 <= since < 4.0 else 0.0)


def fall(simulation: Simulation) -> None:
    """Without power, onto the hard stop."""
    simulation.board.set_control_mode(None, "idl")


def recover(simulation: Simulation) -> None:
    """Faults cleared, back home."""
    board = simulation.board
    board.set_interaction_mode(None, "stif")
    board.set_control_mode(None, "fidl")
    board.set_control_mode(None, "pos")
    board.position_move(None, [0.0, 0.5, 0.0, -1.2, 0.0, 0.7, 0.0], 0.8)


PHASES = (
    Phase("moves", 1.0, moves),
    Phase("velocities", 9.0, velocities),
    Phase("compliant, pushed", 15.0, compliant),
    Phase("without power", 21.0, at_start(fall)),
    Phase("back home", 25.0, at_start(recover)),
)
SECONDS = 30.0


def with_rotors_of_pybullet(settings: Settings) -> MujocoBody:
    """MuJoCo with J N² as a part of its link's tensor instead of an armature."""
    body = MujocoBody(settings.board, settings.simulation)
    model, fitted = body._model, fit(settings.board, settings.simulation)
    model.dof_armature[:] = 0.0
    for name, moments in add_rotor_inertia(fitted.tree, fitted.rotors).items():
        link = model.body(LINK + name).id
        turn = rotation_of_rpy(numbers_of(fitted.tree.links[name].find("inertial/origin"), "rpy"))
        model.body_inertia[link], model.body_iquat[link] = moments, quaternion(turn)
    mujoco.mj_setConst(model, body._data)
    return body


def run(settings: Settings, body: Body) -> np.ndarray:
    """Positions, rad, and torques, N·m, of all phases, shape (cycles, 2, n)."""
    shots = []
    with Simulation(settings.board, settings.simulation, body) as simulation:
        for cycle in range(round(SECONDS * settings.board.control_rate)):
            now = cycle * settings.board.period
            for phase, end in zip(PHASES, [*(p.start for p in PHASES[1:]), SECONDS], strict=True):
                if phase.start - 1e-9 <= now < end - 1e-9:
                    phase.act(simulation, now - phase.start)
            simulation.step()
            shot = simulation.board.snapshot()
            shots.append([shot.position.copy(), shot.torque.copy()])
    return np.array(shots)


def rows(pairs: list[tuple[str, np.ndarray, np.ndarray]]) -> str:
    """The table: greatest differences of position and torque, phase by phase."""
    lines = ["| what | | " + " | ".join(phase.name for phase in PHASES) + " |"]
    lines.append("|---|---" + "|---" * len(PHASES) + "|")
    ends = [*(phase.start for phase in PHASES[1:]), SECONDS]
    for told, one, other in pairs:
        for row, unit, scale in ((0, "mrad", 1e3), (1, "N·m", 1.0)):
            cells = []
            for phase, end in zip(PHASES, ends, strict=True):
                chosen = slice(round(phase.start * 1000), round(end * 1000))
                worst = np.abs(one[chosen, row] - other[chosen, row]).max() * scale
                cells.append(f"{worst:.2g} {unit}")
            lines.append(f"| {told if row == 0 else ''} | | {' | '.join(cells)} |")
    return "\n".join(lines).replace("| | ", "| ").replace("|---|---|", "|---|", 1)


def draw(one: np.ndarray, other: np.ndarray) -> None:
    """Positions and torques of both, and their differences."""
    time = np.arange(len(one)) / 1000.0
    figure, axes = plt.subplots(4, 1, figsize=(12, 10), sharex=True, constrained_layout=True)
    for k, (joint, name) in enumerate(JOINTS.items()):
        for axis, row, scale in ((axes[0], 0, 180.0 / np.pi), (axes[2], 1, 1.0)):
            axis.plot(time, scale * one[:, row, joint], f"C{k}", lw=3, alpha=0.45)
            axis.plot(time, scale * other[:, row, joint], f"C{k}", lw=0.9)
        axes[1].plot(time, 1e3 * (other - one)[:, 0, joint], f"C{k}", lw=0.9, label=name)
        axes[3].plot(time, (other - one)[:, 1, joint], f"C{k}", lw=0.9, label=name)
    titles = ("position, °", "difference, mrad", "torque, N·m", "difference, N·m")
    for axis, title in zip(axes, titles, strict=True):
        axis.set_ylabel(title)
        axis.grid(alpha=0.3)
        for phase in PHASES:
            axis.axvline(phase.start, color="0.7", lw=0.8)
    for phase in PHASES:
        axes[0].text(phase.start + 0.1, 1.02, phase.name, transform=axes[0].get_xaxis_transform())
    axes[1].legend(loc="upper left")
    axes[3].set_xlabel("time, s; broad: pybullet, fine: MuJoCo")
    figure.savefig(DOCS / "images" / "bodies.png", dpi=90)


def make() -> None:
    """The picture and the table."""
    settings = load("iiwa")
    bodies = BulletBody, MujocoBody
    one, other = (run(settings, made(settings.board, settings.simulation)) for made in bodies)
    alike = run(settings, with_rotors_of_pybullet(settings))
    draw(one, other)
    text = rows([("as they are", one, other), ("rotors as in pybullet", one, alike)])
    page = DOCS / "bodies.md"
    before, begin, rest = page.read_text("utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    page.write_text(f"{before}{begin}\n{text}\n{END}{after}", "utf-8")
    print(text)


if __name__ == "__main__":
    make()

# SPDX-License-Identifier: Apache-2.0
"""Make the pictures of the README: the arm, and how it follows its reference.

    python docs/pictures.py

The arm is drawn by pybullet's own renderer, the plots by matplotlib.
"""

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from control_board_ros.examples import every_mode
from control_board_ros.simulation import Simulation

IMAGES = Path(__file__).parent / "images"
MOVES = {1: 30.0, 3: -30.0, 5: 30.0}  # joint: degrees
SPEED = np.radians(20.0)


def record() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time, positions and references (deg) of a 30° move of three joints, and a picture."""
    with Simulation.load("iiwa") as simulation:
        board = simulation.board
        simulation.run(1.0)
        start = simulation.time
        joints = list(MOVES)
        board.position_move(
            joints, board.get_encoder(joints) + np.radians(list(MOVES.values())), SPEED
        )
        shots = []
        for _ in range(2200):
            simulation.step()
            shots.append(board.snapshot())
        picture = simulation.plant.body.render(1200, 1000)
    time = np.array([shot.time for shot in shots]) - start
    position = np.degrees([shot.position for shot in shots])
    reference = np.degrees([shot.position_reference for shot in shots])
    return time, position, reference, picture


def hero() -> None:
    """The first picture of the README."""
    time, position, reference, picture = record()
    figure = plt.figure(figsize=(12, 5), constrained_layout=True)
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.35), height_ratios=(3, 1))
    arm = figure.add_subplot(grid[:, 0])
    arm.imshow(picture)
    arm.axis("off")
    arm.set_title("iiwa, simulated, held by the board", fontsize=10)
    track = figure.add_subplot(grid[0, 1])
    error = figure.add_subplot(grid[1, 1], sharex=track)
    for k, j in enumerate(MOVES):
        track.plot(time, position[:, j], color=f"C{k}", label=f"joint {j + 1}", linewidth=2)
        track.plot(
            time, reference[:, j], "k--", linewidth=0.9, label="reference" if k == 0 else None
        )
        error.plot(time, position[:, j] - reference[:, j], color=f"C{k}")
    track.set_ylabel("position, deg")
    track.set_title("minimum-jerk moves of 30° in 1.5 s, under gravity", fontsize=10)
    track.legend(fontsize=8)
    error.set_ylabel("error, deg")
    error.set_xlabel("time, s")
    for axis in (track, error):
        axis.grid(alpha=0.3)
    figure.savefig(IMAGES / "iiwa.png", dpi=100)
    print(f"largest error {np.abs(position - reference)[:, list(MOVES)].max():.3f} deg")


def modes() -> None:
    """One joint through every mode."""
    with Simulation.load("iiwa") as simulation:
        recording = every_mode.walk(simulation)
    every_mode.plot(recording, str(IMAGES / "every_mode.png"))


def make() -> None:
    """Both pictures."""
    IMAGES.mkdir(exist_ok=True)
    hero()
    modes()


if __name__ == "__main__":
    make()

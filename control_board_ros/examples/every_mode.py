# SPDX-License-Identifier: Apache-2.0
"""Walk one joint of the simulated iiwa through every control mode, and plot it.

    python -m control_board_ros.examples.every_mode every_mode.png

No ROS is needed: the script holds the board and steps the simulation itself. The picture needs
matplotlib (``pip install matplotlib``); without it, the script prints a summary.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..core.board import Board
from ..core.state import Snapshot
from ..core.terms.vocabs import ControlMode as M
from ..core.terms.vocabs import InteractionMode
from ..simulation import Simulation

JOINT = "lbr_iiwa_joint_4"
J = 3

STYLES = ("C0", "C1--")
#: Modes in which a reference acts and is drawn.
REFERENCE_MODES = {
    "position_reference": ("POSITION", "DIRECT", "VELOCITY", "MIXED", "COMPLIANT\npushed"),
    "torque_reference": ("TORQUE", "COMPLIANT\npushed"),
}


@dataclass
class Recording:
    """One snapshot per control cycle, and the modes with their times (s)."""

    snapshots: list[Snapshot] = field(default_factory=list)
    bands: list[tuple[float, float, str]] = field(default_factory=list)


Each = Callable[[Board, float], object]


def walk(simulation: Simulation) -> Recording:
    """Run through every mode."""
    board, recording = simulation.board, Recording()

    def act(title: str, mode: M, seconds: float, each: Each) -> None:
        """Switch the joint to a mode and call a function before every cycle."""
        reply = board.set_control_mode(JOINT, mode)
        if not reply:
            raise SystemExit(reply.message)
        start = simulation.time
        for _ in range(round(seconds / board.period)):
            each(board, simulation.time - start)
            simulation.step()
            recording.snapshots.append(board.snapshot())
        recording.bands.append((start, simulation.time, title))

    simulation.step()  # the first cycle configures the board
    home = float(board.get_encoder(JOINT)[0])
    act("POSITION", M.POSITION, 2.0, move(home + 0.5))
    act("DIRECT", M.POSITION_DIRECT, 1.0, step_twice(home))
    act("VELOCITY", M.VELOCITY, 1.5, turn)
    act("MIXED", M.MIXED, 1.5, mix(home))
    hold = float(board.get_torque(JOINT)[0])
    act("TORQUE", M.TORQUE, 1.5, lambda b, t: b.set_ref_torque(JOINT, hold + 2.0 * np.sin(8 * t)))
    board.set_interaction_mode(JOINT, InteractionMode.COMPLIANT)
    board.set_impedance(JOINT, 300.0, 30.0)
    act("COMPLIANT\npushed", M.POSITION, 2.0, push(simulation))
    simulation.plant.push(JOINT, 0.0)
    act("OPENLOOP", M.OPENLOOP, 0.8, drive)
    act("IDLE", M.IDLE, 0.6, let_go)
    return recording


def move(target: float) -> Each:
    """One minimum-jerk move."""
    return lambda board, t: board.position_move(JOINT, target, 0.4) if t == 0.0 else None


def turn(board: Board, _: float) -> None:
    """A constant velocity, renewed before it times out."""
    board.velocity_move(JOINT, -0.3, 1.0)


def drive(board: Board, _: float) -> None:
    """A constant PWM."""
    board.set_output(JOINT, 8.0)


def let_go(_: Board, __: float) -> None:
    """Nothing: the arm falls."""


def step_twice(home: float) -> Each:
    """Two steps of the position reference, half a second apart."""
    return lambda board, t: board.set_position(JOINT, home + (0.55 if t < 0.5 else 0.45))


def mix(home: float) -> Each:
    """A position move with a velocity on top."""

    def command(board: Board, t: float) -> None:
        if t == 0.0:
            board.position_move(JOINT, home, 0.3)
        board.velocity_move(JOINT, 0.15 if t < 1.0 else 0.0, 1.0)

    return command


def push(simulation: Simulation) -> Each:
    """Push the compliant joint with 20 N·m for a second."""
    return lambda _, t: simulation.plant.push(JOINT, 20.0 if 0.4 < t < 1.4 else 0.0)


def plot(recording: Recording, path: str) -> None:
    """Position, torque and output over time, with a band per mode."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    shots = recording.snapshots
    time = np.array([shot.time for shot in shots])
    figure, axes = plt.subplots(3, 1, figsize=(12, 8), sharex=True, constrained_layout=True)

    def draw(axis: int, names: tuple[str, ...], unit: str, scale: float = 1.0) -> None:
        for name, label, style in zip(names, ("measured", "reference"), STYLES, strict=False):
            values = np.array([getattr(shot, name)[J] for shot in shots]) * scale
            for start, end, title in recording.bands:
                if title not in REFERENCE_MODES.get(name, title):
                    values[(time > start) & (time <= end)] = np.nan
            axes[axis].plot(time, values, style, label=label, linewidth=1.4)
        axes[axis].set_ylabel(unit)
        axes[axis].legend(loc="lower left", ncols=2, framealpha=0.9)
        axes[axis].grid(alpha=0.3)

    draw(0, ("position", "position_reference"), "position, deg", np.degrees(1.0))
    draw(1, ("torque", "torque_reference"), "torque, N·m")
    draw(2, ("output",), "PWM, %")
    for k, (start, end, title) in enumerate(recording.bands):
        for axis in axes:
            axis.axvspan(start, end, color=f"C{k % 10}", alpha=0.08, linewidth=0)
        axes[0].text(
            (start + end) / 2,
            1.02,
            title,
            ha="center",
            va="bottom",
            fontsize=9,
            transform=axes[0].get_xaxis_transform(),
        )
    axes[2].set_xlabel("simulated time, s")
    axes[2].set_xlim(time[0], time[-1])
    figure.savefig(path, dpi=110)


def main() -> None:
    """Walk, print a summary, plot where matplotlib is installed."""
    path = sys.argv[1] if len(sys.argv) > 1 else "every_mode.png"
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        drawing = False
    else:
        drawing = True
    with Simulation.load("iiwa") as simulation:
        recording = walk(simulation)
        for event in simulation.board.take_events():
            print(f"{event.level}: {event.text}")
    for line in summary(recording):
        print(line)
    done = f"{len(recording.snapshots)} cycles through {len(recording.bands)} modes"
    if drawing:
        plot(recording, path)
        print(f"{done}; see {path}")
    else:
        print(f"{done}; for the picture: pip install matplotlib, then run this again")


def summary(recording: Recording) -> list[str]:
    """One line per mode: its times, and the joint's positions at its start and end."""
    lines = []
    for start, end, title in recording.bands:
        shots = [shot for shot in recording.snapshots if start < shot.time <= end]
        first, last = (np.degrees(shot.position[J]) for shot in (shots[0], shots[-1]))
        name = title.replace("\n", ", ")
        lines.append(f"{start:5.2f} to {end:5.2f} s  {name:18} {first:7.1f}° to {last:7.1f}°")
    return lines


if __name__ == "__main__":
    main()

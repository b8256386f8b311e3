# SPDX-License-Identifier: Apache-2.0
"""A board before simulated drives on a bad wire, in simulated time: delays, losses, stalls."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.measurement import Array
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.settings import loading
from control_board_ros.sim.plant import SimulatedPlant
from control_board_ros.simulation import made_board

#: One row of S1 each, by the drive's set-point.
ROWS = [kind.code for kind in SetPoint if kind is not SetPoint.OFF]
#: What a wire does; parameters of ``drive_model``.
WIRES = {
    "latency": {"latency": 0.01},
    "jitter": {"jitter": 0.01},
    "loss": {"loss": 0.1},
    "all": {"latency": 0.005, "jitter": 0.005, "loss": 0.1},
}
#: Periods from one cycle to the next on a computer without the time for each.
GAPS = {
    "each three": [3],
    "each twenty": [20],
    "every fourth": [1, 1, 1, 5],
    "uneven": [1, 9, 3, 10, 2, 7],
    "to forty": random.Random(5).choices(range(1, 41), k=97),
}
MODES = ["pos", "posd", "vel", "mix", "torq", "open", "idl", "fidl"]
PARAMETERS = {
    "joints": ["lbr_iiwa_joint_1", "lbr_iiwa_joint_4"],
    "joint_defaults.calibration.required": False,
    "joint_defaults.timeouts.encoder": 0.1,
    "joint_defaults.timeouts.torque_sensor": 0.1,
    "physics": "ideal",
}


class BadWire:
    """Joints of the iiwa, each an inertia behind a drive, behind a wire; two, unless asked for.

    Args:
        row: The set-point that the drives take.
        wire: Parameters of ``drive_model``.

    Attributes: board, plant, speeds (of the joints in each cycle of the plant, in speed limits,
    shape (k, n)), faults (texts of all that were active).
    """

    def __init__(self, row: str, wire: dict[str, float], **parameters: object) -> None:
        values = (
            PARAMETERS
            | parameters
            | {f"joint_defaults.drive_model.{name}": value for name, value in wire.items()}
        )
        if row != SetPoint.PWM.code:
            values["joint_defaults.drive"] = [row]
        made = loading.load("iiwa", values)
        self.period = made.board.period
        self.limit = np.array([joint.limits.velocity for joint in made.board.joints])
        self.board = made_board(made)
        ideal = values["physics"] == "ideal"
        simulation = replace(made.simulation, urdf=None) if ideal else made.simulation
        self.plant = SimulatedPlant(made.board, simulation)
        self._speeds: list[Array] = []
        self._gap, self._gaps = 1, 0  # the last, and how many there were
        self.faults: set[str] = set()

    @property
    def speeds(self) -> Array:
        return np.array(self._speeds)

    @property
    def position(self) -> Array:
        """Where the joints are in truth, rad."""
        return self.plant._motors.position.copy()

    def run(self, cycles: int) -> None:
        """Let control cycles pass."""
        for _ in range(cycles):
            self._pass_on()

    def stall(self, cycles: int) -> None:
        """The control loop stands still; the drives go on with what they have."""
        actuation = self.board.engine.tick(self.plant.read())
        for _ in range(cycles):
            self.plant.write(actuation)
            self._note()
        self._pass_on(elapsed=cycles * self.period)

    def starve(self, gaps: Sequence[int], periods: int) -> None:
        """Let periods pass, of which these have one cycle; the drives keep what they have."""
        end = len(self._speeds) + periods
        while len(self._speeds) < end:
            reading = self.plant.read()
            reading.elapsed = self._gap * self.period
            actuation = self.board.tick(reading)
            reading.elapsed = None
            self._gap = gaps[self._gaps % len(gaps)]
            self._gaps += 1
            for _ in range(self._gap):
                self.plant.write(actuation)
                self._note()

    def _pass_on(self, elapsed: float | None = None) -> None:
        reading = self.plant.read()
        reading.elapsed = elapsed
        self.plant.write(self.board.tick(reading))
        reading.elapsed = None
        self._note()

    def _note(self) -> None:
        self._speeds.append(self.plant._motors.velocity / self.limit)
        self.faults |= {fault.text for fault in self.board.get_faults(None) if fault.active}

    def enter(self, mode: str, settle: int = 300) -> None:
        """All joints in a control mode, at rest."""
        assert self.board.set_control_mode(None, mode)
        self.run(settle)
        self._speeds.clear()


def worst(speeds: Array, ways: Sequence[float]) -> tuple[float, float]:
    """The greatest speed along the way of each joint, and against it, in speed limits."""
    along = speeds * np.asarray(ways)
    return float(along.max()), float(-along.min())


def offers(bench: BadWire, joint: int) -> set[str]:
    modes: tuple[ControlMode, ...] = bench.board.get_available_modes(joint)[0][0]
    return {mode.code for mode in modes} | {"fidl"}


def change_at_random(bench: BadWire, rng: random.Random, count: int) -> None:
    """Some changes of mode of a joint, to any; a move and a velocity for it, up to its limit."""
    for _ in range(count):
        j = rng.randrange(len(bench.limit))
        offered = [code for code in MODES if code in offers(bench, j)]
        bench.board.set_control_mode(j, rng.choice(offered))
        place, speed = bench.position[j] + rng.uniform(-1.0, 1.0), rng.uniform(0.05, 0.53)
        bench.board.position_move(j, float(place), speed * bench.limit[j])
        bench.board.velocity_move(j, rng.uniform(-1.0, 1.0) * bench.limit[j])
        bench.run(rng.randrange(10, 160))


def turn_round(bench: BadWire, rng: random.Random) -> tuple[float, float]:
    """A change of mode amid motion, of all joints, to one that brakes: the worst speeds then.

    It takes two changes.
    """
    modes = [mode for mode in ("pos", "posd", "vel", "mix", "torq") if mode in offers(bench, 0)]
    before, after = rng.sample(modes, 2)
    if before not in ("pos", "vel", "mix"):
        before = "pos" if after != "pos" else "mix"
    bench.enter(before, settle=150)
    way = -1.0 if bench.position.mean() > 0.0 else 1.0
    speeds = rng.uniform(0.1, 0.5) * bench.limit
    bench.board.position_move(None, (bench.position + 0.5 * way).tolist(), speeds.tolist())
    bench.board.velocity_move(None, (way * speeds).tolist())
    bench.run(rng.randrange(30, 200))
    bench.enter(after, settle=0)
    bench.run(150)
    return worst(bench.speeds, [way, way])

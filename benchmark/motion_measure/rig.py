# SPDX-License-Identifier: Apache-2.0
"""A robot on the bench: a simulated board, how to bring it to a pose, and what it did."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from control_board_ros.core.config.config import JointConfig
from control_board_ros.core.terms.reply import Reply
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.settings.loading import Settings, load
from control_board_ros.simulation import Simulation

from .robots import Robot

Array = NDArray[np.float64]
M = ControlMode
Way = InteractionMode

#: Longest calibration at start, s.
STARTUP = 60.0


class RefusedError(Exception):
    """The board did not accept a request of a row of the table; one line."""


@dataclass(frozen=True, slots=True)
class Window:
    """Where a joint is moved while it is measured: its software limits, a turn at most."""

    lower: float
    upper: float

    @property
    def span(self) -> float:
        return self.upper - self.lower

    def at(self, part: float) -> float:
        """The place that lies so far (0 to 1) between the ends."""
        return self.lower + part * self.span

    def clip(self, position: float, margin: float) -> float:
        """The nearest place that keeps a margin to both ends, or the middle."""
        if 2.0 * margin >= self.span:
            return self.at(0.5)
        return min(max(position, self.lower + margin), self.upper - margin)


@dataclass(frozen=True, slots=True)
class Record:
    """What one joint did, one entry per control cycle; shapes (cycles,).

    Attributes: time (s since the record began), position, velocity, torque (measured),
    reference (of the position, in force), and the same of all joints in ``positions``, shape
    (cycles, n).
    """

    time: Array
    position: Array
    velocity: Array
    torque: Array
    reference: Array
    positions: Array


@dataclass(frozen=True, slots=True)
class Failure:
    """A fault or a refusal that a row met: its key, joint and pose, and the board's text."""

    row: str
    where: str
    text: str

    @property
    def cause(self) -> str:
        """The fault's title, without joint and numbers."""
        return self.text.partition(": ")[2].partition(",")[0] or self.text


class Rig:
    """A simulated robot that is up and calibrated.

    Attributes: name, derived (no tuned parameters), simulation, board, joints (configurations),
    windows, failures (faults and refusals so far).
    """

    def __init__(self, name: str, settings: Settings, *, derived: bool) -> None:
        self.name, self.derived, self._settings = name, derived, settings
        self.simulation = Simulation(settings.board, settings.simulation)
        self.board = self.simulation.board
        self.joints: tuple[JointConfig, ...] = settings.board.joints
        self.home = np.array([joint.home for joint in settings.simulation.joints])
        self.windows = [
            Window(max(j.limits.lower, h - math.pi), min(j.limits.upper, h + math.pi))
            for j, h in zip(self.joints, self.home, strict=True)
        ]
        self.failures: list[Failure] = []
        self._pose = self.home.copy()
        self._haste = 0.25
        self.start()

    @classmethod
    def load(cls, robot: Robot) -> Self:
        """The rig of a robot.

        Raises:
            SettingsError: the robot cannot be loaded; one line.
        """
        settings = load(None, {"robot": robot.source(), **robot.parameters})
        return cls(robot.name, settings, derived=robot.derived)

    @contextmanager
    def compensating(self) -> Iterator[None]:
        """With gravity compensated on all joints (SPEC G1)."""
        on = {f"{joint.name}.gravity_compensation": True for joint in self.joints}
        self.board.reconfigure(self._settings.changed(on).board)
        try:
            yield
        finally:
            self.board.reconfigure(self._settings.board)

    # --- time ---------------------------------------------------------------------------------

    @property
    def period(self) -> float:
        return self.board.period

    def run(self, seconds: float) -> None:
        """Let simulated time pass."""
        self.simulation.run(seconds)

    def record(
        self,
        j: int,
        seconds: float,
        each: Callable[[float], None] | None = None,
        until: Callable[[float, float], bool] | None = None,
    ) -> Record:
        """Let time pass and keep what a joint does.

        Args:
            j: The joint.
            seconds: How long at most.
            each: Called with the time before every cycle; sends references.
            until: Ends the record where it is true of the joint's position and velocity.
        """
        board, step = self.board, self.simulation.step
        rows, everyone = [], []
        cycles = round(seconds / self.period)
        for cycle in range(cycles):
            if each is not None:
                each(cycle * self.period)
            step()
            now = board.snapshot()
            rows.append(
                (now.position[j], now.velocity[j], now.torque[j], now.position_reference[j])
            )
            everyone.append(now.position)
            if until is not None and until(rows[-1][0], rows[-1][1]):
                break
        position, velocity, torque, reference = np.array(rows).reshape(-1, 4).T
        positions = np.array(everyone).reshape(len(rows), -1)
        time = np.arange(len(rows)) * self.period
        return Record(time, position, velocity, torque, reference, positions)

    # --- where it is --------------------------------------------------------------------------

    def position(self, j: int) -> float:
        return float(self.board.get_encoder(j)[0])

    def pose(self, j: int) -> float:
        """Where the pose that is measured in has a joint."""
        return float(self._pose[j])

    def sliding(self, j: int) -> bool:
        return self.joints[j].kind == "prismatic"

    def dry_friction(self, j: int) -> float:
        """Of a joint's motor and gearbox, N·m or N."""
        return self._settings.simulation.joints[j].motor.coulomb

    def has(self, j: int, mode: ControlMode, interaction: InteractionMode = Way.STIFF) -> bool:
        """Whether a joint implements a mode with an interaction mode."""
        joint = self.joints[j]
        return mode in joint.control_modes and interaction in joint.interaction_modes

    def expect(self, reply: Reply) -> None:
        """Raise RefusedError where a reply is no yes."""
        if not reply:
            raise RefusedError(reply.message)

    def enter(self, j: int | None, mode: ControlMode, interaction: InteractionMode) -> None:
        """Set both modes of a joint, or of all, in one cycle."""
        self.expect(self.board.set_interaction_mode(j, interaction))
        self.expect(self.board.set_control_mode(j, mode))

    # --- poses --------------------------------------------------------------------------------

    def take(self, pose: Array) -> None:
        """The pose to measure in from now on, shape (n,); nothing moves yet."""
        self._pose = pose

    def go(self, moved: Mapping[int, float] | None = None) -> None:
        """Bring all joints to the pose and to rest, STIFF.

        A fault on the way, at a quarter of the top speeds, is kept in ``failures``; from then on
        this robot goes slowly.

        Args:
            moved: Other positions for joints of the pose, by index.
        """
        target = self._pose.copy()
        for j, value in (moved or {}).items():
            target[j] = value
        if self.faults():
            self.revive()
        self._approach(target)
        if self.note_faults("going", "to a pose"):
            self._haste = 0.08
            self.revive()
            self._approach(target)

    def _approach(self, target: Array) -> None:
        self.enter(None, M.POSITION, Way.STIFF)
        speeds = [self._haste * joint.limits.velocity for joint in self.joints]
        self.expect(self.board.position_move(None, target, speeds))
        self.run(float(self.board.get_remaining_time(None).max()) + self.period)
        self.settle()

    def settle(self, longest: float = 2.0) -> None:
        """Let time pass until every joint is at rest on its reference, or s are over."""
        quiet = 0.0
        for _ in range(round(longest / 0.01)):
            self.run(0.01)
            now = self.board.snapshot()
            off = np.abs(now.position - now.position_reference).max()
            still = off < 2e-4 and np.abs(now.velocity).max() < 1e-3
            quiet = quiet + 0.01 if still else 0.0
            if quiet >= 0.05:
                return

    def rest(self, j: int) -> None:
        """Let time pass until one joint is at rest for 0.2 s, or 6 s are over."""
        mark = self.position(j)
        for _ in range(30):
            self.run(0.2)
            before, mark = mark, self.position(j)
            if abs(mark - before) < 1e-5:
                return

    # --- faults -------------------------------------------------------------------------------

    def faults(self) -> list[str]:
        """The active faults, one line each."""
        return [f"{fault.name}: {fault.text}" for fault in self.board.get_faults() if fault.active]

    def check(self) -> None:
        """Raise RefusedError where a joint is in fault: what follows would measure nothing."""
        if found := self.faults():
            raise RefusedError("; ".join(found))

    def note_faults(self, row: str, where: str) -> bool:
        """Keep the active faults in ``failures``; whether there are any."""
        found = self.faults()
        self.failures += [Failure(row, where, text) for text in found]
        return bool(found)

    def revive(self) -> None:
        """After a fault: the home pose at rest, cold, powered up anew."""
        for j in range(self.board.count):
            self.simulation.plant.push(j, 0.0)
        self.simulation.plant.reset()
        self.board.power_cycle()
        self.start()

    def close(self) -> None:
        self.simulation.close()

    def start(self) -> None:
        self.run(0.5)
        waited = 0.5
        while M.CALIBRATING in self.board.get_control_mode() and waited < STARTUP:
            self.run(0.5)
            waited += 0.5
        self.settle()
        if self.faults():
            raise RefusedError(f"{self.name} does not start: {'; '.join(self.faults())}")

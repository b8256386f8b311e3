# SPDX-License-Identifier: Apache-2.0
"""Motions of one joint with given gains, on the board without ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..core.config.config import BoardConfig, JointConfig
from ..core.terms.measurement import Array
from ..core.terms.vocabs import ControlMode, InteractionMode
from ..settings.loading import Settings
from ..sim.errors import PlantGone
from ..simulation import Simulation
from .scenes import Scene, simulation_of
from .space import POSITION

#: s of rest before a motion, of evaluation after it, and of a push.
REST, AFTER, PUSHED = 0.3, 0.4, 0.3
#: Travel of a move (rad, m), of a step, and the maximum share of the range of a move.
TRAVEL, TRAVEL_SLIDING, STEP, STEP_SLIDING, PART = 0.4, 0.1, 0.02, 0.002, 0.2
#: Mean speed of a move and torque of a push, as shares of the limits.
SPEED, PUSH = 0.4, 0.1
#: Cycles between two samples.
EVERY = 2


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """One recorded motion of a joint; arrays of shape (m,), time in s from its start.

    Attributes: what (``move``, ``step``, ``push`` or ``release``), time, reference and position
    (rad), torque and torque_reference (N·m), output (%).
    """

    what: str
    time: Array
    reference: Array
    position: Array
    torque: Array
    torque_reference: Array
    output: Array


class GainsError(Exception):
    """A joint faulted, or the plant is gone: unusable gains."""


class Bench:
    """A robot in several scenes, each a simulation of its own, for motions with varying gains."""

    def __init__(self, settings: Settings, scenes: Sequence[Scene]) -> None:
        self._settings, self._scenes = settings, scenes
        self._simulations = [
            Simulation(settings.board, simulation_of(settings, scene)) for scene in scenes
        ]

    def close(self) -> None:
        for simulation in self._simulations:
            simulation.close()

    def play(
        self, joint: str, stage: str, changes: Mapping[str, float], first: int | None = None
    ) -> list[list[Motion]]:
        """The motions of a stage, in each scene, or in the ``first`` ones.

        Raises:
            GainsError: a joint faulted.
        """
        board = with_gains(self._settings, changes)
        j = board.names.index(joint)
        motions = position_motions if stage == POSITION else compliant_motions
        played = []
        for simulation, scene in zip(self._simulations[:first], self._scenes[:first], strict=True):
            stand = Stand(simulation, board, j)
            try:
                stand.start()
                played.append(motions(stand, float(scene.pose[j])))
            except PlantGone as error:
                raise GainsError(str(error)) from error
        return played


class Stand:
    """One joint of a started simulation, in its pose, with the gains to test."""

    def __init__(self, simulation: Simulation, config: BoardConfig, j: int) -> None:
        self.simulation, self.board, self.j = simulation, simulation.board, j
        self.config: JointConfig = config.joints[j]
        self._whole = config

    def start(self) -> None:
        """Start from power-on: every joint in POSITION, STIFF."""
        self.board.reconfigure(self._whole)
        self.simulation.plant.reset()
        self.board.power_cycle()
        self.simulation.step(2)
        for k, joint in enumerate(self._whole.joints):
            impedance = joint.impedance
            self.board.set_impedance(k, impedance.stiffness, impedance.damping)
        self.board.set_interaction_mode(None, InteractionMode.STIFF)
        self.board.set_control_mode(None, ControlMode.POSITION)
        self.record("rest", REST)

    def mode(self, control: ControlMode, interaction: InteractionMode) -> None:
        self.board.set_interaction_mode(self.j, interaction)
        self.board.set_control_mode(self.j, control)

    def push(self, torque: float) -> None:
        """Apply an external torque to the joint, N·m."""
        self.simulation.plant.push(self.j, torque)

    def record(self, what: str, seconds: float) -> Motion:
        """Advance time and record the joint's motion.

        Raises:
            GainsError: a joint faulted.
        """
        count = max(round(seconds * self._whole.control_rate / EVERY), 2)
        rows = np.empty((5, count))
        for k in range(count):
            self.simulation.step(EVERY)
            now, j = self.board.snapshot(), self.j
            rows[:, k] = (
                now.position_reference[j],
                now.position[j],
                now.torque[j],
                now.torque_reference[j],
                now.output[j],
            )
        for fault in self.board.get_faults():
            if fault.active:
                raise GainsError(f"{fault.name}: {fault.text}")
        return Motion(what, np.arange(1, count + 1) * EVERY / self._whole.control_rate, *rows)


def position_motions(stand: Stand, start: float) -> list[Motion]:
    """A fast move, a step, a push: STIFF."""
    step = stand.config.kind.choose(STEP, STEP_SLIDING)
    motions = [move(stand, start, SPEED)]
    stand.mode(ControlMode.POSITION_DIRECT, InteractionMode.STIFF)
    place = float(stand.board.snapshot().position_reference[stand.j])
    way = 1.0 if place < stand.config.limits.upper - 2.0 * STEP else -1.0
    stand.board.set_position(stand.j, place + way * step)
    motions.append(stand.record("step", AFTER))
    stand.push(PUSH * stand.config.limits.torque)
    motions.append(stand.record("push", PUSHED))
    stand.push(0.0)
    return motions


def compliant_motions(stand: Stand, start: float) -> list[Motion]:
    """A push, its release, a slow move: COMPLIANT."""
    stand.mode(ControlMode.POSITION, InteractionMode.COMPLIANT)
    stand.record("rest", REST)
    stand.push(PUSH * stand.config.limits.torque)
    motions = [stand.record("push", PUSHED)]
    stand.push(0.0)
    return [*motions, stand.record("release", 2.0 * AFTER), move(stand, start, 0.5 * SPEED)]


def move(stand: Stand, start: float, speed: float) -> Motion:
    """A minimum-jerk move away from the nearer limit."""
    limits, kind = stand.config.limits, stand.config.kind
    size = min(kind.choose(TRAVEL, TRAVEL_SLIDING), PART * (limits.upper - limits.lower))
    way = 1.0 if limits.upper - start > start - limits.lower else -1.0
    stand.board.position_move(stand.j, start + way * size, speed * limits.velocity)
    return stand.record("move", float(stand.board.get_remaining_time(stand.j)[0]) + AFTER)


def with_gains(settings: Settings, changes: Mapping[str, float]) -> BoardConfig:
    """The configuration of the board with other gains.

    Raises:
        SettingsError: a gain is not allowed.
    """
    damping = {n: v for n, v in changes.items() if n.endswith(".impedance.damping")}
    board = settings.changed({n: v for n, v in changes.items() if n not in damping}).board
    joints = []
    for joint in board.joints:  # dampings are set by requests, not by parameters
        impedance = joint.impedance
        value = damping.get(f"{joint.name}.impedance.damping", impedance.damping)
        impedance = replace(impedance, damping=min(value, impedance.max_damping))
        joints.append(replace(joint, impedance=impedance))
    return replace(board, joints=tuple(joints))

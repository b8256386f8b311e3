# SPDX-License-Identifier: Apache-2.0
"""One or several arms of one kind on one board: actions in, measurements out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.board import Board
from ..core.config.config import BoardConfig, joined
from ..core.model.arm_model import outwards_of
from ..core.terms.joint_kind import ENDLESS
from ..core.terms.measurement import Array
from ..core.terms.modes import STATES
from ..core.terms.vocabs import CommandKind, ControlMode, InteractionMode
from ..description.geometry import rotations_about
from ..protocols import Floats
from ..settings.build import urdf_model
from ..settings.loading import Settings
from ..sim.config import SimulationConfig
from ..sim.plant import Body, SimulatedPlant, make_body
from ..text import unknown_word

M, K = ControlMode, CommandKind
#: Share of a limit at an action of 1.
REACH = 0.5
#: Number of a mode in observations.
NUMBERS = {mode: number for number, mode in enumerate(STATES)}
#: The axis of every link, in its own axes.
Z = np.array([0.0, 0.0, 1.0])
#: Control cycles of a board's start.
START_CYCLES = 3


@dataclass(frozen=True, slots=True)
class Control:
    """Conversion of actions, from −1 to 1, to references.

    Attributes: mode and interaction (of all joints), width (numbers per joint), send (sends
    actions of shape (arms, width, n) to the board).
    """

    mode: ControlMode
    send: Callable[[Arms, Floats], Any]
    interaction: InteractionMode = InteractionMode.STIFF
    width: int = 1


class Arms:
    """Arms of one kind, each a part of one board; a single arm is the board.

    Args:
        settings: Of one arm.
        count: Number of arms; several require MuJoCo.
        control: One of CONTROLS.
        cycles: Control cycles of one step.

    Attributes: count, n (joints of an arm), joints (their configuration), control, duration (of a
    step, s), home (positions, shape (n,)), low and high (of starts, goals and targets, shape (n,):
    the limits, or a turn about home), board, plant.

    Raises:
        ValueError: unknown control, or a joint does not implement its mode.
        PlantError: the body cannot be made.
    """

    def __init__(self, settings: Settings, count: int, control: str, cycles: int) -> None:
        if control not in CONTROLS:
            raise ValueError(unknown_word("control", control, CONTROLS))
        self.control, self.count, self._cycles = CONTROLS[control], count, cycles
        board, simulation = calibrated(settings.board, settings.simulation)
        for joint in board.joints:
            if (
                self.control.mode not in joint.control_modes
                or self.control.interaction not in joint.interaction_modes
            ):
                raise ValueError(f"control {control!r}: {joint.name} does not implement its mode")
        self.joints, self.n = board.joints, len(board.joints)
        self._links = urdf_model(settings.values, settings.urdf, board.names).links
        self.duration = cycles * board.period
        self.home = np.array([joint.home for joint in simulation.joints])
        self._config, self._simulation = board, simulation
        if count > 1:
            parts = {f"arm_{k}": renamed(board, f"arm_{k}_") for k in range(count)}
            self._config = joined(parts)
            plants = tuple(
                replace(joint, name=f"arm_{k}_{joint.name}")
                for k in range(count)
                for joint in simulation.joints
            )
            self._simulation = replace(simulation, joints=plants)
        self.body: Body = self._made_body(board, simulation if count > 1 else self._simulation)
        limits = [joint.limits for joint in board.joints]
        self.lower = np.array([limit.lower for limit in limits])
        self.upper = np.array([limit.upper for limit in limits])
        turn = np.where(self.upper - self.lower > ENDLESS, np.pi, np.inf)
        self.low = np.maximum(self.lower, self.home - turn)
        self.high = np.minimum(self.upper, self.home + turn)
        self.velocity_limit = np.array([limit.velocity for limit in limits])
        self.torque_limit = np.array([limit.torque for limit in limits])
        self.max_stiffness = np.array([joint.impedance.max_stiffness for joint in board.joints])
        self.max_damping = np.array([joint.impedance.max_damping for joint in board.joints])
        self.begin(np.tile(self.home, (count, 1)))

    def _made_body(self, config: BoardConfig, simulation: SimulationConfig) -> Body:
        if self.count == 1:
            return make_body(config, simulation)
        from ..sim.bodies.mujoco import MujocoBody

        return MujocoBody(config, simulation, self.count)

    def begin(self, positions: Floats) -> None:
        """Reset all arms: board, motors, sensors; at rest at positions, shape (arms, n)."""
        self.board = Board(self._config)
        self.plant = SimulatedPlant(self._config, self._simulation, self.body)
        state = self.board.state
        shape = (self.count, self.n)
        self.position = state.position.reshape(shape)
        self.velocity = state.velocity.reshape(shape)
        self.torque = state.torque.reshape(shape)
        self.target = positions.copy()
        self.plant.place(positions.ravel())
        self._come_up(range(self.count))

    def restart(self, arms: list[int], positions: Floats) -> None:
        """Restart some arms from power-on, at rest at positions, shape (k, n)."""
        groups = list(self.board.parts.values()) or [self.board]
        for k, at in zip(arms, positions, strict=True):
            self.plant.place(at, slice(k * self.n, (k + 1) * self.n))
            groups[k].power_cycle()
            self.target[k] = at
        self._come_up(arms)

    def _come_up(self, arms: Any) -> None:
        self.tick(START_CYCLES)
        groups = list(self.board.parts.values()) or [self.board]
        for k in arms:
            if self.control.interaction is not InteractionMode.STIFF:
                groups[k].set_interaction_mode(None, self.control.interaction)
            if not (reply := groups[k].set_control_mode(None, self.control.mode)):
                raise ValueError(f"the arm does not start: {reply.message}")

    def act(self, actions: Floats) -> None:
        """Send actions from −1 to 1, shape (arms, width · n)."""
        self.control.send(self, actions.reshape(self.count, self.control.width, self.n))

    def command(self, kind: CommandKind, values: Floats) -> None:
        """Send references to all joints, shape (arms, n)."""
        self.board.command(kind, None, values.ravel())

    def tick(self, cycles: int) -> None:
        read, tick, write = self.plant.read, self.board.tick, self.plant.write
        for _ in range(cycles):
            write(tick(read()))

    def step(self, done: int = 0) -> None:
        """Run the cycles of a step, less those already done."""
        self.tick(max(0, self._cycles - done))

    def modes(self) -> NDArray[np.int64]:
        """Numbers of the control modes, shape (arms, n); see NUMBERS."""
        numbers = [NUMBERS[mode] for mode in self.board.state.control_modes]
        return np.array(numbers).reshape(self.count, self.n)

    def faults(self) -> NDArray[np.int8]:
        """1 where a joint is in fault, shape (arms, n)."""
        active = [fault.active for fault in self.board.state.faults]
        return np.array(active, dtype=np.int8).reshape(self.count, self.n)

    def tips(self, positions: Floats) -> Floats:
        """Origins of the last links, m, shape (arms, 3)."""
        places: dict[int, tuple[Array, Array]] = {}
        arms, links = len(positions), self._links
        for j in outwards_of([link.parent for link in links]):
            link = links[j]
            turn = np.array(link.rotation).reshape(3, 3)
            if link.parent < 0:
                at, axes = np.zeros((arms, 3)), np.broadcast_to(np.eye(3), (arms, 3, 3))
            else:
                at, axes = places[link.parent]
            at = at + axes @ np.array(link.offset)
            axes = axes @ turn
            q = positions[:, j]
            if link.slides:
                at = at + axes[:, :, 2] * q[:, None]
            else:
                axes = axes @ rotations_about(Z, q)
            places[j] = (at, axes)
        return places[len(links) - 1][0]

    def close(self) -> None:
        """Close the body; may be called twice."""
        self.body.close()


def calibrated(
    config: BoardConfig, simulation: SimulationConfig
) -> tuple[BoardConfig, SimulationConfig]:
    """The same board with encoders that know their zero: no joint has to calibrate."""
    joints = tuple(replace(joint, calibration=None) for joint in config.joints)
    plants = tuple(
        replace(joint, encoder=replace(joint.encoder, zero=0.0)) for joint in simulation.joints
    )
    return (
        replace(config, joints=joints, calibration_groups=()),
        replace(simulation, joints=plants),
    )


def renamed(config: BoardConfig, prefix: str) -> BoardConfig:
    """The same board with a prefix before the names of its joints."""
    joints = tuple(replace(joint, name=prefix + joint.name) for joint in config.joints)
    groups = tuple(tuple(prefix + name for name in group) for group in config.calibration_groups)
    return replace(config, joints=joints, calibration_groups=groups)


def _position(arms: Arms, actions: Floats) -> None:
    arms.target = arms.low + (actions[:, 0] + 1.0) / 2.0 * (arms.high - arms.low)
    arms.command(K.POSITION, arms.target)


def _direct(arms: Arms, actions: Floats) -> None:
    """Step the reference, at most by a share of the speed limit; a NaN steps nothing."""
    way = REACH * arms.velocity_limit * arms.duration * np.nan_to_num(actions[:, 0])
    arms.target = np.clip(arms.target + way, arms.lower, arms.upper)
    arms.command(K.POSITION_DIRECT, arms.target)


def _velocity(arms: Arms, actions: Floats) -> None:
    arms.command(K.VELOCITY, REACH * arms.velocity_limit * actions[:, 0])


def _torque(arms: Arms, actions: Floats) -> None:
    arms.command(K.TORQUE, arms.torque_limit * actions[:, 0])


def _impedance(arms: Arms, actions: Floats) -> None:
    """As direct, with stiffness and damping from 0 (action −1) to their maximum (1).

    Where one of both is a NaN, the joint keeps those that it has.
    """
    share = (actions[:, 1:] + 1.0) / 2.0
    stiffness, damping = share[:, 0] * arms.max_stiffness, share[:, 1] * arms.max_damping
    numbers = np.isfinite(stiffness + damping).ravel()
    joints = None if numbers.all() else np.flatnonzero(numbers).tolist()
    arms.board.set_impedance(joints, stiffness.ravel()[numbers], damping.ravel()[numbers])
    _direct(arms, actions)


CONTROLS = {
    "position": Control(M.POSITION, _position),
    "direct": Control(M.POSITION_DIRECT, _direct),
    "velocity": Control(M.VELOCITY, _velocity),
    "torque": Control(M.TORQUE, _torque),
    "impedance": Control(M.POSITION_DIRECT, _impedance, InteractionMode.COMPLIANT, 3),
}

# SPDX-License-Identifier: Apache-2.0
"""The references that users set: what runs, and the last accepted ones (SPEC P, M11).

The position reference of a joint is its trajectory plus the integral of its velocity:
q_ref = trajectory + ∫v dt, in every mode. POSITION leaves the second at zero, VELOCITY the
first still, MIXED uses both, POSITION_DIRECT sets the first. ``laws.advance`` runs them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from .config import BoardConfig
from .laws import Joint
from .limits import BoardLimits
from .measurement import Array
from .state import Columns, Indices, StateArrays
from .trajectory import durations, durations_within
from .vocabs import CommandKind


class References:
    """References of n joints.

    Args:
        config: of the board.
        limits: of the same joints.
        state: of the board; its rows of references are written.
        joints: whose laws follow the references.

    Attributes: last (shape (kinds, n): the last accepted of each kind, M11), speed and
    acceleration (set by the user, rad/s and rad/s², shape (n,)).
    """

    def __init__(
        self, config: BoardConfig, limits: BoardLimits, state: StateArrays, joints: list[Joint]
    ) -> None:
        self._state, self._joints, self._limits = state, joints, limits
        self.last: Array = np.zeros((len(CommandKind), state.n))
        self.speed = np.array([joint.reference_speed for joint in config.joints])
        self.acceleration = np.array([joint.reference_acceleration for joint in config.joints])

    def reconfigure(self, limits: BoardLimits) -> None:
        """Take new limits; running references go on."""
        self._limits = limits

    def reset(self, joints: Columns, *, bounded: bool) -> None:
        """Hold joints where they are measured to be, at rest (M9).

        A joint found outside its software limits may stay there or move inwards, never
        further out (P9); one that is not calibrated knows no limits.
        """
        for j in self._state.numbers(joints):
            self._joints[j].lower, self._joints[j].upper = -math.inf, math.inf
        self.hold(joints, self._state.position[joints])
        if bounded:
            self.bound(joints)

    def bound(self, joints: Columns) -> None:
        """Bound position references by the limits, from where they stand (P9)."""
        for j in self._state.numbers(joints):
            joint = self._joints[j]
            joint.lower = min(joint.limit_lower, joint.reference)
            joint.upper = max(joint.limit_upper, joint.reference)

    def hold(self, joints: Columns, positions: Array) -> None:
        """Set the position reference at once, at rest (P3, M9); shapes (k,)."""
        state = self._state
        state.position_reference[joints], state.velocity_reference[joints] = positions, 0.0
        state.done[joints] = True
        for j, position in zip(state.numbers(joints), positions.tolist(), strict=True):
            self._joints[j].hold(position)

    def move(self, joints: Columns, targets: Array, speeds: Array) -> list[float]:
        """Start minimum-jerk moves from the present reference (P1, P6); shapes (k,).

        Returns:
            How long they take, s.
        """
        self._state.done[joints] = False
        times = []
        for joint, target, speed in self._with(joints, targets, speeds):
            time, brake = planned(durations, joint, target, speed)
            joint.move(target, time, brake)
            times.append(max(time, brake))
        return times

    def move_times(self, joints: Columns, targets: Array, speeds: Array) -> Array:
        """How long such moves would take from now on, s, shape (k,)."""
        return np.array(
            [
                max(planned(durations, joint, target, speed))
                for joint, target, speed in self._with(joints, targets, speeds)
            ]
        )

    def move_within(self, joints: Columns, targets: Array, time: float) -> None:
        """Start moves that all arrive after so many s; no less than ``move_times`` says."""
        self._state.done[joints] = False
        for joint, target, lasting in self._with(joints, targets, np.full(len(targets), time)):
            joint.move(target, *planned(durations_within, joint, target, lasting))

    def _with(
        self, joints: Columns, targets: Array, along: Array
    ) -> Iterator[tuple[Joint, float, float]]:
        """Joints with what they get each."""
        chosen = [self._joints[j] for j in self._state.numbers(joints)]
        return zip(chosen, targets.tolist(), along.tolist(), strict=True)

    def step(self, joints: Indices, positions: Array, velocities: Array | None) -> None:
        """Step the position reference (P4); velocities are its own, where it has them."""
        state = self._state
        state.position_reference[joints] = positions
        state.done[joints] = True
        if velocities is None:
            for j, position in zip(joints.tolist(), positions.tolist(), strict=True):
                self._joints[j].step_to(position)
            return
        for j, position, velocity in zip(
            joints.tolist(), positions.tolist(), velocities.tolist(), strict=True
        ):
            self._joints[j].step_with(position, velocity)

    def ramp(self, joints: Indices, velocities: Array, accelerations: Array) -> None:
        """Ramp the velocity references to new values (P5); shapes (k,)."""
        for j, velocity, acceleration in zip(
            joints.tolist(), velocities.tolist(), accelerations.tolist(), strict=True
        ):
            self._joints[j].ramp(velocity, acceleration)

    def is_ramping(self, j: int) -> bool:
        """Whether a joint has a velocity reference other than zero."""
        return bool(self._joints[j].ramp_target != 0.0)

    def halt(self, joints: Indices) -> None:
        """Stop the velocity references as hard as the joints may (P12)."""
        self.ramp(joints, np.zeros(len(joints)), self._limits.acceleration[joints])

    def set_torque(self, joints: Indices, torques: Array, _: Array | None = None) -> None:
        """Set the torque references (P7), N·m; shapes (k,)."""
        for j, torque in zip(joints.tolist(), torques.tolist(), strict=True):
            self._joints[j].command_torque(torque)

    def set_output(self, joints: Indices, outputs: Array, _: Array | None = None) -> None:
        """Set the outputs (P8), percent; shapes (k,)."""
        for j, output in zip(joints.tolist(), outputs.tolist(), strict=True):
            self._joints[j].output_command = output

    def remaining(self, joints: Columns) -> Array:
        """Time until the moves end, shape (k,), s; 0 where there is none."""
        left = []
        for joint in (self._joints[j] for j in self._state.numbers(joints)):
            whole = max(joint.move_time, joint.brake_time)
            left.append(
                max(0.0, whole - joint.move_cycles * joint.period) if joint.moving else 0.0
            )
        return np.array(left)


def planned(
    plan: Callable[[float, float, float, float, float], tuple[float, float]],
    joint: Joint,
    target: float,
    value: float,
) -> tuple[float, float]:
    """The durations of a move from where a joint's reference is, and of its braking, s.

    Args:
        plan: ``durations`` or ``durations_within``.
        joint: that moves.
        target: rad.
        value: of the plan: the mean speed, rad/s, or the time, s.
    """
    return plan(
        target - joint.reference,
        value,
        joint.moved_velocity,
        joint.max_velocity,
        joint.max_acceleration,
    )

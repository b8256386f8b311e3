# SPDX-License-Identifier: Apache-2.0
"""The references that users set: what runs, the last accepted ones, timeouts (SPEC P, M11).

The position reference of a joint is its trajectory plus the integral of its velocity:
q_ref = trajectory + ∫v dt, in every mode. POSITION leaves the second at zero, VELOCITY the
first still, MIXED uses both, POSITION_DIRECT sets the first. ``laws.advance`` runs them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .config import BoardConfig
from .laws import Joint
from .measurement import Array
from .state import Indices, Joints, State
from .trajectory import durations
from .vocabs import CommandKind

#: Kinds of references that expire, and the timeout of each in the configuration (P12).
TIMED = {
    CommandKind.VELOCITY: "velocity",
    CommandKind.TORQUE: "torque",
    CommandKind.OUTPUT: "output",
}


class References:
    """References of n joints.

    Attributes: last (shape (kinds, n): the last accepted of each kind, M11), speed and
    acceleration (set by the user, rad/s and rad/s²), limit_lower, limit_upper (software limits,
    rad), limit_velocity (rad/s), limit_acceleration (rad/s²).
    """

    def __init__(self, config: BoardConfig, state: State, joints: list[Joint]) -> None:
        n = state.n
        self._state, self._joints = state, joints
        self._period = config.period
        self.last: Array = np.zeros((len(CommandKind), n))
        self.speed = np.array([joint.reference_speed for joint in config.joints])
        self.acceleration = np.array([joint.reference_acceleration for joint in config.joints])
        self._renewed = np.zeros(n)  # cycle of the last reference that expires …
        self._kind = np.full(n, -1)  # … and its kind; -1: none
        self._deadline = np.full(n, np.inf)
        self._next_deadline = math.inf
        self.reconfigure(config)

    def reconfigure(self, config: BoardConfig) -> None:
        """Take new limits and timeouts; running references go on."""
        limits = [joint.limits for joint in config.joints]
        self.limit_lower = np.array([limit.lower for limit in limits])
        self.limit_upper = np.array([limit.upper for limit in limits])
        self.limit_velocity = np.array([limit.velocity for limit in limits])
        self.limit_acceleration = np.array([limit.acceleration for limit in limits])
        timeouts = [joint.timeouts for joint in config.joints]
        self._timeouts = np.full((len(CommandKind), len(limits)), np.inf)
        for kind, name in TIMED.items():
            cycles = np.array([getattr(t, name) for t in timeouts]) / self._period
            self._timeouts[kind] = np.where(cycles > 0.0, np.ceil(cycles - 1e-9), np.inf)
        for j in np.flatnonzero(self._kind >= 0):
            self._deadline[j] = self._renewed[j] + self._timeouts[self._kind[j], j]
        self._next_deadline = float(self._deadline.min())

    def reset(self, joints: Joints, *, bounded: bool) -> None:
        """Hold joints where they are measured to be, at rest (M9).

        A joint found outside its software limits may stay there or move inwards, never
        further out (P9); one that is not calibrated knows no limits.
        """
        for j in self._state.numbers(joints):
            self._joints[j].lower, self._joints[j].upper = -math.inf, math.inf
        self.hold(joints, self._state.position[joints])
        if bounded:
            self.bound(joints)
        self._next_deadline = float(self._deadline.min())

    def bound(self, joints: Joints) -> None:
        """Bound position references by the limits, from where they stand (P9)."""
        for j in self._state.numbers(joints):
            joint = self._joints[j]
            joint.lower = min(joint.limit_lower, joint.reference)
            joint.upper = max(joint.limit_upper, joint.reference)

    def hold(self, joints: Joints, positions: Array) -> None:
        """Set the position reference at once, at rest (P3, M9); shapes (k,)."""
        state = self._state
        self._deadline[joints], self._kind[joints] = np.inf, -1
        state.position_reference[joints], state.velocity_reference[joints] = positions, 0.0
        state.done[joints] = True
        for j, position in zip(state.numbers(joints), positions.tolist(), strict=True):
            self._joints[j].hold(position)

    def move(self, joints: Joints, targets: Array, speeds: Array) -> list[float]:
        """Start minimum-jerk moves from the present reference (P1, P6); shapes (k,).

        Returns:
            How long they take, s.
        """
        self._state.done[joints] = False
        times = []
        for j, target, speed in zip(
            self._state.numbers(joints), targets.tolist(), speeds.tolist(), strict=True
        ):
            joint = self._joints[j]
            time, brake = durations(
                target - joint.reference,
                speed,
                joint.moved_velocity,
                joint.max_velocity,
                joint.max_acceleration,
            )
            joint.move(target, time, brake)
            times.append(max(time, brake))
        return times

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

    def roll(self, joints: Indices, velocities: Array, accelerations: Array) -> None:
        """Ramp the velocity references to new values (P5); shapes (k,)."""
        for j, velocity, acceleration in zip(
            joints.tolist(), velocities.tolist(), accelerations.tolist(), strict=True
        ):
            self._joints[j].roll(velocity, acceleration)

    def rolls(self, j: int) -> bool:
        """Whether a joint has a velocity reference other than zero."""
        return bool(self._joints[j].roll_target != 0.0)

    def halt(self, joints: Indices) -> None:
        """Stop the velocity references as hard as the joints may (P12)."""
        self.roll(joints, np.zeros(len(joints)), self.limit_acceleration[joints])

    def renew(self, kind: CommandKind, joints: Indices, cycle: int) -> None:
        """Let the timeouts of a kind run from now, if it has any (P12)."""
        if kind not in TIMED:
            return
        self._renewed[joints], self._kind[joints] = cycle, kind
        self._deadline[joints] = cycle + self._timeouts[kind, joints]
        self._next_deadline = float(self._deadline.min())

    def expired(self, cycle: int) -> NDArray[np.intp] | None:
        """The joints whose reference ran out in this cycle, or None."""
        if cycle < self._next_deadline:
            return None
        late = np.flatnonzero(self._deadline <= cycle)
        self._deadline[late], self._kind[late] = np.inf, -1
        self._next_deadline = float(self._deadline.min())
        return late

    def remaining(self, joints: Joints) -> Array:
        """Time until the moves end, shape (k,), s; 0 where there is none."""
        left = []
        for joint in (self._joints[j] for j in self._state.numbers(joints)):
            whole = max(joint.move_time, joint.brake_time)
            left.append(
                max(0.0, whole - joint.move_cycles * joint.period) if joint.moving else 0.0
            )
        return np.array(left)

# SPDX-License-Identifier: Apache-2.0
"""The references in force and the last accepted ones (SPEC P1 to P6, P9, P12, M11).

The position reference of a joint is its trajectory plus the integral of its velocity:
q_ref = trajectory + ∫v dt, in every mode. POSITION leaves the second at zero, VELOCITY the
first still, MIXED uses both, POSITION_DIRECT sets the first at a step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .config import BoardConfig
from .measurement import Array
from .state import Indices, Joints, State
from .trajectory import Trajectories, durations, ramp
from .vocabs import CommandKind

#: Kinds of references that expire, and the timeout of each in the configuration (P12).
TIMED = {
    CommandKind.VELOCITY: "velocity",
    CommandKind.TORQUE: "torque",
    CommandKind.OUTPUT: "output",
}


class References:
    """References of n joints.

    Attributes: trajectories, last (shape (kinds, n): the last accepted of each kind, M11),
    speed and acceleration (set by the user, rad/s and rad/s²), lower and upper (bounds of the
    position reference, rad), integral (∫v dt, rad).
    """

    def __init__(self, config: BoardConfig, state: State) -> None:
        n = state.n
        self._state = state
        self._period = config.period
        self.trajectories = Trajectories(n, config.period)
        self.last: Array = np.zeros((len(CommandKind), n))
        self.speed = np.array([joint.reference_speed for joint in config.joints])
        self.acceleration = np.array([joint.reference_acceleration for joint in config.joints])
        self.lower, self.upper = np.full(n, -np.inf), np.full(n, np.inf)
        self.integral: Array = np.zeros(n)
        self._velocity, self._target = np.zeros(n), np.zeros(n)
        self._up, self._down, self._scratch = np.zeros(n), np.zeros(n), np.zeros(n)
        self._rolling = self._driven = False  # any velocity, any velocity asked for
        self._deadline = np.full(n, np.inf)
        self._next_deadline = np.inf
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

    def reset(self, joints: Joints, *, bounded: bool) -> None:
        """Hold joints where they are measured to be, at rest (M9).

        A joint found outside its software limits may stay there or move inwards, never
        further out (P9); one that is not calibrated knows no limits.
        """
        self.lower[joints], self.upper[joints] = -np.inf, np.inf
        self.hold(joints, self._state.position[joints])
        if bounded:
            self.bound(joints)
        self._next_deadline = float(self._deadline.min())

    def bound(self, joints: Joints) -> None:
        """Bound position references by the limits, from where they stand (P9)."""
        reference = self._state.position_reference[joints]
        self.lower[joints] = np.minimum(self.limit_lower[joints], reference)
        self.upper[joints] = np.maximum(self.limit_upper[joints], reference)

    def hold(self, joints: Joints, positions: Array) -> None:
        """Set the position reference at once, at rest (P3, P4); shapes (k,)."""
        self.trajectories.hold(joints, positions)
        self._deadline[joints] = np.inf
        self.integral[joints] = 0.0
        if self._rolling:
            self._velocity[joints] = 0.0
            self._target[joints] = 0.0
            self._driven = bool(self._target.any())
        self._state.position_reference[joints] = positions
        self._state.velocity_reference[joints] = 0.0

    def move(self, joints: Joints, targets: Array, speeds: Array) -> None:
        """Start minimum-jerk moves from the present reference (P1, P6); shapes (k,)."""
        start = self._state.position_reference[joints]
        self.integral[joints] = 0.0
        time, brake = durations(
            targets - start,
            speeds,
            self.trajectories.velocity[joints],
            self.limit_velocity[joints],
            self.limit_acceleration[joints],
        )
        self.trajectories.move(joints, start, targets, time, brake)

    def roll(self, joints: Indices, velocities: Array, accelerations: Array) -> None:
        """Ramp the velocity references to new values (P5); shapes (k,)."""
        self._target[joints] = velocities
        self._up[joints] = accelerations * self._period
        self._down[joints] = -self._up[joints]
        self._rolling, self._driven = True, bool(self._target.any())

    def rolls(self, j: int) -> bool:
        """Whether a joint has a velocity reference other than zero."""
        return bool(self._target[j] != 0.0)

    def halt(self, joints: Indices) -> None:
        """Stop the velocity references as hard as the joints may (P12)."""
        self.roll(joints, np.zeros(len(joints)), self.limit_acceleration[joints])

    def renew(self, kind: CommandKind, joints: Indices, cycle: int) -> None:
        """Let the timeouts of a kind run from now, if it has any (P12)."""
        if kind not in TIMED:
            return
        self._deadline[joints] = cycle + self._timeouts[kind, joints]
        self._next_deadline = float(self._deadline.min())

    def expired(self, cycle: int) -> NDArray[np.intp] | None:
        """The joints whose reference ran out in this cycle, or None."""
        if cycle < self._next_deadline:
            return None
        late = np.flatnonzero(self._deadline <= cycle)
        self._deadline[late] = np.inf
        self._next_deadline = float(self._deadline.min())
        return late

    def advance(self) -> None:
        """One control period: the position and velocity references of now."""
        moves = self.trajectories
        if not (moves.moving or self._rolling):
            return
        if moves.moving:
            moves.advance()
        state, scratch = self._state, self._scratch
        reference = state.position_reference
        if self._rolling:
            velocity = self._velocity
            ramp(velocity, self._target, self._up, self._down, scratch)
            np.multiply(velocity, self._period, scratch)
            np.add(self.integral, scratch, self.integral)
            np.add(moves.velocity, velocity, state.velocity_reference)
            self._rolling = self._driven or bool(velocity.any())
        else:
            state.velocity_reference[:] = moves.velocity
        np.add(moves.position, self.integral, scratch)
        np.minimum(scratch, self.upper, out=reference)
        np.maximum(reference, self.lower, out=reference)
        if scratch.tobytes() != reference.tobytes():
            self._stop_at_limits(scratch)

    def _stop_at_limits(self, wanted: Array) -> None:
        """Where a limit cut the reference, what pushed it there ends (P9)."""
        state = self._state
        cut = np.flatnonzero(wanted != state.position_reference)
        reference = state.position_reference[cut]
        # A move that leads beyond a limit for a while still ends on its target.
        move = np.clip(self.trajectories.position[cut], self.lower[cut], self.upper[cut])
        self.integral[cut] = reference - move
        self._velocity[cut] = 0.0
        state.velocity_reference[cut] = 0.0

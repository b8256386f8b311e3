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
from .trajectory import Trajectories, durations, ramps
from .vocabs import CommandKind

#: Cycles that are planned in one go.
AHEAD = 32

#: Kinds of references that expire, and the timeout of each in the configuration (P12).
TIMED = {
    CommandKind.VELOCITY: "velocity",
    CommandKind.TORQUE: "torque",
    CommandKind.OUTPUT: "output",
}


class References:
    """References of n joints.

    What is to come is known until a user sends something new: the references of the next AHEAD
    cycles are planned in one go, since the number of numpy calls is what a cycle costs.

    Attributes: trajectories, last (shape (kinds, n): the last accepted of each kind, M11),
    speed and acceleration (set by the user, rad/s and rad/s²), lower and upper (bounds of the
    position reference, rad).
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
        # Position and velocity, shape (…, 2, n): of the trajectory, of the velocity reference
        # (∫v dt and v), and their sum; now, and planned.
        self._moved, self._rolled = np.zeros((2, n)), np.zeros((2, n))
        self._moves, self._rolls = np.zeros((AHEAD, 2, n)), np.zeros((AHEAD, 2, n))
        self._plan = np.zeros((AHEAD, 2, n))
        self._row = self._rows = 0  # of the plan: how many are past, how many there are
        self._active = False  # something moves
        self._cut = False  # by a limit
        self._target, self._step = np.zeros(n), np.zeros(n)  # of v: rad/s, rad/s per cycle
        self._driven = False  # any velocity asked for
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
        self._land()
        reference = self._state.position_reference[joints]
        self.lower[joints] = np.minimum(self.limit_lower[joints], reference)
        self.upper[joints] = np.maximum(self.limit_upper[joints], reference)

    def hold(self, joints: Joints, positions: Array) -> None:
        """Set the position reference at once, at rest (P3, P4); shapes (k,)."""
        self._land()
        self.trajectories.hold(joints, positions)
        self._deadline[joints] = np.inf
        self._moved[0, joints] = self._state.position_reference[joints] = positions
        self._moved[1, joints] = self._state.velocity_reference[joints] = 0.0
        self._rolled[:, joints] = 0.0
        if self._driven:
            self._target[joints] = 0.0
            self._driven = bool(self._target.any())

    def move(self, joints: Joints, targets: Array, speeds: Array) -> None:
        """Start minimum-jerk moves from the present reference (P1, P6); shapes (k,)."""
        self._land()
        start, velocity = self._state.position_reference[joints], self._moved[1, joints]
        time, brake = durations(
            targets - start,
            speeds,
            velocity,
            self.limit_velocity[joints],
            self.limit_acceleration[joints],
        )
        self.trajectories.move(joints, start, velocity, targets, time, brake)
        self._moved[0, joints] = start
        self._rolled[0, joints] = 0.0
        self._active = True

    def roll(self, joints: Indices, velocities: Array, accelerations: Array) -> None:
        """Ramp the velocity references to new values (P5); shapes (k,)."""
        self._land()
        self._target[joints] = velocities
        self._step[joints] = accelerations * self._period
        self._active, self._driven = True, bool(self._target.any())

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
        if not self._active:
            return
        if self._row == self._rows and not self._look_ahead():
            return
        self._state.motion[:] = self._plan[self._row]
        self._row += 1
        self.trajectories.advance()

    def _land(self) -> None:
        """Leave the plan: what is now becomes the start of the next one."""
        if self._row:
            self._moved[:] = self._moves[self._row - 1]
            self._rolled[:] = self._rolls[self._row - 1]
        self._row = self._rows = 0

    def _look_ahead(self) -> bool:
        """Plan the next cycles, up to where a limit cuts (P9); false when nothing moves."""
        self._land()
        moving, rolling = self.trajectories.moving, self._driven or bool(self._rolled[1].any())
        self._active = moving or rolling
        if not self._active:
            return False
        rows = 1 if self._cut else AHEAD  # where a limit cuts, it mostly does so again
        moves, rolls, plan = self._moves[:rows], self._rolls[:rows], self._plan[:rows]
        if moving:
            self.trajectories.profiles(moves)
        else:
            moves[:] = self._moved
        if rolling:
            velocities = ramps(self._rolled[1], self._target, self._step, rows)
            np.cumsum(velocities * self._period, axis=0, out=rolls[:, 0])
            rolls[:, 0] += self._rolled[0]
            rolls[:, 1] = velocities
        else:
            rolls[:] = self._rolled
        np.add(moves, rolls, out=plan)
        wanted = plan[:, 0].copy()
        np.clip(wanted, self.lower, self.upper, out=plan[:, 0])
        cut = wanted != plan[:, 0]
        self._rows, self._cut = rows, bool(cut[0].any())
        if self._cut:
            self._stop_at_limits(np.flatnonzero(cut[0]))
            self._rows = 1
        elif cut.any():
            self._rows = int(cut.any(axis=1).argmax())
        return True

    def _stop_at_limits(self, cut: Indices) -> None:
        """Where a limit cuts the next reference, what pushed it there ends (P9)."""
        # A move that leads beyond a limit for a while still ends on its target.
        move = np.clip(self._moves[0, 0, cut], self.lower[cut], self.upper[cut])
        self._rolls[0, 0, cut] = self._plan[0, 0, cut] - move
        self._rolls[0, 1, cut] = 0.0
        self._plan[0, 1, cut] = 0.0

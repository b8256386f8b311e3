# SPDX-License-Identifier: Apache-2.0
"""The references of users: those that run, and the last accepted ones (SPEC P, M11).

The position reference of a joint is its trajectory plus the integral of its velocity:
q_ref = trajectory + ∫v dt, in every mode. POSITION leaves the second at zero, VELOCITY the
first unchanged, MIXED uses both, POSITION_DIRECT sets the first. ``laws.advance`` runs them.

References of torque, output and velocity expire (P12), by the time that passed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..config.config import BoardConfig
from ..state import Indices, StateArrays
from ..terms.measurement import Array
from ..terms.vocabs import CommandKind
from .joint import Joint
from .trajectory import Effort, Plan, durations, durations_within


class ReferenceTimeouts:
    """The deadline of each joint's last reference of a kind that expires.

    Times are in control periods of the board's clock.

    Args:
        lasting: how long each kind lasts, shape (kinds, n); infinite where it never expires.
    """

    def __init__(self, lasting: Array) -> None:
        n = lasting.shape[1]
        self._lasting = lasting
        self._own = np.full(n, np.nan)  # duration that the last reference brought
        self._renewed = np.zeros(n)  # time of the last reference that expires …
        self._kind = np.full(n, -1)  # … and its kind; -1: none
        self._deadline = np.full(n, np.inf)
        self._next = math.inf
        self._running: set[int] = set()  # joints with a reference of any kind

    def reconfigure(self, lasting: Array) -> None:
        """Apply new durations, also to active references."""
        self._lasting = lasting
        for j in np.flatnonzero((self._kind >= 0) & np.isnan(self._own)):
            self._deadline[j] = self._renewed[j] + lasting[self._kind[j], j]
        self._next = float(self._deadline.min())

    def renew(
        self, kind: CommandKind, joints: Indices, now: float, lasts: float | None = None
    ) -> None:
        """Restart the timeouts of a kind; ``lasts``: duration of these references."""
        self._running.update(joints.tolist())
        self._renewed[joints], self._kind[joints] = now, kind
        self._own[joints] = np.nan if lasts is None else lasts
        self._deadline[joints] = now + (self._lasting[kind, joints] if lasts is None else lasts)
        self._next = float(self._deadline.min())

    def cancel(self, joints: Sequence[int]) -> None:
        """Cancel the timeouts of joints."""
        if self._running.isdisjoint(joints):
            return
        self._running.difference_update(joints)
        self._deadline[joints], self._kind[joints] = np.inf, -1
        self._next = float(self._deadline.min())

    def expired(self, now: float) -> NDArray[np.intp] | None:
        """The joints whose reference expires by now, or None."""
        if now < self._next:
            return None
        late = np.flatnonzero(self._deadline <= now)
        self.cancel(late.tolist())
        return late


class Moves(NamedTuple):
    """Position moves that start together.

    Attributes: joints (that start), factors (of each duration to that of its joint by itself, for
    the torques that they need; of one part the same), plans (durations of each and
    of its braking, s).
    """

    joints: list[int]
    factors: list[float]
    plans: list[Plan]

    @property
    def times(self) -> list[float]:
        """Duration of each, s."""
        return [max(plan) for plan in self.plans]


class References:
    """References of n joints.

    Args:
        config: of the board.
        state: of the board; its rows of references are written.
        joints: whose laws follow the references.
        efforts: of each joint, the torque that moves of its part need; None: it is not known.

    Attributes: last (shape (kinds, n): the last accepted of each kind, M11), speed and
    acceleration (set by the user, rad/s and rad/s², shape (n,)).
    """

    def __init__(
        self,
        config: BoardConfig,
        state: StateArrays,
        joints: list[Joint],
        efforts: Sequence[Effort | None] = (),
    ) -> None:
        self._state, self._joints = state, joints
        self._efforts = efforts or [None] * state.n
        self.last: Array = np.zeros((len(CommandKind), state.n))
        self._moves: Array = np.full((2, state.n), np.nan)  # target and speed of the last move
        self.speed, self.acceleration = np.zeros(state.n), np.zeros(state.n)
        self.power_on(range(state.n), config)

    def power_on(self, joints: Sequence[int], config: BoardConfig) -> None:
        """Reset the references of joints, and the settings of users (N1)."""
        for j in joints:
            joint = config.joints[j]
            self.last[:, j] = 0.0
            self.speed[j], self.acceleration[j] = (
                joint.reference_speed,
                joint.reference_acceleration,
            )

    def reset(self, joints: Sequence[int], *, bounded: bool) -> None:
        """Hold joints where they are, or come to rest (M9).

        A joint found outside its software limits may stay there or move inwards, never
        further out (P9); one that is not calibrated has no limits.
        """
        for j in joints:
            reference = self._joints[j].reference
            reference.lower, reference.upper = -math.inf, math.inf
        self.hold(joints, self.places(joints))
        if bounded:
            self.bound(joints)

    def places(self, joints: Sequence[int]) -> list[float]:
        """Where joints are: as measured, and as they went on since (B7), rad."""
        return [float(self._state.position[j]) + self._joints[j].behind for j in joints]

    def bound(self, joints: Sequence[int]) -> None:
        """Bound position references by the limits, from their present values (P9)."""
        for j in joints:
            joint = self._joints[j]
            reference, limits = joint.reference, joint.limits
            reference.lower = min(limits.lower, reference.position)
            reference.upper = max(limits.upper, reference.position)

    def hold(self, joints: Sequence[int], positions: Sequence[float]) -> None:
        """Stop at positions, or where joints in motion come to rest (P3, M9)."""
        state = self._state
        self._moves[:, joints] = np.nan
        for j, position in zip(joints, positions, strict=True):
            joint = self._joints[j]
            joint.hold(position)
            state.position_reference[j] = joint.reference.position
            state.velocity_reference[j] = 0.0
            state.done[j] = True

    def move(self, joints: Indices, targets: Array, speeds: Array) -> Moves:
        """Start minimum-jerk moves from the present reference (P1, P6); shapes (k,).

        A joint whose last move had this target and speed, and goes on or has ended there, keeps it
        (P15).
        """
        new = ~self._repeated(joints, targets, speeds)
        joints, targets, speeds = joints[new], targets[new], speeds[new]
        self._moves[:, joints] = targets, speeds
        return self._start(joints, targets, self.plan_moves(joints, targets, speeds))

    def _repeated(self, joints: Indices, targets: Array, speeds: Array) -> NDArray[np.bool_]:
        """Which moves are those under way, or have ended with the reference at their target."""
        repeated: NDArray[np.bool_] = (self._moves[:, joints] == (targets, speeds)).all(axis=0)
        for k in np.flatnonzero(repeated).tolist():
            joint = self._joints[int(joints[k])]
            repeated[k] = joint.trajectory.moving or joint.reference.position == targets[k]
        return repeated

    def plan_moves(self, joints: Indices, targets: Array, speeds: Array) -> Moves:
        """The plan of such moves, from the present state."""
        each = zip(joints.tolist(), targets.tolist(), speeds.tolist(), strict=True)
        plans = [planned(durations, self._joints[j], target, speed) for j, target, speed in each]
        return self._stretched(joints, targets, plans, [max(plan) for plan in plans])

    def move_within(self, joints: Indices, targets: Array, time: float) -> Moves:
        """Start moves that all arrive after ``time`` s, at least that of ``plan_moves``."""
        each = zip(joints.tolist(), targets.tolist(), strict=True)
        plans = [planned(durations_within, self._joints[j], target, time) for j, target in each]
        self._moves[:, joints] = np.nan
        moves = self._stretched(joints, targets, plans, [time] * len(plans))
        return self._start(joints, targets, moves)

    def _stretched(
        self, joints: Indices, targets: Array, plans: list[Plan], times: list[float]
    ) -> Moves:
        """Moves as planned, longer than ``times`` (s) where torques of a part's arm require it."""
        numbers, places = joints.tolist(), targets.tolist()
        efforts = [self._efforts[j] for j in numbers]
        factors, made = [1.0] * len(plans), list(plans)

        def plan(some: list[int], factor: float) -> list[Plan]:
            if factor == 1.0:
                return [plans[k] for k in some]
            longer = partial(durations_within, stretch=factor)
            return [
                planned(longer, self._joints[numbers[k]], places[k], factor * times[k])
                for k in some
            ]

        for effort in dict.fromkeys(efforts):
            if effort is None:
                continue
            some = [k for k, its in enumerate(efforts) if its is effort]
            factor, stretched = effort.stretched(
                [numbers[k] for k in some], [places[k] for k in some], partial(plan, some)
            )
            for k, move in zip(some, stretched, strict=True):
                factors[k], made[k] = factor, move
        return Moves(numbers, factors, made)

    def _start(self, joints: Indices, targets: Array, moves: Moves) -> Moves:
        self._state.done[joints] = False
        for j, target, (time, brake) in zip(
            joints.tolist(), targets.tolist(), moves.plans, strict=True
        ):
            self._joints[j].move(target, time, brake)
        plans = [
            (trajectory.time, trajectory.brake_time) if trajectory.brakes_evenly else plan
            for trajectory, plan in zip(
                (self._joints[j].trajectory for j in moves.joints), moves.plans, strict=True
            )
        ]
        return moves._replace(plans=plans)

    def step(self, joints: Indices, positions: Array, velocities: Array | None) -> None:
        """Step the position reference (P4), with its velocities where given."""
        state = self._state
        state.position_reference[joints] = positions
        state.done[joints] = True
        for j in joints.tolist():
            self._joints[j].reference.entry_speed = self.speed[j]
        if velocities is None:
            for j, position in zip(joints.tolist(), positions.tolist(), strict=True):
                self._joints[j].step_to(position)
            self._step_together([j for j in joints.tolist() if self._joints[j].is_far()])
            return
        for j, position, velocity in zip(
            joints.tolist(), positions.tolist(), velocities.tolist(), strict=True
        ):
            self._joints[j].step_with(position, velocity)

    def _step_together(self, joints: list[int]) -> None:
        """Plan steps of several joints of an arm; those from motion may become moves (P4, P14)."""
        for effort in dict.fromkeys(self._efforts[j] for j in joints):
            numbers = [j for j in joints if self._efforts[j] is effort]
            if effort is None or len(numbers) < 2 or effort.step(numbers):
                continue
            which = np.array(numbers)
            targets = np.array([self._joints[j].give_back() for j in numbers])
            fastest = np.array([self._joints[j].limits.velocity for j in numbers])
            self._start(which, targets, self.plan_moves(which, targets, fastest))
            self._state.done[which] = True

    def ramp(self, joints: Indices, velocities: Array, accelerations: Array) -> None:
        """Ramp the velocity references to new values (P5); shapes (k,)."""
        for j, velocity, acceleration in zip(
            joints.tolist(), velocities.tolist(), accelerations.tolist(), strict=True
        ):
            self._joints[j].ramp_to(velocity, acceleration)

    def set_velocity(self, joints: Indices, velocities: Array, _: Array | None = None) -> None:
        """Set the velocity references without a ramp (Y1), rad/s; shapes (k,)."""
        for j, velocity in zip(joints.tolist(), velocities.tolist(), strict=True):
            self._joints[j].drive_at(velocity)

    def is_ramping(self, j: int) -> bool:
        """Whether a joint has a velocity reference other than zero."""
        return bool(self._joints[j].ramp.target != 0.0)

    def halt(self, joints: Indices) -> None:
        """Stop the velocity references at the acceleration limits (P12)."""
        for j in joints.tolist():
            self._joints[j].halt()

    def set_torque(self, joints: Indices, torques: Array, _: Array | None = None) -> None:
        """Set the torque references (P7), N·m; shapes (k,)."""
        for j, torque in zip(joints.tolist(), torques.tolist(), strict=True):
            self._joints[j].command_torque(torque)

    def set_output(self, joints: Indices, outputs: Array, _: Array | None = None) -> None:
        """Set the outputs (P8), percent; shapes (k,)."""
        for j, output in zip(joints.tolist(), outputs.tolist(), strict=True):
            self._joints[j].output_command = output

    def set_current(self, joints: Indices, currents: Array, _: Array | None = None) -> None:
        """Set the motor currents (Y2), A; shapes (k,)."""
        for j, current in zip(joints.tolist(), currents.tolist(), strict=True):
            self._joints[j].command_current(current)

    def remaining(self, joints: Indices) -> Array:
        """Time until the moves end, shape (k,), s; 0 where there is none."""
        left = []
        for joint in (self._joints[j] for j in joints.tolist()):
            trajectory = joint.trajectory
            whole = max(trajectory.time, trajectory.brake_time)
            past = trajectory.cycles * joint.clock.period
            left.append(max(0.0, whole - past) if trajectory.moving else 0.0)
        return np.array(left)


def planned(
    plan: Callable[..., tuple[float, float]], joint: Joint, target: float, value: float
) -> tuple[float, float]:
    """The durations of a move from where a joint's reference is, and of its braking, s.

    Args:
        plan: ``durations`` or ``durations_within``.
        joint: that moves.
        target: rad.
        value: of the plan: the mean speed, rad/s, or the time, s.
    """
    return plan(
        target - joint.reference.position,
        value,
        joint.trajectory.velocity,
        joint.wire.speed_share * joint.limits.velocity,  # a drive behind a wire needs room (B7)
        joint.limits.acceleration,
        acceleration=joint.trajectory.acceleration,
        max_jerk=joint.limits.jerk,
    )

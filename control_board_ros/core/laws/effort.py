# SPDX-License-Identifier: Apache-2.0
"""The duration of moves in which no joint needs more torque than it has (SPEC P1).

Joints that move together load each other: what one accelerates, others must hold. The torque
of the arm's motion grows with the square of its speed, so moves that are k times as long
need 1/k² of it (Hollerbach, Dynamic scaling of manipulator trajectories, 1984); what gravity and
friction take is left as it is. Where other moves are under way, only the new ones are stretched.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from ..model.dynamics import Arm
from .laws import Joint

#: Part of a joint's torque that a planned motion may use; the rest is for its control.
SHARE = 0.9
#: Where a move is looked at, and how often it is stretched, by how much at least.
SAMPLES, TRIES, LEAST_STRETCH = 14, 16, 1.02

#: Durations of a move and of its braking, s; see ``trajectory.durations``.
Plan = tuple[float, float]


class Effort:
    """The torque that moves of one arm need.

    Args:
        arm: the dynamics of its joints.
        joints: which move.
        first: the board's number of the first of them.
    """

    def __init__(self, arm: Arm, joints: Sequence[Joint], first: int) -> None:
        self._arm, self._joints, self._first = arm, joints, first

    def stretched(
        self,
        chosen: Sequence[int],
        targets: Sequence[float],
        plan: Callable[[float], list[Plan]],
    ) -> tuple[float, list[Plan]]:
        """Moves stretched by one factor until no joint needs more torque than it has.

        Args:
            chosen: the board's numbers of the joints that start to move.
            targets: where to.
            plan: their moves, stretched by a factor.

        Returns:
            The factor, and the plan with it.
        """
        factor, moves = 1.0, plan(1.0)
        if not all(joint.calibrated for joint in self._joints):
            return factor, moves
        self._note_others()
        for _ in range(TRIES):
            for j, target, (time, brake) in zip(chosen, targets, moves, strict=True):
                self._note_move(j, target, time, brake)
            excess = self._arm.excess(SAMPLES)
            if excess <= 1.0:
                break
            factor *= max(math.sqrt(excess), LEAST_STRETCH)
            moves = plan(factor)
        return factor, moves

    def _note_others(self) -> None:
        """Where all joints are, what moves, and what their motors have."""
        for body, joint in zip(self._arm.bodies, self._joints, strict=True):
            volts = joint.max_output / joint.percent_per_volt
            torque_per_volt = joint.torque_per_ampere / joint.ohms
            body.limit = SHARE * joint.max_torque
            body.stall = SHARE * volts * torque_per_volt
            body.fading = SHARE * joint.emf * torque_per_volt
            body.lower, body.upper = joint.lower, joint.upper
            body.drift = joint.ramp_velocity
            if joint.moving:
                body.start, body.start_velocity = joint.move_start, joint.move_velocity
                body.target = joint.move_target
                body.time, body.brake = joint.move_time, joint.brake_time
                body.past = joint.move_cycles * joint.period
            else:
                body.start = body.target = joint.reference
                body.start_velocity = body.time = body.brake = body.past = 0.0

    def _note_move(self, j: int, target: float, time: float, brake: float) -> None:
        """A move that begins now."""
        body, joint = self._arm.bodies[j - self._first], self._joints[j - self._first]
        body.start, body.start_velocity = joint.reference, joint.moved_velocity
        body.target, body.time, body.brake, body.past = target, time, brake, 0.0

# SPDX-License-Identifier: Apache-2.0
"""One method for each kind of reference, as a board and a robot have them (SPEC P)."""

from __future__ import annotations

from typing import Protocol

from ..protocols import Joints, Values
from .reply import Reply
from .vocabs import CommandKind

K = CommandKind


class TakesCommands(Protocol):
    """Whoever takes references of any kind; ``commands.COMMANDS`` says what may come along."""

    def command(
        self, kind: CommandKind, joints: Joints, values: Values, along: Values | None = None
    ) -> Reply: ...


class ReferenceMethods:
    """References by their own names.

    Args:
        target: takes them.
    """

    def __init__(self, target: TakesCommands) -> None:
        self._target = target

    def position_move(
        self, joints: Joints, positions: Values, speeds: Values | None = None
    ) -> Reply:
        """Start minimum-jerk moves at the set reference speeds, or at the speeds given (P1)."""
        return self._target.command(K.POSITION, joints, positions, speeds)

    def set_position(
        self, joints: Joints, positions: Values, velocities: Values | None = None
    ) -> Reply:
        """Step the position reference (P4).

        Args:
            joints: whose reference it is.
            positions: rad.
            velocities: the references' own velocities, rad/s; None: the board takes the mean of
                those that follow each other closely, and 0 for a single step.
        """
        return self._target.command(K.POSITION_DIRECT, joints, positions, velocities)

    def velocity_move(
        self, joints: Joints, velocities: Values, accelerations: Values | None = None
    ) -> Reply:
        """Set the reference velocity, reached with the reference acceleration (P5)."""
        return self._target.command(K.VELOCITY, joints, velocities, accelerations)

    def set_ref_torque(self, joints: Joints, torques: Values) -> Reply:
        """Set the reference torque (P7)."""
        return self._target.command(K.TORQUE, joints, torques)

    def set_output(self, joints: Joints, outputs: Values) -> Reply:
        """Set the PWM in percent (P8)."""
        return self._target.command(K.OUTPUT, joints, outputs)

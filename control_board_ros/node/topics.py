# SPDX-License-Identifier: Apache-2.0
"""The command topics: each converts its message and hands it to the board between two cycles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..core.reply import Reply
from .loop import ControlLoop
from .messages import bounded, optional


class CommandTopics:
    """The callbacks of the command topics, each called as its topic in interface.py.

    Args:
        loop: whose board is commanded.
        plant: the simulation, for external torques.
        injection: whether the simulation may be disturbed.
        joint_trajectory: takes a trajectory.
        warn: takes what was ignored or bounded, for the throttled log.
    """

    def __init__(
        self,
        loop: ControlLoop,
        plant: Any,
        *,
        injection: bool,
        joint_trajectory: Callable[[Any], None],
        warn: Callable[[str], None],
    ) -> None:
        self._loop, self._plant, self._injection = loop, plant, injection
        self.joint_trajectory, self._warn = joint_trajectory, warn

    def position(self, message: Any) -> None:
        with self._loop.exclusive() as board:
            joints = bounded(message.names, board.count)
            reply = board.position_move(joints, message.positions, optional(message.speeds))
        self._answer(reply)

    def position_direct(self, message: Any) -> None:
        with self._loop.exclusive() as board:
            reply = board.set_position(bounded(message.names, board.count), message.positions)
        self._answer(reply)

    def velocity(self, message: Any) -> None:
        with self._loop.exclusive() as board:
            joints = bounded(message.names, board.count)
            reply = board.velocity_move(
                joints, message.velocities, optional(message.accelerations)
            )
        self._answer(reply)

    def torque(self, message: Any) -> None:
        with self._loop.exclusive() as board:
            reply = board.set_ref_torque(bounded(message.names, board.count), message.torques)
        self._answer(reply)

    def output(self, message: Any) -> None:
        with self._loop.exclusive() as board:
            reply = board.set_output(bounded(message.names, board.count), message.outputs)
        self._answer(reply)

    def feedforward(self, message: Any) -> None:
        with self._loop.exclusive() as board:
            joints = bounded(message.names, board.count)
            outputs, torques = optional(message.outputs), optional(message.torques)
            reply = board.set_feedforward(joints, outputs, torques)
        self._answer(reply)

    def external_torque(self, message: Any) -> None:
        """Push joints of the simulation from outside, until a 0 comes."""
        if not self._injection:
            self._warn(
                "external torque ignored: fault injection is off; "
                "start the node with allow_fault_injection: true"
            )
            return
        torques = np.asarray(message.torques)
        with self._loop.exclusive() as board:
            names = board.selector.select(bounded(message.names, board.count)).names
            if len(names) == torques.size and np.isfinite(torques).all():
                for name, torque in zip(names, torques.tolist(), strict=True):
                    self._plant.push(name, torque)
                return
        self._warn(
            f"external torque ignored: {torques.size} torques for {len(names)} joints; "
            "send one finite number per named joint"
        )

    def _answer(self, reply: Reply) -> None:
        """Tell what was ignored, and what was accepted and bounded."""
        if reply.message:
            self._warn(reply.message)

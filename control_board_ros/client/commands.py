# SPDX-License-Identifier: Apache-2.0
"""References: commands by topic, fire and forget, one method per kind (SPEC P).

A topic has no answer, so the reply is what the client knows (prediction). What is found wrong is
sent all the same: the board decides, and counts what it ignores (M4).
"""

from __future__ import annotations

from collections.abc import Sequence

from control_board_ros.core.reply import Reply, refused
from control_board_ros.core.selection import RequestError, spread
from control_board_ros.interface import (
    FEEDFORWARD_COMMAND,
    OUTPUT_COMMAND,
    POSITION_COMMAND,
    POSITION_DIRECT_COMMAND,
    TORQUE_COMMAND,
    VELOCITY_COMMAND,
    Endpoint,
)
from control_board_ros.protocols import Joints, Values

from .prediction import Predictor
from .services import Services
from .values import as_given, for_each
from .waiting import Steps


class ReferenceCommands:
    """IPositionControl, IPositionDirect, IVelocityControl, ITorqueControl, IOpenLoopControl."""

    def __init__(self, services: Services, predictor: Predictor) -> None:
        self._services, self._predictor = services, predictor

    def position_move(
        self, joints: Joints, positions: Values, speeds: Values | None = None
    ) -> Steps[Reply]:
        """Start minimum-jerk moves at the set reference speeds, or at the speeds given (P1).

        Args:
            joints: that move.
            positions: targets, rad; one for all joints, or shape (k,).
            speeds: mean speeds, rad/s, likewise.
        """
        return (
            yield from self._send(POSITION_COMMAND, joints, positions=positions, speeds=speeds)
        )

    def relative_move(
        self, joints: Joints, distances: Values, speeds: Values | None = None
    ) -> Steps[Reply]:
        """Start moves by so much from the measured positions, as position_move does (P1).

        Args:
            joints: that move.
            distances: rad; one for all joints, or shape (k,).
            speeds: mean speeds, rad/s, likewise.
        """
        services = self._services
        try:
            selection = yield from services.select(joints)
            ways = for_each(distances, len(selection.names), "distances")
        except RequestError as error:
            return refused(str(error))
        state = yield from services.states.latest()
        targets = state.position[selection.joints] + ways
        return (
            yield from self._send(
                POSITION_COMMAND, selection.names, positions=targets, speeds=speeds
            )
        )

    def set_position(self, joints: Joints, positions: Values) -> Steps[Reply]:
        """Step the position reference, rad (P4)."""
        return (yield from self._send(POSITION_DIRECT_COMMAND, joints, positions=positions))

    def velocity_move(
        self, joints: Joints, velocities: Values, accelerations: Values | None = None
    ) -> Steps[Reply]:
        """Set the reference velocity, reached with the reference acceleration (P5).

        Args:
            joints: that move.
            velocities: rad/s; one for all joints, or shape (k,). They expire (P12).
            accelerations: rad/s², likewise; None: as set.
        """
        return (
            yield from self._send(
                VELOCITY_COMMAND, joints, velocities=velocities, accelerations=accelerations
            )
        )

    def set_ref_torque(self, joints: Joints, torques: Values) -> Steps[Reply]:
        """Set the reference torque, N·m (P7)."""
        return (yield from self._send(TORQUE_COMMAND, joints, torques=torques))

    def set_output(self, joints: Joints, outputs: Values) -> Steps[Reply]:
        """Set the PWM in percent (P8)."""
        return (yield from self._send(OUTPUT_COMMAND, joints, outputs=outputs))

    def set_feedforward(
        self, joints: Joints, outputs: Values | None = None, torques: Values | None = None
    ) -> Steps[Reply]:
        """Set u_ff (percent) and τ_ff (N·m), either or both; they act as P11."""
        if outputs is None and torques is None:
            return refused("feedforward ignored: neither outputs nor torques given")
        return (
            yield from self._send(FEEDFORWARD_COMMAND, joints, outputs=outputs, torques=torques)
        )

    def _send(self, topic: Endpoint, joints: Joints, **fields: Values | None) -> Steps[Reply]:
        """Send a command and say what is known of its fate.

        The first of ``fields`` holds the references, a second one speeds or accelerations.
        """
        kind = topic.reference
        what = "feedforward" if kind is None else f"{kind} reference"
        try:
            selection = yield from self._services.select(joints)
            given = {name: values for name, values in fields.items() if values is not None}
            words = {} if kind is None else {next(iter(fields)): f"{what}s"}
            values = {
                name: spread(array, len(selection.names), words.get(name, name))
                for name, array in given.items()
            }
        except RequestError as error:
            yield from self._publish(topic, self._named(joints), as_given(fields))
            return refused(f"{what} ignored: {error}")
        floats = {name: array.tolist() for name, array in values.items()}
        yield from self._publish(topic, selection.names, floats)
        return (yield from self._predictor.reply(kind, selection, values))

    def _publish(
        self, topic: Endpoint, names: Sequence[str], fields: dict[str, list[float]]
    ) -> Steps[None]:
        yield from self._services.link.publish(topic, names=list(names), **fields)
        self._services.states.changed()

    def _named(self, joints: Joints) -> list[str]:
        """The names of joints that may not exist."""
        if joints is None:
            return []
        given = [joints] if isinstance(joints, str | int) else joints
        names = self._services.modes.names
        return [names[j] if isinstance(j, int) and 0 <= j < len(names) else str(j) for j in given]

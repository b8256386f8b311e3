# SPDX-License-Identifier: Apache-2.0
"""References, one method per kind (SPEC P), their speeds, and the last accepted ones (M11).

``position_move``, ``relative_move`` and ``stop`` are services; their reply is the board's. The
other references are published: their reply confirms only that the message was sent, and the
board counts the rejected ones. With ``answered=True`` they call a service as well. With
``together=True``, also by service, all joints accept their references, or none does; with
``valid_for`` they bring a timeout (P12), as those held by a person do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from control_board_ros.core.selection import RequestError, one_number, spread
from control_board_ros.core.terms.reply import Reply, refused, sent
from control_board_ros.interface import (
    CURRENT_COMMAND,
    FEEDFORWARD_COMMAND,
    GET_REFERENCES,
    OUTPUT_COMMAND,
    POSITION_COMMAND,
    POSITION_DIRECT_COMMAND,
    SEND_REFERENCE,
    SET_REFERENCE_SPEED,
    STOP,
    TORQUE_COMMAND,
    VELOCITY_COMMAND,
    VELOCITY_DIRECT_COMMAND,
    Endpoint,
)
from control_board_ros.protocols import Floats, Joints, Values

from .operations import Interface, operation, request
from .services import arrays


@dataclass(frozen=True, slots=True, eq=False)
class AcceptedReferences:
    """The last accepted references, an array of shape (k,) each; m, m/s, N where a joint slides.

    Attributes:
        positions: targets of position moves, rad.
        direct_positions: rad.
        velocities: of VELOCITY and MIXED, rad/s.
        direct_velocities: of VELOCITY_DIRECT, rad/s.
        ref_velocities: of the present control mode: one of these two, rad/s.
        torques: N·m.
        currents: of the motors, A.
        outputs: PWM, percent.
        speeds: mean speeds of position moves, rad/s.
        accelerations: of velocity references, rad/s².
    """

    positions: Floats
    direct_positions: Floats
    velocities: Floats
    direct_velocities: Floats
    ref_velocities: Floats
    torques: Floats
    currents: Floats
    outputs: Floats
    speeds: Floats
    accelerations: Floats


class References(Interface):
    """IPositionControl to IOpenLoopControl and ICurrentControl: references and stop.

    Arrays of getters have shape (k,).
    """

    @operation
    async def position_move(
        self,
        joints: Joints,
        positions: Values,
        speeds: Values | None = None,
        *,
        together: bool = False,
    ) -> Reply:
        """Start minimum-jerk moves at the set reference speeds, or at the speeds given (P1).

        Args:
            joints: that move.
            positions: targets, rad; one for all joints, or shape (k,).
            speeds: mean speeds, rad/s, likewise.
            together: all joints move, or none does.
        """
        return await self._send(
            POSITION_COMMAND, joints, True, together, positions=positions, speeds=speeds
        )

    @request
    async def relative_move(
        self,
        joints: Joints,
        distances: Values,
        speeds: Values | None = None,
        *,
        together: bool = False,
    ) -> Reply:
        """Start moves relative to the measured positions (P1).

        Args:
            joints: that move.
            distances: rad; one for all joints, or shape (k,).
            speeds: mean speeds, rad/s, likewise.
            together: all joints move, or none does.
        """
        services = self._services
        selection = await services.select(joints)
        ways = spread(distances, len(selection.names), "distances", one_for_all=True)
        state = await services.states.latest()
        targets = state.position[selection.joints] + ways
        return await self._send(
            POSITION_COMMAND, selection.names, True, together, positions=targets, speeds=speeds
        )

    @operation
    async def set_position(
        self,
        joints: Joints,
        positions: Values,
        *,
        answered: bool = False,
        together: bool = False,
    ) -> Reply:
        """Step the position reference, rad (P4); ``answered``, ``together``: by service."""
        return await self._send(
            POSITION_DIRECT_COMMAND, joints, answered, together, positions=positions
        )

    @operation
    async def velocity_move(
        self,
        joints: Joints,
        velocities: Values,
        accelerations: Values | None = None,
        *,
        answered: bool = False,
        together: bool = False,
        valid_for: float = 0.0,
    ) -> Reply:
        """Set the reference velocity, reached with the reference acceleration (P5).

        Args:
            joints: that move.
            velocities: rad/s; one for all joints, or shape (k,). They expire (P12); zero brakes
                at the acceleration limit.
            accelerations: rad/s², likewise; None: as set.
            answered: send by service, for the board's answer.
            together: by service; all joints accept them, or none does.
            valid_for: by service; s until they expire instead of the joint's timeout (0: that).
        """
        return await self._send(
            VELOCITY_COMMAND,
            joints,
            answered,
            together,
            valid_for,
            velocities=velocities,
            accelerations=accelerations,
        )

    @operation
    async def set_ref_torque(
        self,
        joints: Joints,
        torques: Values,
        *,
        answered: bool = False,
        together: bool = False,
        valid_for: float = 0.0,
    ) -> Reply:
        """Set the reference torque, N·m (P7); more as of ``velocity_move``."""
        return await self._send(
            TORQUE_COMMAND, joints, answered, together, valid_for, torques=torques
        )

    @operation
    async def set_ref_velocity(
        self,
        joints: Joints,
        velocities: Values,
        *,
        answered: bool = False,
        together: bool = False,
        valid_for: float = 0.0,
    ) -> Reply:
        """Set the velocity, rad/s, without a ramp (Y1); more as of ``velocity_move``."""
        return await self._send(
            VELOCITY_DIRECT_COMMAND, joints, answered, together, valid_for, velocities=velocities
        )

    @operation
    async def set_ref_current(
        self,
        joints: Joints,
        currents: Values,
        *,
        answered: bool = False,
        together: bool = False,
        valid_for: float = 0.0,
    ) -> Reply:
        """Set the motor current, A (Y2); more as of ``velocity_move``."""
        return await self._send(
            CURRENT_COMMAND, joints, answered, together, valid_for, currents=currents
        )

    @operation
    async def set_output(
        self,
        joints: Joints,
        outputs: Values,
        *,
        answered: bool = False,
        together: bool = False,
        valid_for: float = 0.0,
    ) -> Reply:
        """Set the PWM in percent (P8); more as of ``velocity_move``."""
        return await self._send(
            OUTPUT_COMMAND, joints, answered, together, valid_for, outputs=outputs
        )

    @operation
    async def set_feedforward(
        self,
        joints: Joints,
        outputs: Values | None = None,
        torques: Values | None = None,
        *,
        answered: bool = False,
        together: bool = False,
    ) -> Reply:
        """Set u_ff (percent) and τ_ff (N·m), either or both; they act as P11.

        Args:
            joints: target joints.
            outputs: one for all joints, or shape (k,); None: unchanged.
            torques: likewise.
            answered: send by service, for the board's answer.
            together: by service; all joints accept them, or none does.
        """
        if outputs is None and torques is None:
            return refused("feedforward ignored: neither outputs nor torques given")
        return await self._send(
            FEEDFORWARD_COMMAND, joints, answered, together, outputs=outputs, torques=torques
        )

    @request
    async def stop(self, joints: Joints = None) -> Reply:
        """Set the position reference to the measured position; the mode stays (P3)."""
        return await self._services.stop(STOP, joints)

    @operation
    async def set_ref_speed(self, joints: Joints, speeds: Values) -> Reply:
        """Set the mean speed of later position moves, rad/s (P2)."""
        return await self.set_reference_speed(joints, speeds, None)

    @operation
    async def set_ref_acceleration(self, joints: Joints, accelerations: Values) -> Reply:
        """Set the acceleration of later velocity references, rad/s² (P5)."""
        return await self.set_reference_speed(joints, None, accelerations)

    @request
    async def set_reference_speed(
        self, joints: Joints, speeds: Values | None = None, accelerations: Values | None = None
    ) -> Reply:
        """Set reference speeds (rad/s), accelerations (rad/s²) or both, checked together (P2)."""
        if speeds is None and accelerations is None:
            return refused("neither speeds nor accelerations given; send one of them, or both")
        values = {"speeds": speeds, "accelerations": accelerations}
        return await self._services.change(SET_REFERENCE_SPEED, joints, values)

    @operation
    async def get_references(self, joints: Joints = None) -> AcceptedReferences:
        """The last accepted references of every kind, in one request (M11)."""
        response = await self._services.read(GET_REFERENCES, joints)
        return AcceptedReferences(**arrays(response, AcceptedReferences))

    get_target_position = get_references.field(
        "positions", "The last accepted target of a position move, rad."
    )
    get_ref_position = get_references.field(
        "direct_positions", "The last accepted direct position, rad."
    )
    get_target_velocity = get_references.field(
        "velocities", "The last accepted velocity of VELOCITY and MIXED, rad/s."
    )
    get_direct_velocity = get_references.field(
        "direct_velocities", "The last accepted velocity of VELOCITY_DIRECT, rad/s."
    )
    get_ref_velocity = get_references.field(
        "ref_velocities",
        "The last accepted velocity, rad/s: in VELOCITY_DIRECT that of this mode.",
    )
    get_ref_torque = get_references.field("torques", "The last accepted torque, N·m.")
    get_ref_current = get_references.field("currents", "The last accepted motor current, A.")
    get_output = get_references.field("outputs", "The last accepted output, PWM percent.")
    get_ref_speed = get_references.field("speeds", "Mean speeds of position moves, rad/s.")
    get_ref_acceleration = get_references.field(
        "accelerations", "Accelerations of velocity references, rad/s²."
    )
    set_traj_speed = set_ref_speed.synonym("set_ref_speed")
    get_traj_speed = get_ref_speed.synonym("get_ref_speed")
    set_traj_acceleration = set_ref_acceleration.synonym("set_ref_acceleration")
    get_traj_acceleration = get_ref_acceleration.synonym("get_ref_acceleration")

    async def _send(
        self,
        topic: Endpoint,
        joints: Joints,
        answered: bool,
        together: bool,
        valid_for: float = 0.0,
        **fields: Values | None,
    ) -> Reply:
        """Send by service (``answered``, ``together``, ``valid_for``) or topic.

        The first field has the references.

        An invalid request is sent as well, for the board to answer or count it (P13).
        """
        kind = topic.reference
        what = "feedforward" if kind is None else f"{kind} reference"
        words = {} if kind is None else {next(iter(fields)): f"{what}s"}
        wrong: RequestError | None = None
        by_service = answered or together or valid_for != 0.0
        try:
            lasting = one_number(valid_for, "valid_for")
        except RequestError as error:
            return refused(f"{what} ignored: {error}")
        try:
            names = (await self._services.select(joints)).names
        except RequestError as error:
            wrong, names = error, await self._named(joints)
        values: dict[str, list[float]] = {}
        for name, entry in fields.items():
            if entry is None:
                continue
            try:
                values[name] = spread(entry, len(names), words.get(name, name)).tolist()
            except RequestError as error:
                wrong = wrong or error
                if not (numbers := flat(entry)):  # no list of numbers: not for the board to answer
                    numbers, by_service = [math.nan], False
                values[name] = numbers
        if by_service:
            references, along = (values.get(name, []) for name in [*fields, ""][:2])
            reply, _ = await self._services.ask(
                SEND_REFERENCE,
                names,
                kind=topic.short.rpartition("/")[2],
                values=references,
                along=along,
                together=bool(together),
                valid_for=lasting,
            )
            return reply
        await self._link.publish(topic, names=list(names), **values)
        self._services.states.changed()
        return sent(names) if wrong is None else refused(f"{what} ignored: {wrong}", names)

    async def _named(self, joints: Any) -> tuple[str, ...]:
        """Names of joints of which some are unknown."""
        many = isinstance(joints, Iterable) and not isinstance(joints, str)
        names = (await self._services.find()).names
        return tuple(
            names[j] if isinstance(j, int) and 0 <= j < len(names) else str(j)
            for j in (joints if many else [joints])
        )


def flat(values: Values) -> list[float]:
    """Values of any length as a list; empty where they are no list of numbers."""
    try:
        array = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError, OverflowError):
        return []
    numbers: list[float] = array.tolist() if array.ndim == 1 else []
    return numbers

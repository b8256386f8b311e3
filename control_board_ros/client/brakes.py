# SPDX-License-Identifier: Apache-2.0
"""The brakes of joints (SPEC Y4)."""

from __future__ import annotations

from collections.abc import Sequence

from control_board_ros.core.selection import RequestError, Selection, automatic, by_hand
from control_board_ros.core.terms.reply import Reply, refused
from control_board_ros.core.terms.vocabs import BrakeMode
from control_board_ros.interface import GET_BRAKE, SET_BRAKE
from control_board_ros.protocols import Flags, Joints

from .operations import Interface, operation, request
from .services import reply_of


class BrakeRequests(Interface):
    """IJointBrake."""

    @request
    async def set_brake(self, joints: Joints, modes: str | Sequence[str]) -> Reply:
        """Set the brake modes.

        Args:
            joints: target joints; None: all with a brake.
            modes: ``automatic`` (by the board, as the modes require), ``open`` or ``closed`` (by
                hand); one for all, or one each.
        """
        return await self._work(joints, [modes] if isinstance(modes, str) else list(modes))

    @operation
    async def get_brake(self, joints: Joints = None) -> list[BrakeMode | None]:
        """Brake modes; None where a joint has no brake."""
        response = await self._services.read(GET_BRAKE, joints)
        return [BrakeMode(mode) if mode else None for mode in response.modes]

    @operation
    async def is_joint_braked(self, joints: Joints = None) -> list[bool]:
        """Whether brakes are closed; false where a joint has none."""
        response = await self._services.read(GET_BRAKE, joints)
        return list(response.closed)

    @request
    async def set_manual_brake_active(self, joints: Joints, active: Flags) -> Reply:
        """Close (true) or open brakes by hand."""
        return await self._work(joints, by_hand(active))

    @request
    async def set_auto_brake_enabled(self, joints: Joints, enabled: Flags) -> Reply:
        """Give the brakes to the board (true), or keep their states by hand."""
        response = await self._services.read(GET_BRAKE, joints)
        having = [k for k, mode in enumerate(response.modes) if mode or joints is not None]
        names = [response.names[k] for k in having]
        try:
            modes = automatic(enabled, [response.closed[k] for k in having])
        except RequestError as error:
            return refused(str(error), tuple(names))
        return await self._work(names, modes)

    @operation
    async def get_auto_brake_enabled(self, joints: Joints = None) -> list[bool]:
        """Whether the board controls the brakes; false where a joint has none."""
        response = await self._services.read(GET_BRAKE, joints)
        return [mode == BrakeMode.AUTOMATIC for mode in response.modes]

    async def _work(self, joints: Joints, modes: Sequence[str]) -> Reply:
        services = self._services
        selection = await services.select(joints)
        names = [] if joints is None else list(selection.names)
        response = await self._link.call(SET_BRAKE, names=names, modes=[str(m) for m in modes])
        services.states.changed()
        reported = Selection.of(range(len(response.names)), tuple(response.names))
        return reply_of(response, reported if response.answers else selection)

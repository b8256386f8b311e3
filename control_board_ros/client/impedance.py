# SPDX-License-Identifier: Apache-2.0
"""Stiffness and damping of the compliant interaction mode (SPEC I6)."""

from __future__ import annotations

import numpy as np

from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.reply import Reply, refused
from control_board_ros.interface import GET_IMPEDANCE, SET_IMPEDANCE
from control_board_ros.protocols import Floats, Joints, Values

from .operations import Interface, operation
from .values import for_each


class ImpedanceRequests(Interface):
    """IImpedanceControl."""

    @operation
    async def set_impedance(
        self, joints: Joints, stiffness: Values | None = None, damping: Values | None = None
    ) -> Reply:
        """Set stiffness and damping at any time; effective in the next cycle (I6).

        Args:
            joints: target joints.
            stiffness: N·m/rad (N/m), one for all joints or one each; None: unchanged.
            damping: N·m·s/rad (N·s/m), likewise; None: the board's choice for the stiffness.
        """
        if stiffness is None and damping is None:
            return refused("neither stiffness nor damping given; send one of them, or both")
        services = self._services
        try:
            selection = await services.select(joints)
            if stiffness is None:
                present = await services.read(GET_IMPEDANCE, joints)
                stiffness = present.stiffness
            count = len(selection.names)
            fields = {
                "stiffness": for_each(stiffness, count, "stiffness"),
                "damping": [] if damping is None else for_each(damping, count, "damping"),
            }
        except RequestError as error:
            return refused(str(error))
        return await services.change(SET_IMPEDANCE, selection, **fields)

    @operation
    async def get_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """Stiffness and damping, N·m/rad and N·m·s/rad, two arrays of shape (k,)."""
        response = await self._services.read(GET_IMPEDANCE, joints)
        return np.array(response.stiffness), np.array(response.damping)

    @operation
    async def get_max_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """The largest permitted stiffness and damping, two arrays of shape (k,)."""
        response = await self._services.read(GET_IMPEDANCE, joints)
        return np.array(response.max_stiffness), np.array(response.max_damping)

    @operation
    async def get_torque_offset(self, joints: Joints = None) -> Floats:
        """τ_ff of the impedance law, N·m, shape (k,): as set, or the load on entering."""
        response = await self._services.read(GET_IMPEDANCE, joints)
        return np.array(response.torque_offset)

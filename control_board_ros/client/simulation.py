# SPDX-License-Identifier: Apache-2.0
"""Services of simulated boards only."""

from __future__ import annotations

from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.reply import Reply, refused
from control_board_ros.interface import CLEAR_INJECTED_FAULTS, INJECT_FAULT, PAUSE, RESET, STEP
from control_board_ros.protocols import Joints

from .operations import Interface, operation
from .services import whole

MOST_STEPS = 2**32 - 1  # of one request: a uint32 on the wire


class SimulationRequests(Interface):
    """Pause, step, reset, fault injection."""

    @operation
    async def pause(self, paused: bool = True) -> Reply:
        """Pause or resume the simulation."""
        return await self._services.trigger(PAUSE, data=paused)

    @operation
    async def step(self, steps: int = 1) -> Reply:
        """Advance a paused simulation by ``steps`` control cycles."""
        if not 1 <= steps <= MOST_STEPS:
            return refused(f"steps must be from 1 to {MOST_STEPS}, not {steps}")
        return await self._services.trigger(STEP, steps=steps)

    @operation
    async def reset(self) -> Reply:
        """Return to the initial pose and power-on."""
        return await self._services.trigger(RESET)

    @operation
    async def inject_fault(self, joints: Joints, fault: str, persistent: bool = False) -> Reply:
        """Inject a fault into simulated joints.

        Args:
            joints: target joints.
            fault: ``overcurrent``, ``encoder``, ``torque_sensor``, …; the reply to an unknown
                one lists all.
            persistent: whether the cause remains until clear_injected_faults.
        """
        try:
            selection = await self._services.select(joints)
        except RequestError as error:
            return refused(str(error))
        response = await self._link.call(
            INJECT_FAULT, names=list(selection.names), fault=fault, persistent=persistent
        )
        self._services.states.changed()
        return whole(response.success, response.message, selection.names)

    @operation
    async def clear_injected_faults(self) -> Reply:
        """Remove injected causes; the latch stays until FORCE_IDLE."""
        return await self._services.trigger(CLEAR_INJECTED_FAULTS)

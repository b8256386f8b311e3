# SPDX-License-Identifier: Apache-2.0
"""Measurements, from the board's state."""

from __future__ import annotations

import time
from collections.abc import Callable

from control_board_ros.core.terms.reply import MotionDone
from control_board_ros.interface import STATE
from control_board_ros.protocols import Floats, Joints

from .operations import Interface, operation
from .state import State


class Readings(Interface):
    """IEncoders, and the rest of the state."""

    @operation
    async def get_state(self, *, fresh: bool = True) -> State:
        """The last state of all joints, not older than the last request.

        With ``fresh=False`` the last one received, waiting only for the first.
        """
        await self._services.find()
        return await self._services.states.latest(fresh=fresh)

    @operation
    async def wait_for_state(
        self, condition: Callable[[State], bool], timeout: float | None = None
    ) -> State:
        """Wait until a state fulfils the condition; returns it.

        Args:
            condition: called with each state, in the caller's thread.
            timeout: s; None: the answer timeout.

        Raises:
            BoardTimeout: no such state within the time.
        """
        link = self._link
        patience = link.answer_timeout if timeout is None else timeout
        end = time.monotonic() + patience
        state: State | None = await self.get_state()
        while state is not None:
            if condition(state):
                return state
            state = await self._services.states.following(end - time.monotonic())
        raise link.timed_out(STATE, patience)

    @operation
    async def get_encoder(self, joints: Joints = None) -> Floats:
        """Measured positions, rad, shape (k,)."""
        return await self._measured("position", joints)

    @operation
    async def get_encoder_speed(self, joints: Joints = None) -> Floats:
        """Measured velocities, rad/s, shape (k,)."""
        return await self._measured("velocity", joints)

    @operation
    async def get_torque(self, joints: Joints = None) -> Floats:
        """Measured torques, N·m, shape (k,)."""
        return await self._measured("torque", joints)

    @operation
    async def get_current(self, joints: Joints = None) -> Floats:
        """Motor currents, A, shape (k,)."""
        return await self._measured("current", joints)

    @operation
    async def get_temperature(self, joints: Joints = None) -> Floats:
        """Temperatures of the windings, °C, shape (k,); NaN where there is no sensor."""
        return await self._measured("temperature", joints)

    @operation
    async def get_encoder_acceleration(self, joints: Joints = None) -> Floats:
        """Accelerations, from the measured velocities, rad/s², shape (k,)."""
        return await self._measured("acceleration", joints)

    @operation
    async def check_motion_done(self, joints: Joints = None) -> MotionDone:
        """False from the cycle that accepts a move until its profile ends (P3); see MotionDone."""
        selection = await self._services.select(joints)
        state = await self.get_state()
        return MotionDone(bool(done) for done in state.motion_done[selection.joints])

    async def _measured(self, field: str, joints: Joints) -> Floats:
        selection = await self._services.select(joints)
        state = await self.get_state()
        values: Floats = getattr(state, field)[selection.joints]
        return values

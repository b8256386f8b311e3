# SPDX-License-Identifier: Apache-2.0
"""What the board measures, from its state."""

from __future__ import annotations

import time
from collections.abc import Callable

from control_board_ros.interface import STATE
from control_board_ros.protocols import Floats, Joints

from .services import Services
from .state import State
from .waiting import Steps


class Readings:
    """IEncoders, and the rest of the state."""

    def __init__(self, services: Services) -> None:
        self._services, self._states = services, services.states

    def get_state(self, *, fresh: bool = True) -> Steps[State]:
        """The last state of all joints, one that shows what was asked for before.

        With ``fresh=False`` the last one heard, without waiting once there is one.
        """
        yield from self._services.find()
        return (yield from self._states.latest(fresh=fresh))

    def wait_for_state(
        self, condition: Callable[[State], bool], timeout: float | None = None
    ) -> Steps[State]:
        """Wait until a state fulfils the condition; that state.

        Args:
            condition: called with each state, in the caller's thread.
            timeout: s; None: the answer timeout.

        Raises:
            BoardTimeout: no state did within the time.
        """
        link = self._services.link
        patience = link.answer_timeout if timeout is None else timeout
        end = time.monotonic() + patience
        state: State | None = yield from self.get_state()
        while state is not None:
            if condition(state):
                return state
            state = yield from self._states.following(end - time.monotonic())
        raise link.discovery.timed_out(STATE, patience)

    def get_encoder(self, joints: Joints = None) -> Steps[Floats]:
        """Measured positions, rad, shape (k,)."""
        return (yield from self._measured("position", joints))

    def get_encoder_speed(self, joints: Joints = None) -> Steps[Floats]:
        """Measured velocities, rad/s, shape (k,)."""
        return (yield from self._measured("velocity", joints))

    def get_torque(self, joints: Joints = None) -> Steps[Floats]:
        """Measured torques, N·m, shape (k,)."""
        return (yield from self._measured("torque", joints))

    def get_current(self, joints: Joints = None) -> Steps[Floats]:
        """Motor currents, A, shape (k,)."""
        return (yield from self._measured("current", joints))

    def get_temperature(self, joints: Joints = None) -> Steps[Floats]:
        """Temperatures of the windings, °C, shape (k,); NaN where there is no sensor."""
        return (yield from self._measured("temperature", joints))

    def check_motion_done(self, joints: Joints = None) -> Steps[list[bool]]:
        """False from the cycle that accepts a move until its profile ends (P3)."""
        selection = yield from self._services.select(joints)
        state = yield from self.get_state()
        return [bool(done) for done in state.motion_done[selection.joints]]

    def _measured(self, field: str, joints: Joints) -> Steps[Floats]:
        selection = yield from self._services.select(joints)
        state = yield from self.get_state()
        values: Floats = getattr(state, field)[selection.joints]
        return values

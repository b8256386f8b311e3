# SPDX-License-Identifier: Apache-2.0
"""Reference speeds, stop, and the last accepted references (SPEC P2, P3, M11)."""

from __future__ import annotations

import numpy as np

from control_board_ros.core.reply import Reply, refused
from control_board_ros.core.selection import RequestError
from control_board_ros.interface import GET_REFERENCES, SET_REFERENCE_SPEED, STOP
from control_board_ros.protocols import Floats, Joints, Values

from .services import Services
from .values import for_each
from .waiting import Steps


class ReferenceRequests:
    """What IPositionControl, IVelocityControl and their like have besides references."""

    def __init__(self, services: Services) -> None:
        self._services = services

    def stop(self, joints: Joints = None) -> Steps[Reply]:
        """Set the position reference to the measured position; the mode stays (P3)."""
        try:
            selection = yield from self._services.select(joints)
        except RequestError as error:
            return refused(str(error))
        return (yield from self._services.change(STOP, selection))

    def set_ref_speed(self, joints: Joints, speeds: Values) -> Steps[Reply]:
        """Set the mean speed of later position moves, rad/s (P2)."""
        return (yield from self.set_reference_speed(joints, speeds, None))

    def set_ref_acceleration(self, joints: Joints, accelerations: Values) -> Steps[Reply]:
        """Set the acceleration of later velocity references, rad/s² (P5)."""
        return (yield from self.set_reference_speed(joints, None, accelerations))

    def set_reference_speed(
        self, joints: Joints, speeds: Values | None = None, accelerations: Values | None = None
    ) -> Steps[Reply]:
        """Set reference speeds (rad/s), accelerations (rad/s²) or both, checked together (P2)."""
        if speeds is None and accelerations is None:
            return refused("neither speeds nor accelerations given; send one of them, or both")
        fields = {}
        try:
            selection = yield from self._services.select(joints)
            count = len(selection.names)
            if speeds is not None:
                fields["speeds"] = for_each(speeds, count, "speed")
            if accelerations is not None:
                fields["accelerations"] = for_each(accelerations, count, "acceleration")
        except RequestError as error:
            return refused(str(error))
        return (yield from self._services.change(SET_REFERENCE_SPEED, selection, **fields))

    def get_target_position(self, joints: Joints = None) -> Steps[Floats]:
        """The last accepted target of a position move, rad, shape (k,)."""
        return (yield from self._last("positions", joints))

    def get_ref_position(self, joints: Joints = None) -> Steps[Floats]:
        """The last accepted direct position, rad, shape (k,)."""
        return (yield from self._last("direct_positions", joints))

    def get_ref_velocity(self, joints: Joints = None) -> Steps[Floats]:
        """The last accepted velocity, rad/s, shape (k,)."""
        return (yield from self._last("velocities", joints))

    def get_ref_torque(self, joints: Joints = None) -> Steps[Floats]:
        """The last accepted torque, N·m, shape (k,)."""
        return (yield from self._last("torques", joints))

    def get_output(self, joints: Joints = None) -> Steps[Floats]:
        """The last accepted output, PWM percent, shape (k,)."""
        return (yield from self._last("outputs", joints))

    def get_ref_speed(self, joints: Joints = None) -> Steps[Floats]:
        """Mean speeds of position moves, rad/s, shape (k,)."""
        return (yield from self._last("speeds", joints))

    def get_ref_acceleration(self, joints: Joints = None) -> Steps[Floats]:
        """Accelerations of velocity references, rad/s², shape (k,)."""
        return (yield from self._last("accelerations", joints))

    def _last(self, field: str, joints: Joints) -> Steps[Floats]:
        response = yield from self._services.read(GET_REFERENCES, joints)
        return np.array(getattr(response, field), dtype=np.float64)

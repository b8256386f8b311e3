# SPDX-License-Identifier: Apache-2.0
"""Reference speeds, stop, last accepted references (SPEC P2, P3, M11)."""

from __future__ import annotations

import numpy as np

from control_board_ros.core.terms.modes import DIRECT_VELOCITY
from control_board_ros.core.terms.reply import Reply, refused
from control_board_ros.interface import GET_CONTROL_MODE, GET_REFERENCES, SET_REFERENCE_SPEED, STOP
from control_board_ros.protocols import Floats, Joints, Values

from .operations import Interface, operation, request
from .values import for_each


class ReferenceRequests(Interface):
    """The methods of IPositionControl, IVelocityControl, … besides references."""

    @request
    async def stop(self, joints: Joints = None) -> Reply:
        """Set the position reference to the measured position; the mode stays (P3)."""
        selection = await self._services.select(joints)
        return await self._services.change(STOP, selection)

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
        fields = {}
        selection = await self._services.select(joints)
        count = len(selection.names)
        if speeds is not None:
            fields["speeds"] = for_each(speeds, count, "speed")
        if accelerations is not None:
            fields["accelerations"] = for_each(accelerations, count, "acceleration")
        return await self._services.change(SET_REFERENCE_SPEED, selection, **fields)

    @operation
    async def get_target_position(self, joints: Joints = None) -> Floats:
        """The last accepted target of a position move, rad, shape (k,)."""
        return await self._last("positions", joints)

    @operation
    async def get_ref_position(self, joints: Joints = None) -> Floats:
        """The last accepted direct position, rad, shape (k,)."""
        return await self._last("direct_positions", joints)

    @operation
    async def get_target_velocity(self, joints: Joints = None) -> Floats:
        """The last accepted velocity of VELOCITY and MIXED, rad/s, shape (k,)."""
        return await self._last("velocities", joints)

    @operation
    async def get_direct_velocity(self, joints: Joints = None) -> Floats:
        """The last accepted velocity of VELOCITY_DIRECT, rad/s, shape (k,)."""
        return await self._last("direct_velocities", joints)

    @operation
    async def get_ref_velocity(self, joints: Joints = None) -> Floats:
        """The last accepted velocity, rad/s, shape (k,): in VELOCITY_DIRECT that of this mode."""
        response = await self._services.read(GET_REFERENCES, joints)
        velocities = np.array(response.velocities, dtype=np.float64)
        direct = np.array(response.direct_velocities, dtype=np.float64)
        if (velocities == direct).all():
            return velocities
        modes = (await self._services.read(GET_CONTROL_MODE, joints)).vocabs
        return np.where(np.isin(modes, list(DIRECT_VELOCITY)), direct, velocities)

    @operation
    async def get_ref_torque(self, joints: Joints = None) -> Floats:
        """The last accepted torque, N·m, shape (k,)."""
        return await self._last("torques", joints)

    @operation
    async def get_ref_current(self, joints: Joints = None) -> Floats:
        """The last accepted motor current, A, shape (k,)."""
        return await self._last("currents", joints)

    @operation
    async def get_output(self, joints: Joints = None) -> Floats:
        """The last accepted output, PWM percent, shape (k,)."""
        return await self._last("outputs", joints)

    @operation
    async def get_ref_speed(self, joints: Joints = None) -> Floats:
        """Mean speeds of position moves, rad/s, shape (k,)."""
        return await self._last("speeds", joints)

    @operation
    async def get_ref_acceleration(self, joints: Joints = None) -> Floats:
        """Accelerations of velocity references, rad/s², shape (k,)."""
        return await self._last("accelerations", joints)

    @operation
    async def set_traj_speed(self, joints: Joints, speeds: Values) -> Reply:
        """YARP 4's name of ``set_ref_speed``."""
        return await self.set_ref_speed(joints, speeds)

    @operation
    async def get_traj_speed(self, joints: Joints = None) -> Floats:
        """YARP 4's name of ``get_ref_speed``."""
        return await self.get_ref_speed(joints)

    @operation
    async def set_traj_acceleration(self, joints: Joints, accelerations: Values) -> Reply:
        """YARP 4's name of ``set_ref_acceleration``."""
        return await self.set_ref_acceleration(joints, accelerations)

    @operation
    async def get_traj_acceleration(self, joints: Joints = None) -> Floats:
        """YARP 4's name of ``get_ref_acceleration``."""
        return await self.get_ref_acceleration(joints)

    async def _last(self, field: str, joints: Joints) -> Floats:
        response = await self._services.read(GET_REFERENCES, joints)
        return np.array(getattr(response, field), dtype=np.float64)

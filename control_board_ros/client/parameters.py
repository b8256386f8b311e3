# SPDX-License-Identifier: Apache-2.0
"""The limits in force, and the board's parameters: reading and setting them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from control_board_ros.core.selection import RequestError, spread
from control_board_ros.core.terms.reply import Reply, refused
from control_board_ros.interface import GET_LIMITS
from control_board_ros.joint_limits import FIELDS, JointLimits
from control_board_ros.protocols import Floats, Joints, Values
from control_board_ros.text import nearest, unknown_word

from .operations import Interface, operation, request
from .services import whole

#: Fields of each controller with gains.
CONTROLLERS = ("position", "direct", "torque", "current")


@dataclass(frozen=True, slots=True, eq=False)
class Gains:
    """The gains of a PID, an array of shape (k,) each.

    Attributes: kp, ki, kd, kff, integral_limit, derivative_cutoff, in the units of the parameters
    of the same names.
    """

    kp: Floats
    ki: Floats
    kd: Floats
    kff: Floats
    integral_limit: Floats
    derivative_cutoff: Floats


GAINS = tuple(field.name for field in fields(Gains))


class ParameterRequests(Interface):
    """The standard parameter services of the board's node."""

    @operation
    async def list_parameters(self, prefix: str = "") -> list[str]:
        """Names of the board's parameters with this prefix."""
        await self._services.find()
        names = await self._link.list_parameters()
        return sorted(name for name in names if name.startswith(prefix))

    @operation
    async def get_parameters(self, names: Sequence[str]) -> dict[str, Any]:
        """Values of parameters by name; None where unset.

        Raises:
            RequestError: the board has no parameter of a name.
        """
        await self._services.find()
        values = await self._link.get_parameters(names)
        if values is None:
            raise RequestError(await self._unknown_parameters(names))
        return dict(zip(names, values, strict=True))

    @request
    async def set_parameters(self, values: Mapping[str, Any]) -> Reply:
        """Set parameters, all or none; checked together by the board."""
        if not values:
            return refused("no parameters given; send one or more")
        present = await self.get_parameters(list(values))
        success, reason = await self._link.set_parameters(values, present)
        self._services.states.changed()
        return whole(success, reason, tuple(values))

    @operation
    async def get_joint_limits(self, joints: Joints = None) -> list[JointLimits]:
        """All limits in force of each joint: the smaller ones of board and drive (S4).

        The parameters ``<joint>.limits.*`` keep the board's own.
        """
        response = await self._services.read(GET_LIMITS, joints)
        columns = [getattr(response, field) for field in FIELDS]
        return [JointLimits(*row) for row in zip(*columns, strict=True)]

    @operation
    async def get_limits(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """The software limits in force, lower and upper, rad, two arrays of shape (k,)."""
        response = await self._services.read(GET_LIMITS, joints)
        return np.array(response.lower), np.array(response.upper)

    @operation
    async def get_velocity_limits(self, joints: Joints = None) -> Floats:
        """The speed limits in force, rad/s, shape (k,)."""
        return np.array((await self._services.read(GET_LIMITS, joints)).velocity)

    @operation
    async def get_current_range(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """The least and the greatest current reference, A, two arrays of shape (k,) (Y2)."""
        peak = np.array((await self._services.read(GET_LIMITS, joints)).peak_current)
        return -peak, peak

    @request
    async def set_pos_limits(self, joints: Joints, lower: Values, upper: Values) -> Reply:
        """Set the software limits, rad, one for all joints or one each; checked together.

        Narrower ones of a drive stay in force (S4).
        """
        names = (await self._services.select(joints)).names
        limits = {
            f"{name}.limits.{side}": value
            for side, values in (("lower", lower), ("upper", upper))
            for name, value in zip(
                names, spread(values, len(names), side, one_for_all=True).tolist(), strict=True
            )
        }
        return await self.set_parameters(limits)

    get_pos_limits = get_limits.synonym("get_limits")
    get_vel_limits = get_velocity_limits.synonym("get_velocity_limits")

    @operation
    async def get_gains(self, joints: Joints = None, controller: str = "position") -> Gains:
        """The gains in force of a controller: ``position``, ``direct``, ``torque``, ``current``.

        Raises:
            RequestError: a joint or controller that does not exist.
        """
        if controller not in CONTROLLERS:
            raise RequestError(unknown_word("controller", controller, CONTROLLERS))
        return Gains(*await self._of_joints([f"{controller}_pid.{g}" for g in GAINS], joints))

    async def _of_joints(self, fields: Sequence[str], joints: Joints) -> list[Floats]:
        """Parameters of each joint in one request; an array of shape (k,) per field."""
        names = (await self._services.select(joints)).names
        keys = [f"{name}.{field}" for field in fields for name in names]
        values = await self.get_parameters(keys)
        columns = np.array(list(values.values()), dtype=np.float64)
        return list(columns.reshape(len(fields), len(names)))

    async def _unknown_parameters(self, names: Sequence[str]) -> str:
        """Parameters unknown to the board, with suggestions."""
        known = await self.list_parameters()
        unknown = [name for name in names if name not in known]
        hint = nearest(unknown[0], known) if unknown else ""
        return f"no parameter {', '.join(map(repr, unknown))}{hint}"

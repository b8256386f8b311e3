# SPDX-License-Identifier: Apache-2.0
"""The board's parameters: limits and gains as they are in force, and setting them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import Any

import numpy as np
from rcl_interfaces.msg import Parameter
from rclpy.parameter import Parameter as TypedParameter
from rclpy.parameter import parameter_value_to_python

from control_board_ros.core.parts import Pid
from control_board_ros.core.reply import Reply, refused
from control_board_ros.core.selection import RequestError
from control_board_ros.interface import service
from control_board_ros.protocols import Floats, Joints

from .services import Services, whole
from .waiting import Steps

# Standard services, which every node has.
LIST_PARAMETERS = service("~/list_parameters", "rcl_interfaces/srv/ListParameters", "Names.")
GET_PARAMETERS = service("~/get_parameters", "rcl_interfaces/srv/GetParameters", "Values.")
SET_PARAMETERS = service(
    "~/set_parameters_atomically",
    "rcl_interfaces/srv/SetParametersAtomically",
    "All of them, or none.",
)
#: The controllers that have gains, and the fields of each.
CONTROLLERS = ("position", "direct", "torque", "current")
GAINS = tuple(field.name for field in fields(Pid))


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


class ParameterRequests:
    """The standard parameter services of the board's node."""

    def __init__(self, services: Services) -> None:
        self._services, self._link = services, services.link

    def list_parameters(self, prefix: str = "") -> Steps[list[str]]:
        """Names of the board's parameters that begin with this."""
        yield from self._services.find()
        response = yield from self._link.call(LIST_PARAMETERS)
        return sorted(name for name in response.result.names if name.startswith(prefix))

    def get_parameters(self, names: Sequence[str]) -> Steps[dict[str, Any]]:
        """Values of parameters by name; None for one that is not set.

        Raises:
            RequestError: the board has no parameter of a name.
        """
        yield from self._services.find()
        response = yield from self._link.call(GET_PARAMETERS, names=list(names))
        if len(response.values) != len(names):
            raise RequestError((yield from self._unknown_parameters(names)))
        values = zip(names, response.values, strict=True)
        return {name: parameter_value_to_python(value) for name, value in values}

    def set_parameters(self, values: Mapping[str, Any]) -> Steps[Reply]:
        """Set parameters, all or none; the board checks them together."""
        try:
            present = yield from self.get_parameters(list(values))
        except RequestError as error:
            return refused(str(error))
        parameters = [
            Parameter(name=name, value=typed(value, present[name]))
            for name, value in values.items()
        ]
        response = yield from self._link.call(SET_PARAMETERS, parameters=parameters)
        self._services.states.changed()
        return whole(response.result.successful, response.result.reason, tuple(values))

    def get_limits(self, joints: Joints = None) -> Steps[tuple[Floats, Floats]]:
        """The software limits in force, lower and upper, rad, two arrays of shape (k,)."""
        lower, upper = yield from self.of_joints(("limits.lower", "limits.upper"), joints)
        return lower, upper

    def get_velocity_limits(self, joints: Joints = None) -> Steps[Floats]:
        """The speed limits in force, rad/s, shape (k,)."""
        (limits,) = yield from self.of_joints(("limits.velocity",), joints)
        return limits

    def get_gains(self, joints: Joints = None, controller: str = "position") -> Steps[Gains]:
        """The gains in force of a controller: ``position``, ``direct``, ``torque``, ``current``.

        Raises:
            RequestError: a joint or controller that does not exist.
        """
        if controller not in CONTROLLERS:
            raise RequestError(
                f"controller {controller!r} unknown; one of {', '.join(CONTROLLERS)}"
            )
        return Gains(
            *(yield from self.of_joints([f"{controller}_pid.{g}" for g in GAINS], joints))
        )

    def of_joints(self, fields: Sequence[str], joints: Joints) -> Steps[list[Floats]]:
        """Parameters of each joint, asked for at once; an array of shape (k,) per field."""
        names = (yield from self._services.select(joints)).names
        asked = [f"{name}.{field}" for field in fields for name in names]
        values = yield from self.get_parameters(asked)
        columns = np.array(list(values.values()), dtype=np.float64)
        return list(columns.reshape(len(fields), len(names)))

    def _unknown_parameters(self, names: Sequence[str]) -> Steps[str]:
        """Which parameters the board does not have, and what may have been meant."""
        known = yield from self.list_parameters()
        unknown = [name for name in names if name not in known]
        near = get_close_matches(unknown[0][:128], known, n=1) if unknown else []
        hint = f"; did you mean {near[0]!r}?" if near else ""
        return f"no parameter {', '.join(map(repr, unknown))}{hint}"


def typed(value: Any, present: Any) -> Any:
    """A ParameterValue; a whole number becomes a double where the parameter is one."""
    plain = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    if isinstance(present, float) and isinstance(plain, int) and not isinstance(plain, bool):
        plain = float(plain)
    return TypedParameter("value", value=plain).get_parameter_value()

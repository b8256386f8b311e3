# SPDX-License-Identifier: Apache-2.0
"""The board's parameters: limits and gains as they are in force, and setting them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import GetParameters, ListParameters, SetParametersAtomically
from rclpy.parameter import Parameter as TypedParameter
from rclpy.parameter import parameter_value_to_python

from control_board_ros.core.reply import Answer, Reply, refused
from control_board_ros.core.selection import RequestError
from control_board_ros.interfaces import Floats, Joints

from .goals import GoalOperations
from .waiting import Steps, operation

#: The controllers that have gains, and the fields of each.
CONTROLLERS = ("position", "direct", "torque", "current")
GAINS = ("kp", "ki", "kd", "kff", "integral_limit", "derivative_cutoff")


@dataclass(frozen=True, slots=True, eq=False)
class Gains:
    """The gains of a PID, an array each, one entry per joint.

    Attributes: kp, ki, kd, kff, integral_limit, derivative_cutoff, in the units of the parameters
    of the same names.
    """

    kp: Floats
    ki: Floats
    kd: Floats
    kff: Floats
    integral_limit: Floats
    derivative_cutoff: Floats


class ParameterOperations(GoalOperations):
    """The standard parameter services of the board's node."""

    @operation
    def list_parameters(self, prefix: str = "") -> Steps[list[str]]:
        """Names of the board's parameters that begin with this."""
        yield from self._find()
        response = yield from self._link.call(
            ListParameters, "list_parameters", ListParameters.Request()
        )
        return sorted(name for name in response.result.names if name.startswith(prefix))

    @operation
    def get_parameters(self, names: Sequence[str]) -> Steps[dict[str, Any]]:
        """Values of parameters by name; None for one that is not set.

        Raises:
            RequestError: the board has no parameter of a name.
        """
        values = yield from self._parameters(names)
        return values

    @operation
    def set_parameters(self, values: Mapping[str, Any]) -> Steps[Reply]:
        """Set parameters, all or none; the board checks them together."""
        try:
            present = yield from self._parameters(list(values))
        except RequestError as error:
            return refused(str(error))
        parameters = [
            Parameter(name=name, value=typed(value, present[name]))
            for name, value in values.items()
        ]
        response = yield from self._link.call(
            SetParametersAtomically,
            "set_parameters_atomically",
            SetParametersAtomically.Request(parameters=parameters),
        )
        self._changed()
        names = tuple(values)
        if not response.result.successful:
            return refused(response.result.reason, names)
        return Reply(names, (Answer.ACCEPTED,) * len(names), response.result.reason)

    @operation
    def get_limits(self, joints: Joints = None) -> Steps[tuple[Floats, Floats]]:
        """The software limits in force, lower and upper: rad, m where a joint slides."""
        lower = yield from self._of_joints("limits.lower", joints)
        upper = yield from self._of_joints("limits.upper", joints)
        return lower, upper

    @operation
    def get_velocity_limits(self, joints: Joints = None) -> Steps[Floats]:
        """The speed limits in force, rad/s."""
        limits = yield from self._of_joints("limits.velocity", joints)
        return limits

    @operation
    def get_gains(self, joints: Joints = None, controller: str = "position") -> Steps[Gains]:
        """The gains in force of a controller: ``position``, ``direct``, ``torque``, ``current``.

        Raises:
            RequestError: a joint or controller that does not exist.
        """
        if controller not in CONTROLLERS:
            raise RequestError(
                f"controller {controller!r} unknown; one of {', '.join(CONTROLLERS)}"
            )
        columns = []
        for gain in GAINS:
            column = yield from self._of_joints(f"{controller}_pid.{gain}", joints)
            columns.append(column)
        return Gains(*columns)

    def _of_joints(self, field: str, joints: Joints) -> Steps[Floats]:
        """A parameter of each joint, shape (n,)."""
        selection = yield from self._select(joints)
        values = yield from self._parameters([f"{name}.{field}" for name in selection.names])
        return np.array(list(values.values()), dtype=np.float64)

    def _parameters(self, names: Sequence[str]) -> Steps[dict[str, Any]]:
        yield from self._find()
        response = yield from self._link.call(
            GetParameters, "get_parameters", GetParameters.Request(names=list(names))
        )
        if len(response.values) != len(names):
            raise RequestError((yield from self._unknown_parameters(names)))
        values = zip(names, response.values, strict=True)
        return {name: parameter_value_to_python(value) for name, value in values}

    def _unknown_parameters(self, names: Sequence[str]) -> Steps[str]:
        """Which parameters the board does not have, and what may have been meant."""
        response = yield from self._link.call(
            ListParameters, "list_parameters", ListParameters.Request()
        )
        known = response.result.names
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

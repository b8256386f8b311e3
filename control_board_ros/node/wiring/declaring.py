# SPDX-License-Identifier: Apache-2.0
"""Declaring many parameters in little time.

rclpy publishes an event for each parameter that is declared, before discovery of the
publisher: a robot of 32 joints has 3800, which is most of its start. Here they go into the node
at once; the values have been checked when the settings were made.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from ...core.config.parameter import Kind, Parameter

_TYPES = {
    Kind.BOOL: RosParameter.Type.BOOL,
    Kind.INTEGER: RosParameter.Type.INTEGER,
    Kind.DOUBLE: RosParameter.Type.DOUBLE,
    Kind.STRING: RosParameter.Type.STRING,
    Kind.DOUBLES: RosParameter.Type.DOUBLE_ARRAY,
    Kind.STRINGS: RosParameter.Type.STRING_ARRAY,
}


class Declaration(NamedTuple):
    """A parameter to declare: its full name, value and row, and whether it is read-only."""

    name: str
    value: Any
    row: Parameter
    fixed: bool


def type_of(row: Parameter, value: Any) -> Any:
    """The type of a parameter's value; a flag that may be more is a text then."""
    return RosParameter.Type.STRING if isinstance(value, str) else _TYPES[row.kind]


def descriptor(row: Parameter, *, fixed: bool) -> ParameterDescriptor:
    """What ``ros2 param describe`` shows of a parameter."""
    made = ParameterDescriptor(
        type=_TYPES[row.kind].value, description=row.description, read_only=fixed
    )
    if row.choices:
        made.additional_constraints = f"one of: {', '.join(row.choices)}"
    low, high = row.bounds
    if row.kind is Kind.DOUBLE:
        made.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
        if (
            row.or_zero
            or row.above is not None
            or isinstance(row.low, str)
            or isinstance(row.high, str)
        ):
            made.additional_constraints = row.range_text
    elif row.kind is Kind.INTEGER:
        made.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    return made


def declare(node: Node, declarations: Sequence[Declaration]) -> None:
    """Declare parameters as ``node.declare_parameters`` does, but for the events.

    With an rclpy that keeps them elsewhere, that is what declares them.
    """
    described = described_by(declarations)
    parameters, descriptors = (
        getattr(node, name, None) for name in ("_parameters", "_descriptors")
    )
    if not isinstance(parameters, dict) or not isinstance(descriptors, dict):
        triples: list[Any] = [(one.name, one.value, described[one.name]) for one in declarations]
        node.declare_parameters("", triples, ignore_override=True)
        return
    for name, value, row, _ in declarations:
        parameters[name] = RosParameter(name, type_of(row, value), value)
    descriptors.update(described)


def described_by(declarations: Sequence[Declaration]) -> dict[str, ParameterDescriptor]:
    """A descriptor of its own for each parameter, by name."""
    shared: dict[tuple[int, bool], ParameterDescriptor] = {}
    found = {}
    for name, value, row, fixed in declarations:
        if (key := (id(row), fixed)) not in shared:
            shared[key] = descriptor(row, fixed=fixed)
        found[name] = own = copy(shared[key])
        own.name, own.type = name, type_of(row, value).value
    return found

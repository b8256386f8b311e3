# SPDX-License-Identifier: Apache-2.0
"""Declaring many parameters in little time.

rclpy publishes an event for each parameter that is declared, before anybody can have found the
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

from ..core.parameter import Kind, Parameter

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
        if row.above is not None or isinstance(row.low, str) or isinstance(row.high, str):
            made.additional_constraints = row.range_text
    elif row.kind is Kind.INTEGER:
        made.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    return made


def declare(node: Node, declarations: Sequence[Declaration]) -> None:
    """Declare parameters as ``node.declare_parameters`` does, but for the events.

    With an rclpy that keeps them elsewhere, it is ``node.declare_parameters`` that does it.
    """
    shared: dict[tuple[int, bool], ParameterDescriptor] = {}
    parameters, descriptors = stores_of(node)
    for name, value, row, fixed in declarations:
        if (key := (id(row), fixed)) not in shared:
            shared[key] = descriptor(row, fixed=fixed)
        own = copy(shared[key])  # one each: it holds the name
        if parameters is None or descriptors is None:
            node.declare_parameter(name, value, own, ignore_override=True)
            continue
        own.name = name
        parameters[name] = RosParameter(name, _TYPES[row.kind], value)
        descriptors[name] = own


def stores_of(node: Node) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    """Where rclpy keeps a node's parameters and their descriptors; None where it has no such."""
    stores = (getattr(node, "_parameters", None), getattr(node, "_descriptors", None))
    first, second = (one if isinstance(one, dict) else None for one in stores)
    return first, second

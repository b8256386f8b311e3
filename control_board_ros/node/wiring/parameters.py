# SPDX-License-Identifier: Apache-2.0
"""ROS parameters: declared from the settings, changed all or nothing.

rclpy publishes an event for each parameter that is declared, before discovery of the publisher:
a robot of 32 joints has 3800, which is most of its start. Here the parameters go into the node at
once; the values have been checked when the settings were made.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from typing import Any, NamedTuple

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from ...core.config.parameter import Kind, Parameter
from ...core.terms.measurement import NO_SIMULATION
from ...settings import stability
from ...settings.loading import Settings
from ...settings.schema import BOARD, JOINT, JOINT_DEFAULTS, table_row
from ...text import clean


class Parameters:
    """The parameters of the node: declared from the schema, changed all or nothing.

    Args:
        reconfigure: Receives the new, checked settings and the changes by name when gains, limits
            or timeouts change; raises ValueError to refuse them.
        changed: Called with the other run-time parameters (``state_rate``, ``real_time_factor``)
            by name and value.
        board_rows, joint_rows: Declared parameters of the board, and of each joint.

    Attributes: settings, reconfigure.
    """

    def __init__(
        self,
        node: Node,
        settings: Settings,
        reconfigure: Callable[[Settings, Mapping[str, Any]], None],
        changed: Callable[[str, Any], None],
        board_rows: Sequence[Parameter] = BOARD,
        joint_rows: Sequence[Parameter] = JOINT,
    ) -> None:
        self.settings = settings
        self.reconfigure, self._changed, self._node = reconfigure, changed, node
        declarations = self._declarations(board_rows, joint_rows)
        self._declared = {row.name for row in declarations}
        declare(node, declarations)
        node.add_on_set_parameters_callback(self._on_set)

    def show(self, settings: Settings, names: Iterable[str]) -> None:
        """Show settings that another node has applied, under these names."""
        self.settings = settings
        changed = [RosParameter(n, value=settings.values[n]) for n in names if n in self._declared]
        if changed:
            self._node.set_parameters(changed)

    def _declarations(
        self, board_rows: Sequence[Parameter], joint_rows: Sequence[Parameter]
    ) -> list[Declaration]:
        """Of all values that have one of these rows, and of couplings, poses and parts."""
        names = self.settings.board.names
        rows = {row.name: row for row in board_rows}
        for owner in (JOINT_DEFAULTS, *names):
            rows |= {f"{owner}.{row.name}": row for row in joint_rows}
        declarations = []
        for name, value in self.settings.values.items():
            if (row := rows.get(name) or table_row(name, names)) is not None:
                fixed = not row.run_time or name.startswith(f"{JOINT_DEFAULTS}.")
                declarations.append(Declaration(name, value, row, fixed))
        return declarations

    def _refusal(self, parameters: list[RosParameter]) -> str:
        """The reason to refuse a change beyond the rules of the settings; or an empty text."""
        control_rate = self.settings.board.control_rate
        for parameter in parameters:
            name, value = parameter.name, parameter.value
            if name == "use_sim_time" and value != self._node.get_parameter(name).value:
                return (
                    f"use_sim_time: {value} is not allowed now; the time base is chosen at the "
                    f"start, with -p use_sim_time:={str(value).lower()}"
                )
            if name == "real_time_factor" and value != 1.0 and self.settings.values["plant"]:
                return f"real_time_factor: {value} is not allowed; {NO_SIMULATION}"
            if name == "state_rate" and isinstance(value, float) and value > control_rate:
                return (
                    f"state_rate: {value:g} is not allowed; at most control_rate, "
                    f"{control_rate:g} Hz: one state per control cycle"
                )
        return ""

    def _on_set(self, parameters: list[RosParameter]) -> SetParametersResult:
        """Check a change as a whole, then apply it."""
        if refusal := self._refusal(parameters):
            return SetParametersResult(successful=False, reason=refusal)
        values = self.settings.values
        changes = {
            parameter.name: parameter.value
            for parameter in parameters
            if parameter.name in values and not same(parameter.value, values[parameter.name])
        }
        if not changes:
            return SetParametersResult(successful=True)
        try:
            settings = self.settings.changed(changes)
            if settings.board != self.settings.board:
                self.reconfigure(settings, changes)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self.settings = settings
        for name, value in changes.items():
            if "." not in name:
                self._changed(name, value)
        self._warn(changes)
        return SetParametersResult(successful=True)  # rclpy passes no reason of a success on

    def _warn(self, changes: Iterable[str]) -> None:
        """Warn of unstable gains of the changed joints, which are applied nevertheless."""
        joints = {name.partition(".")[0] for name in changes if "." in name}
        for name, text in stability.warnings(self.settings.board).items():
            if name.partition(".")[0] in joints:
                self._node.get_logger().warning(clean(text))


def same(value: Any, present: Any) -> bool:
    """Whether a parameter has this value already; arrays of ROS compare as lists."""
    listed = isinstance(present, list) and isinstance(value, Sequence | array)
    return bool(list(value) == present if listed else value == present)


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
    """The type of a parameter's value; STRING for a text, also where the row is a flag."""
    return RosParameter.Type.STRING if isinstance(value, str) else _TYPES[row.kind]


def descriptor(row: Parameter, *, fixed: bool) -> ParameterDescriptor:
    """The description of a parameter for ``ros2 param describe``."""
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
    """Declare parameters as ``node.declare_parameters`` does, without the events."""
    for name, value, row, _ in declarations:
        node._parameters[name] = RosParameter(name, type_of(row, value), value)
    node._descriptors.update(described_by(declarations))


def described_by(declarations: Sequence[Declaration]) -> dict[str, ParameterDescriptor]:
    """A descriptor of its own for each parameter, by name."""
    shared: dict[tuple[int, bool], ParameterDescriptor] = {}
    descriptors = {}
    for name, value, row, fixed in declarations:
        if (key := (id(row), fixed)) not in shared:
            shared[key] = descriptor(row, fixed=fixed)
        descriptors[name] = copied = copy(shared[key])
        copied.name, copied.type = name, type_of(row, value).value
    return descriptors

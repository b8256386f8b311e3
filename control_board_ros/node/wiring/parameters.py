# SPDX-License-Identifier: Apache-2.0
"""ROS parameters: from the command line to settings, and from settings to declarations.

The files and ``-p`` arguments are read here and not by rcl, which is silent about unknown
names and answers a broken file with a traceback; rclpy gets what is left of the arguments.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from ...core.config import stability
from ...core.config.parameter import Parameter
from ...core.terms.measurement import NO_SIMULATION
from ...settings.couplings import coupling_row
from ...settings.loading import Settings, load_layers
from ...settings.params_file import Entry, Layer, SettingsError, parse_value, read_file, shown
from ...settings.parts import PARTS, PARTS_ROW, ROBOT
from ...settings.poses import POSITION_ROW, SPEED, SPEED_ROW, values_of
from ...settings.schema import BOARD, JOINT, JOINT_DEFAULTS
from ...text import clean
from .declaring import Declaration, declare

NODE = "control_board"


@dataclass(frozen=True, slots=True)
class Start:
    """What the command line asks for.

    Attributes: settings, arguments (for ``rclpy.init``: the given ones without parameters),
    overrides (for ``Node(parameter_overrides=…)``: use_sim_time and qos_overrides), name and
    namespace of the node after remapping; of a robot of several parts, of the robot's own node.
    """

    settings: Settings
    arguments: list[str]
    overrides: list[RosParameter]
    name: str
    namespace: str

    @property
    def names(self) -> list[str]:
        """Names of all nodes: the parts', and last the whole robot's; or of the only one."""
        return [*self.settings.parts, self.name]


def settings_from_arguments(argv: Sequence[str], name: str = NODE) -> Start:
    """Read ``--ros-args --params-file FILE -p name:=value -r __node:=name`` and load it all.

    Args:
        argv: The arguments, without or with the program's name in front.
        name: The node's name before remapping.

    Raises:
        SettingsError: one line: where, name, value, what is allowed, the next step.
    """
    given, rest = _split(argv)
    remapped, namespace = name, "/"
    for option, value in given:
        if option == "remap":
            target, mark, new = value.partition(":=")
            owner, _, what = target.rpartition(":")
            if mark and owner in ("", name) and what in ("__node", "__name"):
                remapped = new
            elif mark and owner in ("", name) and what == "__ns":
                namespace = "/" + new.strip("/")
    full = f"{namespace.rstrip('/')}/{remapped}"
    layers = []
    for option, value in given:
        if option == "params-file":
            layers.append(_read(Path(value), full, f"{namespace.rstrip('/')}/{name}"))
        elif option == "param":
            layers.append(_argument(value, remapped, name))
    settings = load_layers(layers)
    overrides = [RosParameter(key, value=value) for key, value in settings.ros.items()]
    if settings.parts:  # a global rule would give all their nodes one name
        rest = without_names(rest)
        if remapped not in (name, ROBOT):
            warning = (
                f"-r __node:={remapped}: is not used; the nodes of a robot of several parts have "
                "the names of its parts, and robot_name is what they begin with"
            )
            settings = replace(settings, warnings=(*settings.warnings, warning))
        remapped = ROBOT
        if namespace.rpartition("/")[2] != settings.robot_name:
            namespace = f"{namespace.rstrip('/')}/{settings.robot_name}"
    return Start(settings, rest, overrides, remapped, namespace)


def without_names(arguments: Sequence[str]) -> list[str]:
    """Arguments without the rules that rename nodes."""
    rest: list[str] = []
    for argument in arguments:
        what = argument.partition(":=")[0].rpartition(":")[2]
        if rest and rest[-1] in ("-r", "--remap") and what in ("__node", "__name", "__ns"):
            rest.pop()
        else:
            rest.append(argument)
    return rest


def _split(argv: Sequence[str]) -> tuple[list[tuple[str, str]], list[str]]:
    """The ROS options that matter here, in order, and all arguments without parameters."""
    names = {"-p": "param", "--param": "param", "--params-file": "params-file"}
    names |= {"-r": "remap", "--remap": "remap"}
    given: list[tuple[str, str]] = []
    rest: list[str] = []
    inside = False
    arguments = iter(argv)
    for argument in arguments:
        if argument == "--ros-args":
            inside = True
        elif argument == "--":
            inside = False
        option = names.get(argument) if inside else None
        if option is None:
            rest.append(argument)
            continue
        value = next(arguments, None)
        if value is None:
            raise SettingsError(f"{argument}: has no value; see control_board --help")
        given.append((option, value))
        if option == "remap":
            rest += [argument, value]
    return given, rest


def _read(path: Path, full: str, before: str) -> Layer:
    """A parameter file's layer; sections may name the node as it is or before remapping."""
    try:
        return read_file(path, full)
    except SettingsError:
        if full == before:
            raise
    return read_file(path, before)


def _argument(text: str, *names: str) -> Layer:
    """The layer of one ``-p [node:]name:=value``."""
    target, mark, value = text.partition(":=")
    owner, _, name = target.rpartition(":")
    if not mark or not name:
        raise SettingsError(f"-p {shown(text)}: write -p name:=value")
    if owner.rsplit("/", 1)[-1] not in ("", *names):
        return Layer()
    where = f"-p {name}"
    parsed = parse_value(value, where)
    if parsed is None:
        raise SettingsError(f"{where}: has no value; write -p {name}:=value")
    return Layer({name: Entry(parsed, "-p")}, folder=Path.cwd())


class Parameters:
    """The parameters of the node: declared from the schema, changed all or nothing.

    Args:
        node: Where to declare them.
        settings: The values at start.
        reconfigure: Given the new, checked settings and the changes by name when gains, limits or
            timeouts change; raises ValueError to refuse them.
        changed: Called with the other run-time parameters (``state_rate``, ``real_time_factor``)
            by name and value.
        board_rows: Those of the board that are declared.
        joint_rows: Those of each joint.

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
        self._declared = {one.name for one in declarations}
        declare(node, declarations)
        node.add_on_set_parameters_callback(self._on_set)

    def show(self, settings: Settings, names: Iterable[str]) -> None:
        """Show settings that another node has changed, under these names; they act already."""
        self.settings = settings
        changed = [RosParameter(n, value=settings.values[n]) for n in names if n in self._declared]
        if changed:
            self._node.set_parameters(changed)

    def _declarations(
        self, board_rows: Sequence[Parameter], joint_rows: Sequence[Parameter]
    ) -> list[Declaration]:
        values = self.settings.values
        found = [Declaration(r.name, values[r.name], r, not r.run_time) for r in board_rows]
        for row in joint_rows:
            for joint in self.settings.board.names:
                name = f"{joint}.{row.name}"
                found.append(Declaration(name, values[name], row, not row.run_time))
            name = f"{JOINT_DEFAULTS}.{row.name}"
            if name in values:
                found.append(Declaration(name, values[name], row, True))
        for name, value in values.items():  # also of parts that are left out
            if name.startswith(f"{PARTS}."):
                found.append(Declaration(name, value, PARTS_ROW, True))
            elif (own := coupling_row(name)) is not None:
                found.append(Declaration(name, value, own, True))
        for name, value in values_of(self.settings.poses).items():
            row = SPEED_ROW if name.endswith(f".{SPEED}") else POSITION_ROW
            found.append(Declaration(name, value, row, True))
        return found

    def _refusal(self, parameters: list[RosParameter]) -> str:
        """Reason to refuse a change that is unknown to the settings."""
        control_rate = self.settings.board.control_rate
        for one in parameters:
            name, value = one.name, one.value
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
        """Check a change as a whole, then let it act."""
        if refusal := self._refusal(parameters):
            return SetParametersResult(successful=False, reason=refusal)
        values = self.settings.values
        changes = {
            one.name: one.value
            for one in parameters
            if one.name in values and not same(one.value, values[one.name])
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
        """Warn of unstable gains of the changed joints; they act all the same."""
        joints = {name.partition(".")[0] for name in changes if "." in name}
        for name, text in stability.warnings(self.settings.board).items():
            if name.partition(".")[0] in joints:
                self._node.get_logger().warning(clean(text))


def same(one: Any, other: Any) -> bool:
    """Whether a parameter has this value already; arrays of ROS compare as lists."""
    listed = isinstance(other, list) and isinstance(one, Sequence | array)
    return bool(list(one) == other if listed else one == other)

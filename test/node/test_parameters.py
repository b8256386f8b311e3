# SPDX-License-Identifier: Apache-2.0
"""ROS parameters: the command line, the declarations, and changes at run time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rclpy.parameter import Parameter

from control_board_ros.core.config.config import BoardConfig
from control_board_ros.node.process.start import settings_from_arguments
from control_board_ros.node.wiring.parameters import (
    Declaration,
    Parameters,
    declare,
    described_by,
)
from control_board_ros.settings.loading import Settings, SettingsError, load
from control_board_ros.settings.schema import BOARD, JOINT
from control_board_ros.testing import free_domain, ros_node

pytestmark = pytest.mark.ros
J2 = "lbr_iiwa_joint_2"


class Board:
    """What the parameters are to change."""

    def __init__(self, settings: Settings) -> None:
        self.config = settings.board
        self.changes: list[tuple[str, Any]] = []
        self.refuses = ""

    def reconfigure(self, config: BoardConfig) -> None:
        if self.refuses:
            raise ValueError(self.refuses)
        self.config = config

    def changed(self, name: str, value: Any) -> None:
        self.changes.append((name, value))


@pytest.fixture(scope="module")
def node() -> Iterator[Any]:
    with free_domain() as domain, ros_node(domain, spin=False) as made:
        settings = load()
        made.board = Board(settings)
        made.declared = Parameters(
            made,
            settings,
            lambda new, _: made.board.reconfigure(new.board),
            made.board.changed,
        )
        yield made


def arguments(*words: str) -> list[str]:
    return ["--ros-args", *words]


# The command line ---------------------------------------------------------------------------


def test_no_arguments_mean_the_iiwa() -> None:
    start = settings_from_arguments([])
    assert start.settings.values["robot"] == "iiwa"
    assert (start.name, start.namespace, start.arguments) == ("control_board", "/", [])


def test_a_robot_by_argument_brings_its_own_configuration() -> None:
    """Its shipped gains, not those derived from the URDF."""
    start = settings_from_arguments(arguments("-p", "robot:=panda"))
    assert start.settings.board == load("panda").board


def test_values_are_typed_and_layers_in_order(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("control_board: {ros__parameters: {state_rate: 20, control_rate: 500}}")
    words = ("-p", "state_rate:=10", "--params-file", str(path), "-p", "control_rate:=250")
    values = settings_from_arguments(arguments(*words)).settings.values
    assert (values["state_rate"], values["control_rate"]) == (20.0, 250.0)
    words = ("--param", "autoconfigure:=false", "-p", f"joints:=[{J2}]", "-p", "output:=current")
    values = settings_from_arguments(arguments(*words)).settings.values
    assert (values["autoconfigure"], values["joints"], values["output"]) == (
        False,
        [J2],
        "current",
    )


def test_rclpy_gets_the_rest_of_the_arguments(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("/**: {ros__parameters: {use_sim_time: true, qos_overrides.x.depth: 3}}")
    words = ["-r", "__ns:=/left", "-p", "gui:=false", "--log-level", "debug"]
    words += ["--params-file", str(path), "--", "other"]
    start = settings_from_arguments(["name", *arguments(*words)])
    assert start.arguments == [
        "name", "--ros-args", "-r", "__ns:=/left", "--log-level", "debug", "--", "other",
    ]  # fmt: skip
    assert {(one.name, one.value) for one in start.overrides} == {
        ("use_sim_time", True),
        ("qos_overrides.x.depth", 3),
    }


@pytest.mark.parametrize(
    "section", ["left/arm", "/left/arm", "/left/*", "arm", "control_board", "/left/control_board"]
)
def test_a_renamed_node_finds_its_section(section: str, tmp_path: Path) -> None:
    """By its new name, else by the one before remapping."""
    path = tmp_path / "p.yaml"
    path.write_text(f"{section}: {{ros__parameters: {{state_rate: 20}}}}")
    words = ("-r", "__node:=arm", "-r", "__ns:=/left", "--params-file", str(path))
    start = settings_from_arguments(arguments(*words))
    assert start.settings.values["state_rate"] == 20.0
    assert (start.name, start.namespace) == ("arm", "/left")


def test_arguments_of_other_nodes_are_theirs() -> None:
    words = ("-p", "other:anything:=1", "-p", "control_board:state_rate:=20", "-r", "o:__node:=x")
    start = settings_from_arguments(arguments(*words))
    assert start.settings.values["state_rate"] == 20.0
    assert start.name == "control_board"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["-p", "state_rat:=1"], "-p: 'state_rat': no such parameter; did you mean 'state_rate'?"),
        (["-p", "state_rate:=fast"], "-p: state_rate: 'fast' is not allowed"),
        (["-p", "state_rate"], "write -p name:=value"),
        (["-p", "state_rate:="], "is not one value"),
        (["-p", "state_rate:=~"], "has no value"),
        (["-p", "state_rate:={a: 1}"], "is not one value"),
        (["-p", "state_rate:=[1"], "not YAML"),
        (["-p"], "-p: has no value"),
        (["-r", "__ns:=left"], "namespace 'left' is not allowed; write -r __ns:=/left"),
        (["--params-file", "/nowhere/x.yaml"], "no such file"),
        (["--params-file", "/"], "folder"),
        (["-p", "robot:=nobody"], "unknown"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(words: list[str], expected: str) -> None:
    with pytest.raises(SettingsError) as caught:
        settings_from_arguments(arguments(*words))
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_words_outside_ros_args_are_not_ours() -> None:
    words = ["-p", "state_rate:=1", "--ros-args", "--", "-p", "state_rate:=2"]
    start = settings_from_arguments(words)
    assert start.settings.values["state_rate"] == 100.0
    assert start.arguments == words


# Declarations -------------------------------------------------------------------------------


def test_every_parameter_is_declared_with_type_range_and_description(node: Any) -> None:
    values = node.declared.settings.values
    for name, value in values.items():
        assert node.get_parameter(name).value == value, name
        described = node.describe_parameter(name)
        assert described.name == name
        assert described.description.endswith("."), name
        assert described.type != 0, name
        if isinstance(value, float):
            assert len(described.floating_point_range) == 1, name


def test_fixed_parameters_are_read_only(node: Any) -> None:
    fixed = ("robot", "control_rate", f"{J2}.motor.resistance", f"{J2}.impedance.stiffness")
    live = ("state_rate", f"{J2}.position_pid.kp", f"{J2}.limits.lower", f"{J2}.timeouts.torque")
    assert all(node.describe_parameter(name).read_only for name in fixed)
    assert not any(node.describe_parameter(name).read_only for name in live)
    assert "pwm, current" in node.describe_parameter("output").additional_constraints


def declare_by_rclpy(node: Any, declarations: list[Declaration]) -> None:
    described = described_by(declarations)
    triples = [(row.name, row.value, described[row.name]) for row in declarations]
    node.declare_parameters("", triples, ignore_override=True)


def test_they_are_declared_as_rclpy_does_it(node: Any) -> None:
    """More than 600 parameters, each of which would cost rclpy 80 µs and an event (B10)."""
    row = next(row for row in JOINT if row.name == "position_pid.kp")
    declarations = [Declaration(f"new.{k}", float(k), row, bool(k % 2)) for k in range(4)]
    declarations += [
        Declaration(f"new.{row.name}", node.get_parameter(row.name).value, row, True)
        for row in BOARD
        if node.get_parameter(row.name).value != []  # of an empty list rclpy guesses the type
    ]
    found = []
    for way in (declare, declare_by_rclpy):
        way(node, declarations)
        names = [one.name for one in declarations]
        shown = [(node.get_parameter(name), node.describe_parameter(name)) for name in names]
        found.append([(one.type_, one.value, described) for one, described in shown])
        for name in names:
            del node._parameters[name]  # rclpy removes none that is read-only
            del node._descriptors[name]
    assert found[0] == found[1]
    assert len({described.name for _, _, described in found[0]}) == len(declarations)
    assert len(node.declared.settings.values) > 600


# Changes ------------------------------------------------------------------------------------


def change(node: Any, **values: Any) -> Any:
    """Set parameters at once; double underscores replace dots."""
    given = [Parameter(name.replace("__", "."), value=value) for name, value in values.items()]
    return node.set_parameters_atomically(given)


def test_gains_limits_and_timeouts_change_the_board(node: Any) -> None:
    result = change(
        node,
        lbr_iiwa_joint_2__position_pid__kp=5000.0,
        lbr_iiwa_joint_2__limits__lower=-1.0,
        lbr_iiwa_joint_2__limits__upper=1.0,
        lbr_iiwa_joint_3__timeouts__velocity=0.5,
    )
    assert result.successful, result.reason
    second, third = node.board.config.joints[1:3]
    assert (second.position_pid.kp, second.limits.lower, second.limits.upper) == (5000, -1, 1)
    assert third.timeouts.velocity == 0.5
    assert node.board.config.joints[0] == load().board.joints[0]


def test_a_gain_that_no_loop_bears_acts_and_is_warned_of(
    node: Any, capfd: pytest.CaptureFixture[str]
) -> None:
    """The log names the parameter and what would be right; of what is good it says nothing."""
    good = load().values
    for name, value, expected in (
        ("position_pid.kd", 1e12, "position_pid.kd: 1e+12 makes the loop unstable"),
        ("direct_pid.derivative_cutoff", 1e-12, "1e-12 Hz leaves no rate"),
        ("position_pid.kp", 5000.0, ""),
    ):
        for given in (value, good[f"lbr_iiwa_joint_4.{name}"]):
            one = Parameter(f"lbr_iiwa_joint_4.{name}", value=given)
            assert node.set_parameters_atomically([one]).successful
            err = capfd.readouterr().err
            assert (expected in err) if expected and given == value else not err


def test_the_time_base_is_chosen_at_the_start(node: Any) -> None:
    """One line: what is not allowed, and the next step."""
    result = change(node, use_sim_time=True)
    assert not result.successful
    assert "start, with -p use_sim_time:=true" in result.reason
    assert change(node, use_sim_time=False).successful


def test_rates_are_reported_and_do_not_affect_the_board(node: Any) -> None:
    before = node.board.config
    assert change(node, state_rate=50.0, real_time_factor=0.0).successful
    assert node.board.changes[-2:] == [("state_rate", 50.0), ("real_time_factor", 0.0)]
    assert node.board.config is before


@pytest.mark.parametrize(
    "values",
    [
        {"lbr_iiwa_joint_2__limits__upper": 9.0},
        {"lbr_iiwa_joint_2__position_pid__kp": float("nan")},
        {"lbr_iiwa_joint_2__position_pid__kp": "much"},
        {"lbr_iiwa_joint_2__motor__resistance": 2.0},
        {"real_time_factor": 0.0009},
    ],
)
def test_a_wrong_change_changes_nothing_else_either(values: dict[str, Any], node: Any) -> None:
    """All or nothing, with a reason."""
    config, count = node.board.config, len(node.board.changes)
    good = {"lbr_iiwa_joint_1__position_pid__kp": 1234.0, "state_rate": 33.0}
    result = change(node, **{**good, **values})
    assert not result.successful
    assert result.reason
    assert "\n" not in result.reason
    assert node.board.config is config
    assert len(node.board.changes) == count
    assert node.get_parameter("lbr_iiwa_joint_1.position_pid.kp").value != 1234.0
    assert node.get_parameter("state_rate").value != 33.0


def test_a_refusing_board_keeps_the_old_values(node: Any) -> None:
    node.board.refuses = "not now"
    try:
        result = change(node, lbr_iiwa_joint_1__position_pid__kp=1234.0)
    finally:
        node.board.refuses = ""
    assert (result.successful, result.reason) == (False, "not now")
    assert node.declared.settings.values["lbr_iiwa_joint_1.position_pid.kp"] != 1234.0


def test_parameters_cannot_be_removed(node: Any) -> None:
    result = node.set_parameters([Parameter(f"{J2}.position_pid.kp", Parameter.Type.NOT_SET)])[0]
    assert not result.successful
    assert node.has_parameter(f"{J2}.position_pid.kp")


# Robots of several parts ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("namespace", "found"),
    [("", "/pair"), ("/lab", "/lab/pair"), ("/pair", "/pair"), ("/lab/pair", "/lab/pair")],
)
def test_names_of_the_nodes_of_a_robot(namespace: str, found: str) -> None:
    """Below its name, in any namespace; no rule of the command line gives them one name."""
    words = ["-p", "robot_name:=pair", "-p", "parts.one:=[lbr_iiwa_joint_1]"]
    words += ["-r", f"__ns:={namespace}"] if namespace else []
    start = settings_from_arguments(arguments(*words, "-r", "__node:=x", "-r", "a:=b"))
    assert (start.namespace, start.names) == (found, ["one", "robot"])
    assert start.arguments == ["--ros-args", "-r", "a:=b"]
    assert "-r __node:=x: is not used" in start.settings.warnings[-1]

# SPDX-License-Identifier: Apache-2.0
"""The launch file: what it declares is there, and what it starts is what was requested.

The ROS wheels have no `launch`: a record of what the file asks of it replaces it. Where ROS 2 has
the real one, that reads the file, too.
"""

from __future__ import annotations

import importlib.util
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

from control_board_ros.description.robots import NAMES
from control_board_ros.description.urdf import parse
from control_board_ros.settings.layers import ROS_NAMES
from control_board_ros.settings.loading import SettingsError, load_layers
from control_board_ros.settings.params_file import read_file
from control_board_ros.settings.schema import BOARD_BY_NAME

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "launch" / "control_board.launch.py"


class Recorded(SimpleNamespace):
    """Anything of launch: it keeps what it is made of."""

    def __init__(self, *positional: Any, **named: Any) -> None:
        super().__init__(positional=positional, **named)


class Configuration:
    def __init__(self, name: str) -> None:
        self.name = name

    def perform(self, context: dict[str, str]) -> str:
        return context[self.name]


class Share(Configuration):
    def perform(self, context: dict[str, str]) -> str:
        assert self.name == "control_board_ros"
        return str(ROOT)


@pytest.fixture
def launch_file(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The file as a module, on the recorded launch."""
    names = {
        "launch": {"LaunchContext": dict, "LaunchDescription": Recorded},
        "launch.actions": {"DeclareLaunchArgument": Recorded, "OpaqueFunction": Recorded},
        "launch.substitutions": {"LaunchConfiguration": Configuration},
        "launch_ros": {},
        "launch_ros.actions": {"Node": Recorded},
        "launch_ros.parameter_descriptions": {"ParameterValue": Recorded},
        "launch_ros.substitutions": {"FindPackageShare": Share},
    }
    for name, content in names.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location("control_board_launch", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def started(launch_file: ModuleType, **given: str) -> list[Any]:
    """The nodes for some arguments; the others have their defaults."""
    (description,) = launch_file.generate_launch_description().positional
    *declared, opaque = description
    context = {one.positional[0]: one.default_value for one in declared}
    assert set(given) <= set(context)
    return list(opaque.function(context | given))


def settings_of(node: Any, folder: Path) -> Any:
    """What the board makes of a node's parameters, written as launch_ros writes them."""
    layers = []
    for number, one in enumerate(node.parameters):
        path = Path(one) if isinstance(one, str) else folder / f"{number}.yaml"
        if not isinstance(one, str):
            path.write_text(yaml.dump({"/**": {"ros__parameters": one}}))
        layers.append(read_file(path, "/control_board"))
    return load_layers(layers)


def test_every_argument_is_declared_with_a_text(launch_file: ModuleType) -> None:
    (description,) = launch_file.generate_launch_description().positional
    declared = {one.positional[0]: one.description for one in description[:-1]}
    assert set(declared) == set(launch_file.PARAMETERS) | set(launch_file.OPTIONS)
    assert all(declared.values())


def test_parameters_are_the_boards(launch_file: ModuleType) -> None:
    """A name that the board does not know would end it."""
    assert set(launch_file.PARAMETERS) <= set(BOARD_BY_NAME) | set(ROS_NAMES)


def test_by_default_a_board_and_nothing_else(launch_file: ModuleType, tmp_path: Path) -> None:
    """No name and no namespace are forced on it: a robot of parts has nodes of several names."""
    (node,) = started(launch_file)
    assert (node.package, node.executable) == ("control_board_ros", "control_board")
    assert (node.name, node.namespace, node.parameters) == (None, None, [{}])
    assert settings_of(node, tmp_path).values["robot"] == "iiwa"


def test_arguments_win_over_the_file_and_only_those_given(
    launch_file: ModuleType, tmp_path: Path
) -> None:
    file = tmp_path / "mine.yaml"
    own = {"robot": "panda", "state_rate": 50.0, "publish_tf": True}
    file.write_text(yaml.dump({"/**": {"ros__parameters": own}}))
    (node,) = started(
        launch_file,
        params_file=str(file),
        state_rate="20",
        use_sim_time="true",
        name="arm",
        namespace="left",
    )
    assert (node.name, node.namespace) == ("arm", "left")
    settings = settings_of(node, tmp_path)
    assert settings.values["robot"] == "panda"
    assert settings.values["state_rate"] == 20.0
    assert settings.values["publish_tf"] is True
    assert settings.ros["use_sim_time"] is True


def test_rviz_shows_the_robot_with_the_boards_frames(launch_file: ModuleType) -> None:
    board, rviz = started(launch_file, robot="panda", rviz="true", namespace="left")
    assert board.parameters == [{"robot": "panda", "publish_tf": True}]
    option, shown, fixed, frame = rviz.arguments
    assert (rviz.package, rviz.namespace, option, fixed, frame) == (
        "rviz2",
        "left",
        "-d",
        "-f",
        "panda_link0",
    )
    displays = yaml.safe_load(Path(shown).read_text())["Visualization Manager"]["Displays"]
    (robot,) = [one for one in displays if one["Class"].endswith("/RobotModel")]
    assert robot["Description Topic"]["Value"] == "robot_description"
    assert robot["Description Topic"]["Durability Policy"] == "Transient Local"


def test_the_sections_of_the_named_node_decide_what_is_drawn(
    launch_file: ModuleType, tmp_path: Path
) -> None:
    """One file for two boards: RViz and the frames are those of the board that starts."""
    file = tmp_path / "both.yaml"
    robots = {"left": "panda", "/lab/right": "icub_left_arm"}
    file.write_text(yaml.dump({n: {"ros__parameters": {"robot": r}} for n, r in robots.items()}))
    _, rviz = started(launch_file, params_file=str(file), name="left", rviz="true")
    assert rviz.arguments[-1] == "panda_link0"
    if find_spec("icub_models"):
        asked = {"params_file": str(file), "name": "right", "namespace": "lab", "rviz": "true"}
        assert started(launch_file, **asked)[1].arguments[-1] != "panda_link0"


def test_a_plant_with_its_arguments(launch_file: ModuleType, tmp_path: Path) -> None:
    (node,) = started(
        launch_file,
        plant="virtual/moteus",
        plant_arguments='[ratio=6.0, "ids=1 2 3 4 5 6 7"]',
        control_rate="500",
        physics="ideal",
    )
    settings = settings_of(node, tmp_path)
    assert settings.values["plant_arguments"] == ["ratio=6.0", "ids=1 2 3 4 5 6 7"]
    assert (settings.values["plant"], settings.board.control_rate) == ("virtual/moteus", 500.0)


def test_the_help_names_every_robot(launch_file: ModuleType) -> None:
    assert all(name in launch_file.PARAMETERS["robot"] for name in NAMES)


def test_robot_state_publisher_in_place_of_the_board(launch_file: ModuleType) -> None:
    """Frames are published once; it gets the URDF that the board publishes."""
    board, publisher, _ = started(launch_file, rviz="true", robot_state_publisher="True")
    assert board.parameters == [{}]
    (given,) = publisher.parameters
    (text,) = given["robot_description"].positional
    assert parse(text.encode(), "told", Path()).name == "lbr_iiwa"


@pytest.mark.parametrize("wrong", [{"rviz": "yes"}, {"robot_state_publisher": ""}])
def test_a_switch_is_true_or_false(launch_file: ModuleType, wrong: dict[str, str]) -> None:
    with pytest.raises(ValueError, match="is not allowed; true and false are"):
        started(launch_file, **wrong)


def test_a_wrong_robot_is_reported_by_the_board(launch_file: ModuleType, tmp_path: Path) -> None:
    (node,) = started(launch_file, robot="pandaa")
    with pytest.raises(SettingsError, match="did you mean 'panda'"):
        settings_of(node, tmp_path)


def test_launch_itself_reads_it() -> None:
    sources = pytest.importorskip("launch.launch_description_sources")
    context = sys.modules["launch"].LaunchContext()
    description = sources.PythonLaunchDescriptionSource(str(FILE)).get_launch_description(context)
    assert {"robot", "rviz"} < {one.name for one in description.get_launch_arguments()}

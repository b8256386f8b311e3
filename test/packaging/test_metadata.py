# SPDX-License-Identifier: Apache-2.0
"""What the several descriptions of the package say about the same thing agrees."""

import ast
import re
import sys
import tomllib
import xml.etree.ElementTree as ET

from package_descriptions import PYPROJECT, ROOT, XML, setup_list

import control_board_ros

PACKAGE = ROOT / "control_board_ros"
# Not ROS packages; the optional ones are imported where they are used, with an error that says so.
NOT_ROS = {
    "numpy",
    "pybullet",
    "pybullet_data",
    "rich",
    "prompt_toolkit",
    "yaml",
}
OPTIONAL = {
    "can",
    "canopen",
    "cython",
    "dynamixel_sdk",
    "foxglove",
    "gymnasium",
    "icub_models",
    "matplotlib",
    "moteus",
    "msgpack",  # of a bus by UDP multicast
    "mujoco",
    "optuna",
    "scipy",
    "sqlalchemy",  # comes with optuna
    "pygame",
    "pytest",
    "scservo_sdk",
    "serial",  # comes with moteus
    "stable_baselines3",
    "torch",
    "hypothesis",
    "PIL",
    "argcomplete",
    "starlette",
    "uvicorn",
}


def imported_packages() -> set[str]:
    """The first part of every absolute import in the package, the standard library aside."""
    found: set[str] = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                found.add(node.module.split(".")[0])
    return found - set(sys.stdlib_module_names) - {"control_board_ros", "control_board_msgs"}


def test_versions_agree() -> None:
    version = control_board_ros.__version__
    messages = ET.parse(ROOT / "msg_defs/package.xml").getroot()
    newest = re.search(r"^## (\d\S*)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    plug_in = tomllib.loads((ROOT / "integrations/lerobot/pyproject.toml").read_text())
    assert re.fullmatch(r"\d+\.\d+\.\d+", version)  # what package.xml allows
    assert XML.findtext("version") == version
    assert messages.findtext("version") == version
    assert plug_in["project"]["version"] == version
    assert newest is not None
    assert newest[1] == version


def test_maintainer_can_be_written_to() -> None:
    """With a malformed address colcon takes the package for plain Python, without a word."""
    for path in ("package.xml", "msg_defs/package.xml"):
        maintainer = ET.parse(ROOT / path).getroot().find("maintainer")
        assert maintainer is not None
        assert re.fullmatch(r"[\w.+-]+@[\w-]+(\.[\w-]+)+", maintainer.get("email", ""))


def test_ros_packages_are_pinned_to_one_version_each() -> None:
    """An unpinned name can resolve to another ROS distribution."""
    pins: dict[str, str] = {}
    for requirement in [*PYPROJECT["build-system"]["requires"], *setup_list("ROS_WHEELS")]:
        name, _, version = requirement.partition("==")
        if name.startswith("ros-"):
            assert version, f"{requirement} is not pinned"
            assert pins.setdefault(name, version) == version, f"{name} is pinned twice"
    assert len(pins) > 20


def test_every_import_is_a_declared_dependency() -> None:
    """In package.xml for rosdep and colcon, and in setup.py for pip."""
    in_xml = {node.text for node in XML if node.tag in {"depend", "exec_depend"}}
    wheels = {re.split(r"[\[=<>]", entry)[0] for entry in setup_list("ROS_WHEELS")}
    imported = imported_packages()
    assert {"rclpy", "sensor_msgs"} <= imported
    for package in imported - NOT_ROS - OPTIONAL:
        assert package in in_xml, f"{package} is imported and not in package.xml"
        wheel = "ros-jazzy-rclpy" if package == "rclpy" else f"ros-{package.replace('_', '-')}"
        comes_with_rclpy = package in {"ament_index_python", "rclpy", "rcl_interfaces"}
        built_here = (ROOT / "vendor" / package).is_dir()
        assert wheel in wheels or comes_with_rclpy or built_here, (
            f"{package} is imported and not in setup.py"
        )


def test_license_is_there_and_named_in_every_source_file() -> None:
    assert "Apache License" in (ROOT / "LICENSE").read_text(encoding="utf-8")
    sources = [*PACKAGE.rglob("*.py"), *(ROOT / "test").rglob("*.py"), ROOT / "setup.py"]
    without = [
        str(path.relative_to(ROOT))
        for path in sources
        if "SPDX-License-Identifier: Apache-2.0" not in path.read_text(encoding="utf-8")[:200]
    ]
    assert not without


def test_modules_of_the_panel_s_page_have_types_and_short_lines() -> None:
    """`make check` reads their types; at most 120 characters, drawings of icons are one word."""
    for path in (PACKAGE / "panel" / "page").glob("*.js"):
        lines = path.read_text(encoding="utf-8").splitlines()
        assert "// @ts-check" in lines[:3], path.name
        for number, line in enumerate(lines, 1):
            assert len(line) <= 120 or ': "M' in line, f"{path.name}:{number}"


def test_known_unsteady_tests_are_few_and_say_why() -> None:
    """A test that fails now and then exists, and has a date and a cause."""
    lines = (ROOT / "test" / "unsteady.txt").read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line and not line.startswith("#")]
    assert len(rows) <= 10
    for row in rows:
        found = re.fullmatch(r"(test/\S+\.py)::(\w+)(\[.*?\])? \d{4}-\d\d-\d\d \S.*", row)
        assert found, row
        assert f"def {found[2]}(" in (ROOT / found[1]).read_text(encoding="utf-8"), row

# SPDX-License-Identifier: Apache-2.0
"""What an installation puts on the machine, by whichever way it was installed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from processes import ended, python

import control_board_ros

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = ("control_board", "cbctl", "control_board_conformance")


def test_configurations_are_installed_as_they_are_in_the_source() -> None:
    installed = Path(get_package_share_directory("control_board_ros"))
    kinds = {".yaml", ".xml", ".rviz", ".json", ".py"}
    folders = (ROOT / "config", ROOT / "launch")
    sources = [p for folder in folders for p in folder.rglob("*") if p.suffix in kinds]
    assert {path.suffix for path in sources} == kinds
    for path in sources:
        copy = installed / path.relative_to(ROOT)
        assert copy.read_text() == path.read_text(), (
            f"{path.name} is not the installed one; run `make setup`"
        )


def test_all_packages_are_in_the_ament_index() -> None:
    for package in (
        "control_board_ros",
        "control_board_msgs",
        "control_msgs",
        "tf2_msgs",
        "yarp_control_msgs",
    ):
        assert (Path(get_package_share_directory(package)) / "package.xml").is_file()


def test_package_is_marked_as_typed() -> None:
    assert (Path(control_board_ros.__file__).parent / "py.typed").is_file()
    assert (Path(control_board_ros.__file__).parent / "discovery.xml").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_ros2_run_and_shells_find_a_command(command: str) -> None:
    """In lib/control_board_ros for `ros2 run`, in bin for shells, however it was installed."""
    prefix = Path(get_package_prefix("control_board_ros"))
    for place in (f"lib/control_board_ros/{command}", f"bin/{command}"):
        assert (prefix / place).exists(), f"{place} is not installed; run `make setup`"
        done = ended(prefix / place, "--help")
        assert done.stderr == "", place
        assert command in done.stdout


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = "import sys, control_board_ros; print(*sys.modules)"
    loaded = set(python(code).stdout.split())
    assert "control_board_ros" in loaded
    assert not loaded & {"numpy", "pybullet", "rclpy", "control_board_msgs", "rich"}


def ament_prefix_path_after_import(before: str | None) -> list[str]:
    environment = {key: value for key, value in os.environ.items() if key != "AMENT_PREFIX_PATH"}
    if before is not None:
        environment["AMENT_PREFIX_PATH"] = before
    code = "import os, control_board_ros; print(os.environ.get('AMENT_PREFIX_PATH', ''))"
    printed = python(code, env=environment).stdout.strip()
    return [entry for entry in printed.split(os.pathsep) if entry]


@pytest.mark.skipif(
    not Path(sys.prefix, "share/ament_index").is_dir(), reason="ROS is not in this environment"
)
def test_environment_of_wheels_is_found_without_a_setup_file() -> None:
    assert ament_prefix_path_after_import(None) == [sys.prefix]
    assert ament_prefix_path_after_import("") == [sys.prefix]
    assert ament_prefix_path_after_import("/opt/ros/jazzy") == ["/opt/ros/jazzy", sys.prefix]
    assert ament_prefix_path_after_import(sys.prefix) == [sys.prefix]


def find_python(
    tmp_path: Path, *without: str, wanted: str = ""
) -> subprocess.CompletedProcess[str]:
    """tools/find-python fails on a machine that has its tools, except the given ones."""
    tools = {"sh", "sed", "sort", "head", "printf", "cmake", "make", "cc", "c++", "apt-get"}
    for tool in tools - set(without):
        found = shutil.which(tool)
        if found:
            (tmp_path / tool).symlink_to(found)
    if "apt-get" not in without and not (tmp_path / "apt-get").exists():
        (tmp_path / "apt-get").symlink_to("/bin/true")
    words = (ROOT / "tools/find-python", *([wanted] if wanted else []))
    return ended(*words, code=1, env={"PATH": str(tmp_path)})


@pytest.mark.parametrize(
    ("without", "missing", "package"),
    [
        (["cmake"], "", "cmake"),
        (["c++"], "", "g++"),
        (["make"], "", "make"),
        ([], "Python 3.11 or 3.12", "python3.11"),
    ],
)
def test_missing_packages_are_reported_in_one_line(
    tmp_path: Path, without: list[str], missing: str, package: str
) -> None:
    done = find_python(tmp_path, *without)
    assert done.stdout == ""
    assert done.stderr.startswith(f"missing: {missing}")
    assert f"sudo apt-get install {package}" in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_python_that_will_not_do_is_refused_by_name(tmp_path: Path) -> None:
    done = find_python(tmp_path, wanted="python9.9")
    assert done.stderr.startswith("python9.9 is not Python 3.11 or 3.12")
    assert done.stderr.count("\n") == 1

# SPDX-License-Identifier: Apache-2.0
"""The layout of a release: what a ROS distribution takes, read by its own tools."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest
from package_descriptions import ROOT

pytest.importorskip("catkin_pkg", reason="comes with the build requirements")
pytestmark = pytest.mark.skipif(
    not (ROOT / ".git").exists() or shutil.which("git") is None, reason="needs the repository"
)

NAMES = ["control_board_msgs", "control_board_ros", "yarp_control_msgs"]


@pytest.fixture(scope="module")
def module() -> ModuleType:
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        import release_layout
    finally:
        sys.path.remove(str(ROOT / "tools"))
    return release_layout


@pytest.fixture(scope="module")
def layout(module: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("release") / "layout"
    module.write(folder)
    return folder


def test_a_distribution_accepts_the_layout(module: ModuleType, layout: Path) -> None:
    assert module.problems(layout) == []
    assert sorted(path.name for path in layout.iterdir()) == NAMES
    assert (layout / "control_board_msgs" / "msg" / "BoardState.msg").is_file()


def test_the_messages_are_built_once(layout: Path) -> None:
    """The package that colcon builds as Python finds no definitions of its own to build."""
    own = layout / "control_board_ros"
    assert not (own / "msg_defs").exists()
    assert not (own / "vendor").exists()
    text = (own / "package.xml").read_text("utf-8")
    assert "<depend>control_board_msgs</depend>" in text
    assert "rosidl_default_generators" not in text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("<version>", "<version>7", "different version numbers"),
        ("@noreply.example.org", "@example.org", "is no maintainer to write to"),
        ("exec_depend>rclpy<", "exec_depend>a-pip</exec_depend><exec_depend>rclpy<", "of pip"),
        ('file="LICENSE"', 'file="COPYING"', "no license file COPYING"),
    ],
)
def test_layouts_that_a_distribution_refuses_are_reported(
    module: ModuleType, layout: Path, tmp_path: Path, old: str, new: str, expected: str
) -> None:
    copy = shutil.copytree(layout, tmp_path / "copy")
    package = copy / "control_board_ros" / "package.xml"
    text = package.read_text("utf-8")
    assert old in text
    package.write_text(text.replace(old, new, 1), "utf-8")
    assert expected in " ".join(module.problems(copy))


def test_unreleased_changes_are_forthcoming(module: ModuleType) -> None:
    new = "- A [link](x.md) to `name_`, *b*.\n"
    text = f"# Changelog\n\n## Unreleased\n\n{new}\n## 0.1.0\n\n- Old.\n"
    page = module.changelog(text, "0.1.0", "2026-01-31")
    assert "Forthcoming\n-----------\n\n* A link to ``name_``, \\*b\\*.\n" in page
    assert "0.1.0 (2026-01-31)\n" in page
    assert "1.0.0 (2026-01-31)\n" in module.changelog(text, "1.0.0", "2026-01-31")

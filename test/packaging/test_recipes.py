# SPDX-License-Identifier: Apache-2.0
"""Files for tools that do not run here, read and linted: Docker, pixi, a CI, citations."""

from __future__ import annotations

import json
import re
import shutil
import tomllib
from pathlib import Path

import yaml
from package_descriptions import PYPROJECT, ROOT
from processes import ended

import control_board_ros


def test_the_dockerfile_is_short_and_ends_as_a_user() -> None:
    """Of a fixed base, without what only building needs."""
    lines = [
        line for line in (ROOT / "Dockerfile").read_text("utf-8").splitlines() if line[:1] != "#"
    ]
    text = "\n".join(lines)
    assert len(lines) <= 10
    assert all(":" in line for line in lines if line.startswith("FROM "))
    assert ":latest" not in text
    assert [line for line in lines if line.startswith("USER ")][-1].split()[1].isdigit()
    assert text.count("pip install") == text.count("pip install --no-cache-dir")
    assert text.count("apt-get install") == text.count("rm -rf /var/lib/apt/lists")


def test_the_dev_container_sets_up_by_make() -> None:
    text = (ROOT / ".devcontainer" / "devcontainer.json").read_text("utf-8")
    assert len(text.splitlines()) <= 10
    assert json.loads(text)["postCreateCommand"] == "make setup"


def test_pixi_builds_the_package_for_this_distribution() -> None:
    pixi = tomllib.loads((ROOT / "pixi.toml").read_text("utf-8"))
    assert pixi["package"]["build"]["backend"]["name"] == "pixi-build-ros"
    assert "robostack-jazzy" in pixi["workspace"]["channels"]
    assert pixi["dependencies"]["ros-jazzy-control-board-ros"] == {"path": "."}


def test_the_forge_builds_the_site() -> None:
    jobs = yaml.safe_load((ROOT / ".github/workflows/pages.yml").read_text("utf-8"))["jobs"]
    steps = jobs["site"]["steps"]
    assert {"run": "make site"} in steps
    assert "\nsite: " in (ROOT / "Makefile").read_text("utf-8")


def test_citation_and_issue_form_can_be_read() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert citation["version"] == control_board_ros.__version__
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    form = yaml.safe_load((ROOT / ".github/ISSUE_TEMPLATE/problem.yml").read_text("utf-8"))
    names = [field["id"] for field in form["body"]]
    assert len(names) == len(set(names))


def test_wheels_are_repaired_in_one_way() -> None:
    settings = PYPROJECT["tool"]["cibuildwheel"]
    assert settings["repair-wheel-command"].startswith("tools/repair-wheel ")
    assert "tools/repair-wheel " in (ROOT / "tools" / "build-wheels").read_text("utf-8")
    assert settings["test-command"] == "python -m control_board_ros.testing"


def test_one_command_sets_the_version_everywhere(tmp_path: Path) -> None:
    files = [
        "control_board_ros/__init__.py",
        "package.xml",
        "msg_defs/package.xml",
        "integrations/lerobot/pyproject.toml",
        "CITATION.cff",
    ]
    for name in [*files, "CHANGELOG.md", "tools/set-version"]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    (tmp_path / "CHANGELOG.md").write_text("## Unreleased\n\n- New.\n\n## 0.1.0\n")
    script = tmp_path / "tools" / "set-version"
    ended(script, "7.8.9")
    for name in [*files, "CHANGELOG.md"]:
        assert "7.8.9" in (tmp_path / name).read_text("utf-8"), name
    text = (tmp_path / "CHANGELOG.md").read_text("utf-8")
    assert re.match(r"## 7\.8\.9 \(\d{4}-\d\d-\d\d\)\n\n- New\.\n", text)
    refused = ended(script, "7.8", code=2)
    assert refused.stderr == "'7.8' is no version; give three numbers: tools/set-version 1.2.3\n"

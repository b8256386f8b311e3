# SPDX-License-Identifier: Apache-2.0
"""Files for tools that do not run here, read and linted: Docker, pixi, a CI, citations."""

from __future__ import annotations

import itertools
import json
import re
import shutil
import tomllib
from pathlib import Path

import yaml
from package_descriptions import PYPROJECT, ROOT
from processes import ended

import control_board_ros

DOCKERFILE = [
    line for line in (ROOT / "Dockerfile").read_text("utf-8").splitlines() if line[:1] != "#"
]


def lint(lines: list[str]) -> set[str]:
    """The rules of hadolint that lines of a Dockerfile break, of those that matter to ours."""
    text = "\n".join(lines)
    pairs = list(itertools.pairwise(lines))
    packages = " ".join(re.findall(r"apt-get install (.*?)(?:&&|$)", text, re.M)).split()
    named = [word for word in packages if not word.startswith("-")]
    pip = re.findall(r"pip (?:install|wheel) [^&]*", text)
    users = [line.split()[1] for line in lines if line.startswith("USER ")]
    broken = {
        "DL3002": users[-1:] in ([], ["root"]),
        "DL3004": "sudo " in text,
        "DL3006": any(":" not in line for line in lines if line.startswith("FROM ")),
        "DL3007": ":latest" in text,
        "DL3008": any("=" not in word for word in named),
        "DL3009": "apt-get install" in text and "rm -rf /var/lib/apt/lists" not in text,
        "DL3014": bool(named) and "-y" not in packages,
        "DL3015": bool(named) and "--no-install-recommends" not in packages,
        "DL3020": any(line.startswith("ADD ") for line in lines),
        "DL3025": any(
            line.startswith(("CMD ", "ENTRYPOINT ")) and not line.split(" ", 1)[1].startswith("[")
            for line in lines
        ),
        "DL3042": any("--no-cache-dir" not in command for command in pip),
        "DL3045": any(
            line.startswith("COPY ") and not line.split()[-1].startswith("/") for line in lines
        ),
        "DL3059": any(a.startswith("RUN ") and b.startswith("RUN ") for a, b in pairs),
        "DL3066": any(not user.isdigit() for user in users),
        "DL4006": any(
            line.startswith("RUN ") and re.search(r"[^|]\|[^|]", line) for line in lines
        ),
    }
    return {rule for rule, is_so in broken.items() if is_so}


def test_the_dockerfile_is_short_and_clean() -> None:
    assert len(DOCKERFILE) <= 10
    assert lint(DOCKERFILE) == set()


def test_rules_of_hadolint_are_kept() -> None:
    bad = [
        "FROM debian",
        "RUN apt-get install cmake | tee log",
        "RUN sudo pip install numpy",
        "ADD . here",
        "COPY . here",
        "CMD control_board",
    ]
    rules = ["02", "04", "06", "08", "09", "14", "15", "20", "25", "42", "45", "59"]
    assert lint(bad) == {f"DL30{rule}" for rule in rules} | {"DL4006"}
    assert lint(["FROM debian:latest", "USER board"]) == {"DL3007", "DL3066"}


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

# SPDX-License-Identifier: Apache-2.0
"""`python -m control_board_ros.testing`: what an installation tries of itself."""

from __future__ import annotations

import sys
import types
from collections.abc import Iterator
from pathlib import Path

import pytest
from processes import ended

from control_board_ros.testing import installation

REQUIRES = ["numpy>=1.26", "starlette>=1.0; extra == 'panel'", "numpy>=2; extra == 'test'"]


def test_requirements_of_extras_alone() -> None:
    assert installation.extras(REQUIRES) == {"starlette": "panel"}


def test_the_engine_of_another_python_is_optional() -> None:
    """Each Python has its engine in the base, and the other's as an extra."""
    base = ['old>=1; python_version < "3.4"', 'new>=1; python_version >= "3.4"']
    optional = [f"{name}>=1; extra == '{name}'" for name in ("old", "new")]
    assert installation.extras([*base, *optional]) == {"old": "old"}


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[types.ModuleType]:
    """A package of one module, which imports what is not there."""
    folder = tmp_path / "a_package"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "__main__.py").write_text("raise SystemExit('not to be imported')")
    (folder / "needs.py").write_text("import not_there_at_all")
    monkeypatch.syspath_prepend(str(tmp_path))
    import a_package

    yield a_package
    for name in [name for name in sys.modules if name.startswith("a_package")]:
        del sys.modules[name]


def test_a_module_may_miss_packages_of_an_extra(package: types.ModuleType) -> None:
    text = installation.modules(package, ["not-there-at-all>=1; extra == 'some'"])
    assert text == "0 modules; optional, not installed: not-there-at-all"


def test_a_module_may_not_miss_required_packages(package: types.ModuleType) -> None:
    with pytest.raises(ModuleNotFoundError, match="not_there_at_all"):
        installation.modules(package, ["not-there-at-all>=1"])


def test_a_failure_is_one_line_and_the_exit_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken() -> str:
        raise RuntimeError("first\nsecond")

    monkeypatch.setattr(installation, "CHECKS", {"a": lambda: "well", "b": broken})
    assert installation.main([]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert [line.split() for line in lines[:2]] == [
        ["ok", "a", "well"],
        ["FAILED", "b", "RuntimeError:", "first", "second"],
    ]
    assert lines[2].startswith("1 of 2 passed in ")
    assert installation.main(["a"]) == 0


def test_messages_files_and_simulation_pass() -> None:
    for name in ("messages", "files", "simulation"):
        assert installation.attempt(installation.CHECKS[name])[0], name


@pytest.mark.slow
@pytest.mark.ros
def test_this_installation_passes() -> None:
    words = ("-m", "control_board_ros.testing", "modules", "node", "command line")
    done = ended(sys.executable, *words, timeout=300)
    assert "3 of 3 passed" in done.stdout

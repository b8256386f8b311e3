# SPDX-License-Identifier: Apache-2.0
"""`make` makes its environment (tools/set_up.py), and nothing is built twice (tools/store.py)."""

from __future__ import annotations

import importlib
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
from package_descriptions import ROOT
from processes import ended

from control_board_ros import compiled

TOOLS = ("store", "interfaces", "set_up")


@pytest.fixture
def tools(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, ModuleType]]:
    """The modules of tools/, with a store of their own."""
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("CONTROL_BOARD_CACHE", raising=False)
    try:
        yield {name: importlib.import_module(name) for name in TOOLS}
    finally:
        for name in TOOLS:
            sys.modules.pop(name, None)


def folder(path: Path, text: str) -> Path:
    path.mkdir(parents=True)
    (path / "file").write_text(text)
    return path


def test_what_is_kept_is_found_by_name_and_key(
    tools: dict[str, ModuleType], tmp_path: Path
) -> None:
    store = tools["store"]
    assert store.folder() == tmp_path / "cache/control_board_ros"
    assert store.find("messages", "1") is None
    kept = store.keep("messages", "1", folder(tmp_path / "made", "first"))
    assert store.find("messages", "1") == kept
    assert (kept / "file").read_text() == "first"
    assert store.find("messages", "2") is None
    assert store.find("laws", "1") is None


def test_of_two_builds_at_once_the_first_is_kept_whole(
    tools: dict[str, ModuleType], tmp_path: Path
) -> None:
    """The second build of the same content ends as well as the first."""
    store = tools["store"]
    store.keep("messages", "1", folder(tmp_path / "first", "first"))
    kept = store.keep("messages", "1", folder(tmp_path / "second", "second"))
    assert (kept / "file").read_text() == "first"
    assert [path.name for path in store.folder().iterdir()] == ["messages-1"]


def test_what_nobody_asks_for_is_forgotten(tools: dict[str, ModuleType], tmp_path: Path) -> None:
    store = tools["store"]
    for key in ("old", "used"):
        os.utime(store.keep("messages", key, folder(tmp_path / key, key)), (1, 1))
    store.find("messages", "used")
    store.keep("messages", "new", folder(tmp_path / "new", "new"))
    assert {path.name for path in store.folder().iterdir()} == {"messages-used", "messages-new"}


@pytest.mark.parametrize(
    ("variable", "value"),
    [("CONTROL_BOARD_CACHE", "off"), ("XDG_CACHE_HOME", "/proc/read-only")],
)
def test_without_a_cache_folder_the_checkout_keeps(
    tools: dict[str, ModuleType], monkeypatch: pytest.MonkeyPatch, variable: str, value: str
) -> None:
    monkeypatch.setenv(variable, value)
    assert tools["store"].folder() == ROOT / "build/kept"


def test_a_key_is_of_names_and_contents(tools: dict[str, ModuleType], tmp_path: Path) -> None:
    key = tools["store"].key
    one, two = tmp_path / "one", tmp_path / "two"
    one.write_text("same")
    two.write_text("same")
    assert key([one]) != key([two])
    assert key(["ab", "c"]) != key(["a", "bc"])
    before = key([one])
    one.write_text("other")
    assert key([one]) != before


def test_messages_are_built_again_only_for_other_content(
    tools: dict[str, ModuleType], tmp_path: Path
) -> None:
    """Each build of pip has the tools of ROS in a new folder; that is no other content."""
    interfaces = tools["interfaces"]
    definitions = tmp_path / "defs"
    shutil.copytree(ROOT / "msg_defs", definitions)
    prefixes = interfaces.ros_prefixes()
    elsewhere = [tmp_path / f"prefix{k}" for k in range(len(prefixes))]
    for link, prefix in zip(elsewhere, prefixes, strict=True):
        link.symlink_to(prefix)
    made_of = interfaces.made_of
    key = made_of(definitions, prefixes, python_only=True)
    assert made_of(definitions, elsewhere, python_only=True) == key
    assert made_of(definitions, prefixes, python_only=False) != key
    changed = definitions / "msg/Request.msg"
    changed.write_text(changed.read_text() + "bool more")
    assert made_of(definitions, prefixes, python_only=True) != key


def test_an_interrupted_build_begins_anew(tools: dict[str, ModuleType], tmp_path: Path) -> None:
    """Make takes files half written for whole ones; CMake's folder of a whole build is used."""
    interfaces = tools["interfaces"]
    prefixes = interfaces.ros_prefixes()
    package = interfaces.Package("m", ROOT / "msg_defs", tmp_path, prefixes, True)
    package.begin(prefixes)
    half = package.work / "build/half"
    half.parent.mkdir()
    half.touch()
    package.begin(prefixes)
    assert not half.exists()
    half.parent.mkdir()
    half.touch()
    (package.work / "building-for.txt").rename(package.stamp)  # the script's last command
    package.begin(prefixes)
    assert half.exists()


def test_a_failed_build_ends_with_the_package_and_its_log(
    tools: dict[str, ModuleType], tmp_path: Path
) -> None:
    interfaces = tools["interfaces"]
    definitions = folder(tmp_path / "defs", "")
    (definitions / "package.xml").write_text("<package/>")
    package = interfaces.Package("broken", definitions, tmp_path, [], True)
    package.begin([])
    interfaces.run_make(tmp_path, 2, [package], dict(os.environ))
    with pytest.raises(SystemExit) as refused:
        package.keep()
    last = str(refused.value).splitlines()[-1]
    assert last == f"building broken failed; log: {tmp_path}/{package.work.name}/cmake.log"
    assert "CMakeLists.txt" in str(refused.value)


def test_sources_of_an_installation(tools: dict[str, ModuleType], tmp_path: Path) -> None:
    """Compiled modules, messages and what setup.py installs; each pattern names something."""
    set_up = tools["set_up"]
    assert all(list(ROOT.glob(pattern)) for pattern in set_up.SOURCES)
    files = set(set_up.sources())
    assert {ROOT / f"{name.replace('.', '/')}.py" for name in compiled.MODULES} < files
    assert {ROOT / "setup.py", *ROOT.glob("msg_defs/*/*"), *ROOT.glob("config/*.yaml")} < files
    assert all(path.is_file() for path in files)


def script(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


@pytest.fixture
def installer(tools: dict[str, ModuleType], tmp_path: Path) -> object:
    """With a uv and a pip that write down what they are called with, and succeed."""
    python = script(tmp_path / "bin/python", f'echo "pip $*" >>{tmp_path}/calls')
    uv = script(tmp_path / "bin/uv", f'echo "uv $*" >>{tmp_path}/calls')
    made = tools["set_up"].Installer(python, tmp_path / "log.txt")
    made.uv = str(uv)
    return made


def calls(tmp_path: Path) -> list[str]:
    lines = (tmp_path / "calls").read_text().splitlines()
    return [line for line in lines if "config list" not in line]


def test_uv_installs(installer, tmp_path: Path) -> None:
    installer.install("packages", "numpy")
    assert calls(tmp_path) == [f"uv pip install --python {tmp_path}/bin/python numpy"]


def test_pip_installs_where_uv_cannot(installer, tmp_path: Path) -> None:
    """First from what uv has without a network."""
    script(Path(installer.uv), f'echo "uv $*" >>{tmp_path}/calls; exit 1')
    installer.install("packages", "numpy")
    uv, offline, pip = calls(tmp_path)
    assert uv.startswith("uv pip install")
    assert "--offline" in offline
    assert pip.startswith("pip -m pip")


def test_what_nobody_can_install_is_one_line(installer, tmp_path: Path) -> None:
    """Without the warnings that pip has about its settings, in hundreds."""
    warning = "WARNING: Location 'file:///a/' is ignored"
    said = f'echo "{warning}"; echo "ERROR: No matching distribution found for numpy"; exit 1'
    script(installer.python, said)
    installer.uv = None
    with pytest.raises(SystemExit) as refused:
        installer.install("packages", "numpy")
    assert str(refused.value) == (
        "cannot install packages: ERROR: No matching distribution found for numpy; "
        f"is the package index reachable? log: {tmp_path}/log.txt"
    )
    assert warning in (tmp_path / "log.txt").read_text()


def test_uv_uses_the_index_that_pip_is_set_to(
    installer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("UV_DEFAULT_INDEX", "UV_FIND_LINKS"):
        monkeypatch.delenv(name, raising=False)
    lines = "global.index-url='https://mirror/simple'\n:env:.find-links='/a /b'"
    script(installer.python, f'echo "{lines}"')
    environment = installer.uv_environment()
    assert environment["UV_DEFAULT_INDEX"] == "https://mirror/simple"
    assert environment["UV_FIND_LINKS"] == "/a,/b"
    monkeypatch.setenv("UV_DEFAULT_INDEX", "https://own/simple")
    assert installer.uv_environment()["UV_DEFAULT_INDEX"] == "https://own/simple"


def test_an_up_to_date_environment_is_left_alone(
    tools: dict[str, ModuleType],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Without a word; a change of a message or an extra more is set up."""
    set_up = tools["set_up"]
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(set_up, "ROOT", tmp_path)
    for name in ("setup.py", "pyproject.toml", "msg_defs/A.msg", "control_board_ros/compiled.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("MODULES = ()")
    done = []
    monkeypatch.setattr(
        set_up.Environment, "set_up", lambda self, wanted, extras: done.append(extras)
    )
    environment = set_up.Environment(tmp_path)
    environment.own.mkdir()
    environment.record(environment.wanted(["test"]), *environment.wanted(["test"]))
    set_up.main([str(tmp_path), "test"])
    set_up.main([str(tmp_path)])
    assert not done
    assert capsys.readouterr().out == ""
    set_up.main([str(tmp_path), "icub"])
    (tmp_path / "msg_defs/A.msg").write_text("changed")
    set_up.main([str(tmp_path)])
    assert done == [["icub"], []]


@pytest.mark.slow
def test_this_environment_requires_what_setup_py_names(tools: dict[str, ModuleType]) -> None:
    """Markers too, which setuptools keeps apart: of the engines each Python has its own."""
    environment = tools["set_up"].Environment(Path(sys.prefix))
    base = environment.requirements([])
    assert 'pybullet>=3.2.6; python_version < "3.12"' in base
    assert 'mujoco-core>=4; python_version >= "3.12"' in base
    assert not any("pytest" in line for line in base)
    assert any("pytest" in line for line in environment.requirements(["test"]))
    with pytest.raises(SystemExit, match="no extra nothing"):
        environment.requirements(["nothing"])


def test_help_of_make_names_each_word() -> None:
    text = ended("make", "-C", ROOT, "help").stdout
    for word in ("run", "test", "setup", "panel"):
        assert f"make {word} " in text

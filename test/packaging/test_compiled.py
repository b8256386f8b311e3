# SPDX-License-Identifier: Apache-2.0
"""What runs in every cycle runs compiled and as plain Python, and reports which."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import os
import shutil
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest
from package_descriptions import PYPROJECT, ROOT, XML
from processes import ended, python
from pure import SUFFIX as AS_PYTHON
from pure import as_python, load_all

import control_board_ros
from control_board_ros import compiled, nocython
from control_board_ros.sim.config import DEFAULT_PHYSICS

MODULES = [ROOT / f"{name.replace('.', '/')}.py" for name in compiled.MODULES]
SUFFIX = EXTENSION_SUFFIXES[0]
TELL = "from control_board_ros import compiled; print(compiled.describe())"


def run(code: str, folder: Path) -> str:
    """What a fresh interpreter prints that finds a folder's packages first."""
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
    return python(code, cwd=folder, env=os.environ | {"PYTHONPATH": path}).stdout.strip()


def test_build_descriptions_name_the_compiled_modules() -> None:
    """What is compiled from them is made anew when they change; Cython is requested."""
    keys = {entry["file"] for entry in PYPROJECT["tool"]["uv"]["cache-keys"]}
    for path in MODULES:
        assert path.is_file()
        assert str(path.relative_to(ROOT)) in keys
    pins = [entry for entry in PYPROJECT["build-system"]["requires"] if "ython==" in entry]
    assert len(pins) == 1
    assert [node.tag for node in XML if node.text == "cython3"] == ["build_depend"]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_compiled_modules_keep_to_what_every_cython_compiles(path: Path) -> None:
    """Ubuntu 24.04, which ROS 2 Jazzy runs on, has Cython 3.0: no match statement, no const, and
    no ``Any`` as what a C function returns.
    """
    text = path.read_text(encoding="utf-8")
    nodes = list(ast.walk(ast.parse(text)))
    assert not [node.lineno for node in nodes if isinstance(node, ast.Match)]
    assert "cython.const" not in text
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    in_c = [f for f in functions if "cython.cfunc" in map(ast.unparse, f.decorator_list)]
    assert not [f.name for f in in_c if f.returns and ast.unparse(f.returns) == "Any"]


SOURCE = '''
GAIN = cython.declare(cython.double, 2.0)
HIDDEN = cython.declare(cython.int, 1)

@cython.cfunc
@cython.inline
def clamp(value: cython.double, most: cython.double = 1.0) -> cython.double:
    """At most ``most``."""
    limit: cython.double = min(value, most)
    return limit

@cython.cfunc
@cython.inline
def scaled(value: cython.double) -> cython.double:
    return GAIN * value

@cython.final
@cython.cclass
class Loop:
    """One of its kind."""

    gain = rate = cython.declare(cython.double, visibility="public")
    rows: cython.double[::1]
    parts: list[Loop]

    @cython.ccall
    def run(self, error: cython.double, owner: Any) -> cython.void:
        pass

    def __init__(self) -> None:
        pass
'''
USER = """
from .loop import Loop, clamp, scaled
from .loop import helper
from math import fabs, sqrt
from ... import nocython as cython

class Pair:
    left = right = cython.declare(cython.double)

@cython.cfunc
def use(loop: Loop) -> cython.bint:
    return True
"""
PXD = """# cython: language_level=3
cimport cython
cdef double GAIN

cdef inline double clamp(double value, double most=*):
    limit: cython.double = min(value, most)
    return limit

cdef double scaled(double value)

@cython.final
cdef class Loop:
    cdef public double gain, rate
    cdef double[::1] rows
    cdef list parts
    cpdef void run(self, double error, object owner)
"""


def test_declarations_are_read_from_the_source(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of what others import; the source that Cython takes beside them says it no more."""
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    tool = importlib.import_module("declarations")
    known = {"a.b.loop": tool.declared(SOURCE), "a.b.user": tool.declared(USER)}
    assert tool.imported(USER, "a.b.user", known) == {"a.b.loop": {"Loop", "clamp", "scaled"}}
    exported = {"Loop", "clamp", "scaled", "GAIN"}
    assert tool.pxd(known["a.b.loop"], exported, {}) == PXD
    assert tool.pxd(known["a.b.user"], {"use"}, {"a.b.loop": {"Loop"}}).endswith(
        "from a.b.loop cimport Loop\ncdef bint use(Loop loop)\n"
    )
    text = tool.for_cython(SOURCE, "a.b.loop", known, exported)
    assert text.count("\n") == SOURCE.count("\n")
    assert "def clamp" not in text
    assert "visibility" not in text
    for kept in ("HIDDEN = cython", "def scaled", "def run", "One of its kind."):
        assert kept in text
    assert tool.for_cython(USER, "a.b.user", known, set()).startswith("""
from cython.cimports.a.b.loop import Loop, clamp, scaled
from .loop import helper
from cython.cimports.libc.math import fabs, sqrt
import cython

class Pair:
    left = cython.declare(cython.double); right = cython.declare(cython.double)
""")


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_the_stand_in_has_all_names_of_cython_that_are_used(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "cython"
    }
    assert "double" in used
    assert not {name for name in used if not hasattr(nocython, name)}


def test_the_stand_in_changes_nothing() -> None:
    """Types convert and are subscripted, decorators return what they are given."""

    def law(value: float) -> float:
        return 2.0 * value

    assert nocython.cfunc(nocython.inline(law)) is law
    assert nocython.cast(nocython.int, 2.7) == 2
    assert nocython.cast(list, law) is law
    assert nocython.declare(nocython.double) == 0.0
    assert nocython.declare(nocython.double, 3) == 3.0
    assert nocython.declare(nocython.double[:, ::1]) is None
    assert nocython.declare(nocython.bint, visibility="public") is False


def test_the_modules_run_without_cython(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cython", None)
    assert {module.cython for module in load_all().values()} == {nocython}


def test_boards_can_be_made_with_either() -> None:
    from control_board_ros.core.laws import control, laws

    before = vars(control).copy()
    with as_python() as python:
        held = [value for value in vars(control).values() if hasattr(value, "__module__")]
        assert list(python) == list(compiled.MODULES)
        assert all(str(module.__file__).endswith(".py") for module in python.values())
        assert laws.__name__ + AS_PYTHON in {value.__module__ for value in held}
        assert laws.__name__ not in {value.__module__ for value in held}
    assert vars(control) == before


@pytest.mark.skipif(
    importlib.util.find_spec("Cython") is None, reason="Cython is not in this environment"
)
def test_the_installed_laws_are_compiled(tmp_path: Path) -> None:
    assert run(TELL, tmp_path) == "compiled", "see what the build says; run `make setup`"


@pytest.fixture(name="copy")
def copied_package(tmp_path: Path) -> Path:
    """A copy of the installed package's core and of what else is compiled, found first by
    interpreters started beside it.
    """
    where = "import control_board_ros; print(control_board_ros.__path__[0])"
    source, target = Path(run(where, tmp_path)), tmp_path / "control_board_ros"
    for pattern in (
        "__init__.py",
        "compiled*",
        "nocython.py",
        "text.py",
        "core/**/*.*",
        "sim/__init__.py",
        "sim/drive.*",
    ):
        for path in source.glob(pattern):
            (target / path.relative_to(source)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, target / path.relative_to(source))
    assert run(where, tmp_path) == str(target)
    return target


def test_a_changed_source_runs_in_the_place_of_the_compiled_module(copy: Path) -> None:
    if not list(copy.glob("core/laws/laws*.so")):
        pytest.skip("the laws are not compiled here")
    assert run(TELL, copy.parent) == "compiled"
    with (copy / "core/laws/laws.py").open("a", encoding="utf-8") as file:
        file.write("\nCHANGED = 42\n")
    text = run(TELL, copy.parent)
    assert text == "uncompiled (laws.py changed since; install it again)"
    code = "import control_board_ros.core.laws.laws as laws"
    assert run(f"{code}; print(laws.CHANGED, laws.__file__)", copy.parent) == (
        f"42 {copy / 'core/laws/laws.py'}"
    )


def test_the_compiled_module_needs_no_source(copy: Path) -> None:
    if not list(copy.glob("core/laws/laws*.so")):
        pytest.skip("the laws are not compiled here")
    (copy / "core/laws/laws.py").unlink()
    assert run(TELL, copy.parent) == "compiled"


def test_the_source_runs_where_nothing_is_compiled(copy: Path) -> None:
    for path in copy.glob("core/laws/laws*.so"):
        path.unlink()
    assert run(TELL, copy.parent).startswith("uncompiled (slower; ")


BUILD = """
import sys
import setuptools
from distutils.core import run_setup
build = run_setup("setup.py", stop_after="init").get_command_obj("build_ext")
build.build_lib, build.build_temp = sys.argv[1:]
build.ensure_finalized()
super(type(build), build).run()  # the messages aside
"""


@pytest.mark.soak
def test_a_build_without_a_compiler_continues_with_one_warning(tmp_path: Path) -> None:
    """What an earlier build has left behind does not go into this one."""
    leftover = tmp_path / f"lib/control_board_ros/core/laws/laws{SUFFIX}"
    leftover.parent.mkdir(parents=True)
    leftover.write_bytes(b"of another source")
    environment = os.environ | {"CC": "/bin/false"}
    done = python(BUILD, tmp_path / "lib", tmp_path / "temp", cwd=ROOT, env=environment)
    said = [line for line in done.stderr.splitlines() if "laws is not compiled (" in line]
    assert len(said) == 1, done.stderr
    assert "install Cython and a C compiler" in said[0]
    assert not leftover.exists()


#: Takes a module from the store, into a folder that is given; both times of change, s.
KEPT = """
import os, sys
from pathlib import Path
from types import SimpleNamespace
import setuptools
from distutils.core import run_setup
build = run_setup("setup.py", stop_after="init").get_command_obj("build_ext")
import store
build.build_lib = sys.argv[1]
build.ensure_finalized()
build.translation = SimpleNamespace(key=lambda name: "1")
extension = build.extensions[0]
built = Path(build.get_ext_fullpath(extension.name))
made = Path(sys.argv[1], "made")
made.mkdir(parents=True)
(made / built.name).write_bytes(b"of an earlier commit")
os.utime(made / built.name, (1, 1))
store.keep(extension.name, "1", made)
build.build_extension(extension)
print(built.read_bytes().decode(), built.stat().st_mtime > 1)
"""


def test_a_module_from_the_store_replaces_a_newer_one_beside_its_source(tmp_path: Path) -> None:
    """Setuptools copies into the sources what is newer: a kept module counts as made now."""
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    done = python(KEPT, tmp_path / "lib", cwd=ROOT, env=environment)
    assert done.stdout.splitlines()[-1] == "of an earlier commit True"


def test_version_reports_which_laws_run() -> None:
    done = ended(sys.executable, "-m", "control_board_ros.node.main", "--version")
    version, laws, physics = done.stdout.splitlines()
    assert version == f"control_board_ros {control_board_ros.__version__}"
    assert laws == f"laws: {compiled.describe()}"
    assert physics == f"physics: {DEFAULT_PHYSICS}"

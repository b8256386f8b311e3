# SPDX-License-Identifier: Apache-2.0
"""Builds the interface packages: ours, and those that the ROS 2 at hand lacks; used by setup.py.

Each is an ordinary ament_cmake package. CMake installs it into a folder of its own (a stage),
which is kept by its content (store.py) and handed to setuptools as data files.
"""

from __future__ import annotations

import contextlib
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
from functools import cache
from importlib import metadata
from pathlib import Path

import store

ROOT = Path(__file__).resolve().parents[1]
PROJECT = "control_board_ros"
MESSAGES = "control_board_msgs"
MSG_DEFS = ROOT / "msg_defs"
#: Interface packages of others, by name: built only where there is none.
VENDORED = {path.parent.name: path.parent for path in sorted(ROOT.glob("vendor/*/package.xml"))}
PYTHON_DIR = f"lib/python{sys.version_info[0]}.{sys.version_info[1]}/site-packages"
#: What CMake is told beside folders, and included files: a change of these builds them anew.
SETTINGS = {
    "BUILD_TESTING": "OFF",
    "PYTHON_INSTALL_DIR": PYTHON_DIR,
    # Libraries find each other, and Python modules find the libraries, wherever installed.
    "CMAKE_INSTALL_RPATH": "$ORIGIN;$ORIGIN/../../..",
}
INCLUDED = ROOT / "tools" / "msg_defs.cmake"
GENERATOR = ROOT / "tools" / "rosidl_generator.py"
#: What in the environment changes what a compiler makes.
FLAGS = ("CC", "CXX", "CFLAGS", "CXXFLAGS", "LDFLAGS")

#: Of CMake's output, where it fails.
LAST_LINES = 60

# What one machine's build leaves behind and no other has a use for.
UNWANTED_DIRS = {"environment", "__pycache__", "parent_prefix_path"}
UNWANTED_SUFFIXES = (".pyc", ".egg-info")


def sourced_prefixes() -> list[Path]:
    """The prefixes of sourced setup files; without an earlier install of this very project."""
    entries = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    prefixes = [Path(entry) for entry in entries if entry]
    return [path for path in prefixes if not (path / "share" / PROJECT).is_dir() or has_ros(path)]


def has_ros(prefix: Path) -> bool:
    return (prefix / "share/std_msgs").is_dir()


def is_sourced() -> bool:
    """Whether setup files of a ROS 2 are sourced."""
    return any(map(has_ros, sourced_prefixes()))


def ros_prefixes() -> list[Path]:
    """Folders that hold ROS 2: those of sourced setup files, else where the ROS wheels are.

    `sys.prefix` is of no use: pip and uv build in an environment apart, and colcon sets it.
    """
    prefixes = sourced_prefixes()
    if not is_sourced():
        sites = [Path(entry).resolve() for entry in sys.path if entry]
        prefixes += [site.parents[2] for site in sites if (site / "rosidl_generator_py").is_dir()]
    prefixes = list(dict.fromkeys(path for path in prefixes if path.is_dir()))
    if not any(map(has_ros, prefixes)):
        raise SystemExit(
            "ROS 2 not found: AMENT_PREFIX_PATH names no folder with std_msgs, and "
            "rosidl_generator_py is not importable; source /opt/ros/jazzy/setup.sh, or build "
            "with pip's isolation (pip install . without --no-build-isolation)"
        )
    return prefixes


def definitions_to_build(prefixes: list[Path]) -> dict[str, Path]:
    """The interface packages to build, by name: ours, and those that no prefix has."""

    def is_there(name: str) -> bool:
        files = [prefix / "share" / name / "package.xml" for prefix in prefixes]
        # An earlier install of this project has its own; the next one replaces it.
        return any(PROJECT not in file.read_text("utf-8") for file in files if file.is_file())

    # In the layout of a release (tools/release_layout.py) it is a package beside this one.
    ours = {MESSAGES: MSG_DEFS} if MSG_DEFS.is_dir() else {}
    return ours | {name: folder for name, folder in VENDORED.items() if not is_there(name)}


def require_tools() -> None:
    """Stop with one line that names the packages, where a build tool is missing."""
    packages = {"cmake": "cmake", "c++": "g++", "make": "make"}
    chosen = {"c++": os.environ.get("CXX", "c++").split()[0]}
    missing = [packages[tool] for tool in packages if shutil.which(chosen.get(tool, tool)) is None]
    if missing:
        raise SystemExit(
            f"cannot build the messages without {', '.join(missing)}: "
            f"install them, e.g. sudo apt-get install {' '.join(missing)}"
        )


def build_environment(prefixes: list[Path]) -> dict[str, str]:
    """The environment of CMake: the ROS prefixes, and no interpreter tricks of colcon."""
    environment = dict(os.environ)
    joined = os.pathsep.join(str(prefix) for prefix in prefixes)
    environment["AMENT_PREFIX_PATH"] = joined
    known = environment.get("CMAKE_PREFIX_PATH", "")
    environment["CMAKE_PREFIX_PATH"] = joined + (os.pathsep + known if known else "")
    python_path = environment.get("PYTHONPATH", "").split(os.pathsep)
    kept = [entry for entry in python_path if entry and "prefix_override" not in entry]
    environment["PYTHONPATH"] = os.pathsep.join(kept)
    environment["PYTHONHASHSEED"] = "0"  # the generators write sets: the same text each time
    return environment


@cache
def toolchain() -> list[str]:
    """What compiled code depends on beside its source: Python, the machine, compilers, flags."""
    versions = []
    for name, otherwise in (("CC", "cc"), ("CXX", "c++")):
        command = [*os.environ.get(name, otherwise).split(), "--version"]
        if shutil.which(command[0]):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            versions += done.stdout.splitlines()[:1]
    flags = [os.environ.get(name, "") for name in FLAGS]
    return [sys.version, platform.machine(), *platform.libc_ver(), *versions, *flags]


def packages_used(definitions: Path, prefixes: list[Path]) -> list[Path]:
    """The package.xml of everything that a package of definitions depends on, near and far."""
    found: dict[str, Path] = {}
    left = [definitions / "package.xml"]
    while left:
        text = left.pop().read_text("utf-8")
        for name in re.findall(r"<\w*depend[^>]*>\s*(\w+)\s*</", text):
            there = (prefix / "share" / name / "package.xml" for prefix in prefixes)
            path = next((path for path in there if path.is_file()), None)
            if path is not None and name not in found:
                found[name] = path
                left.append(path)
    return [found[name] for name in sorted(found)]


def made_of(definitions: Path, prefixes: list[Path], *, python_only: bool) -> str:
    """What a build of messages depends on, as a hash: not on where pip keeps the build tools.

    pip has a new folder of them for each build in isolation, and CMake's cache is of no use there.
    """
    inside = sorted(path for path in definitions.rglob("*") if path.is_file())
    # C++ users get CMake's files, which may name the prefixes.
    scope = ["Python"] if python_only else ["all", *map(str, prefixes)]
    numpy = metadata.version("numpy").split(".")[0]
    used = packages_used(definitions, prefixes)
    recipe = [*SETTINGS.values(), INCLUDED, GENERATOR]
    return store.key([*toolchain(), *scope, numpy, *recipe, *inside, *used])


class Package:
    """One interface package and its build folder."""

    def __init__(
        self, name: str, definitions: Path, builds: Path, prefixes: list[Path], python_only: bool
    ) -> None:
        self.name = name
        self.definitions = definitions
        self.python_only = python_only
        self.work = builds / f"{name}-{sys.implementation.cache_tag}"
        self.stage = self.work / "stage"
        self.log = self.work / "cmake.log"
        #: Which setup CMake's cache belongs to; there from the end of a build to the next one.
        self.stamp = self.work / "built-for.txt"
        self.key = made_of(definitions, prefixes, python_only=python_only)

    def begin(self, prefixes: list[Path]) -> None:
        """Write the build script; anew where the folder is another setup's, or half made."""
        parts = [sys.executable, str(self.definitions), str(self.python_only), *toolchain()]
        setup = "\n".join([*parts, *map(str, prefixes)])
        if self.work.exists() and not (self.stamp.is_file() and self.stamp.read_text() == setup):
            shutil.rmtree(self.work)
        self.work.mkdir(parents=True, exist_ok=True)
        # Files of a message that is gone would be installed for ever.
        shutil.rmtree(self.stage, ignore_errors=True)
        self.stamp.unlink(missing_ok=True)
        (self.work / "building-for.txt").write_text(setup)
        self.log.write_text("")
        configure = ["cmake", "-G", "Unix Makefiles", "-S", self.definitions, "-B", "build"]
        configure += [f"-D{key}={value}" for key, value in self.settings().items()]
        lines = [
            "set -e",
            f"cd {shlex.quote(str(self.work))}",
            "exec >cmake.log 2>&1",  # hundreds of lines, most of them about the files of ROS
            shlex.join(map(str, configure)),
            '"$1" -C build install',
            "mv building-for.txt built-for.txt",
        ]
        (self.work / "build.sh").write_text("\n".join([*lines, ""]))

    def settings(self) -> dict[str, str | Path]:
        """What CMake is told."""
        return {
            **SETTINGS,
            "CMAKE_INSTALL_PREFIX": self.stage,
            "Python3_EXECUTABLE": sys.executable,
            "PYTHON_EXECUTABLE": sys.executable,
            "CMAKE_PROJECT_INCLUDE": INCLUDED,
            "FOR_PYTHON_ONLY": "ON" if self.python_only else "OFF",
        }

    def percent(self) -> int:
        """How much of it is built, as make reports."""
        steps = re.findall(r"^\[ *(\d+)%\]", self.log.read_text("utf-8", "replace"), re.MULTILINE)
        return max(map(int, steps), default=0)

    def keep(self) -> None:
        """Put what was built into the store.

        Raises:
            SystemExit: It was not; with the last lines of the log.
        """
        if not self.stamp.is_file():
            last = self.log.read_text("utf-8", "replace").splitlines()[-LAST_LINES:]
            raise SystemExit("\n".join([*last, f"building {self.name} failed; log: {self.log}"]))
        if self.python_only:
            for unused in (self.stage / "include", *self.stage.glob("share/*/cmake")):
                shutil.rmtree(unused, ignore_errors=True)
        store.keep(self.name, self.key, self.stage)


def build_interfaces(builds: Path, jobs: int, *, python_only: bool) -> list[Path]:
    """Build the interface packages that are not kept: all at once, within the jobs.

    Args:
        builds: Folder of the build folders.
        jobs: Processes at a time.
        python_only: What rclpy with Fast DDS uses, without C++ and headers.

    Returns:
        The stage of each package.
    """
    prefixes = ros_prefixes()
    packages = [
        Package(name, definitions, builds, prefixes, python_only)
        for name, definitions in definitions_to_build(prefixes).items()
    ]
    missing = [package for package in packages if store.find(package.name, package.key) is None]
    if missing:
        require_tools()
        for package in missing:
            package.begin(prefixes)
        run_make(builds, jobs, missing, build_environment(prefixes))
        for package in missing:
            package.keep()
    stages = [store.find(package.name, package.key) for package in packages]
    return [stage for stage in stages if stage is not None]


def run_make(
    builds: Path, jobs: int, packages: list[Package], environment: dict[str, str]
) -> None:
    """Run the build scripts by one `make`, whose job server those of CMake share."""
    names = " ".join(package.name for package in packages)
    rules = [f".PHONY: all {names}", f"all: {names}"]
    for package in packages:
        rules += [f"{package.name}:", f"\t+@sh {package.work.name}/build.sh '$(MAKE)'"]
    makefile = builds / f"interfaces-{sys.implementation.cache_tag}.mk"
    makefile.write_text("\n".join([*rules, ""]))
    for name in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS"):
        environment.pop(name, None)  # of `make setup`, whose job server is not handed down
    sizes = [1 + len(list(package.definitions.glob("*/*"))) for package in packages]
    said = -1
    command = ["make", "-s", "-f", makefile.name, f"-j{jobs}"]
    with subprocess.Popen(command, cwd=builds, env=environment) as made:
        while made.poll() is None:
            done = [p.percent() * size for p, size in zip(packages, sizes, strict=True)]
            if (percent := round(sum(done) / sum(sizes))) > said:
                print(f"messages {percent} %", flush=True)
                said = percent
            with contextlib.suppress(subprocess.TimeoutExpired):
                made.wait(1.0)


def installed_files(stage: Path) -> list[tuple[str, list[str]]]:
    """A stage as data files: pairs of a folder under the prefix and its files."""
    found: dict[str, list[str]] = {}
    for path in sorted(stage.rglob("*")):
        relative = path.relative_to(stage)
        unwanted = (
            UNWANTED_DIRS & set(relative.parts)
            or any(part.endswith(UNWANTED_SUFFIXES) for part in relative.parts)
            or relative.name.startswith("local_setup.")
        )
        if path.is_file() and not unwanted:
            found.setdefault(str(relative.parent), []).append(os.path.relpath(path))
    return list(found.items())

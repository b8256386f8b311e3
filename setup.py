# SPDX-License-Identifier: Apache-2.0
"""The one build of the project, for pip, editable installs, uv and colcon.

The package is plain Python with two exceptions, both in `build_ext`. `msg_defs/` is an ament_cmake
package of interfaces: CMake builds it into a staging folder, and what came out goes to setuptools
as data files, so that every way of installing Python installs the messages too. So are those of
`vendor/`, parts of packages that the ROS wheels lack, where the ROS 2 at hand has none of that
name. The modules of COMPILED are compiled by Cython where that is possible, beside their source.
"""

from __future__ import annotations

import hashlib
import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.dist import Distribution

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "tools"))
from compile_modules import extension, say_uncompiled, translate  # noqa: E402

NAME = "control_board_ros"
MESSAGES = "control_board_msgs"
MSG_DEFS = HERE / "msg_defs"
#: Interface packages of others, by name: built only where there is none.
VENDORED = {path.parent.name: path.parent for path in sorted(HERE.glob("vendor/*/package.xml"))}
#: Plain Python in Cython's pure mode; runs as it is where it cannot be compiled.
COMPILED = runpy.run_path(str(HERE / NAME / "compiled.py"))["MODULES"]
#: Executables, and what they call.
COMMANDS = {
    "control_board": f"{NAME}.node.main:main",
    "cbctl": f"{NAME}.cli:main",
    "control_board_conformance": f"{NAME}.conformance.app:main",
}
#: Where shells look for executables, and where `ros2 run` does.
BIN, LIB = "bin", f"lib/{NAME}"
PYTHON_DIR = f"lib/python{sys.version_info[0]}.{sys.version_info[1]}/site-packages"

# Another version, or an unpinned name, can belong to another ROS distribution.
ROS_WHEELS = [
    "ros-jazzy-rclpy[fastrtps]==7.1.6",
    "ros-rosidl-default-runtime==1.6.0",
    "ros-action-msgs==2.0.3",
    "ros-builtin-interfaces==2.0.3",
    "ros-diagnostic-msgs==5.3.6",
    "ros-geometry-msgs==5.3.6",
    "ros-lifecycle-msgs==2.0.3",
    "ros-rcl-interfaces==2.0.3",
    "ros-rosgraph-msgs==2.0.3",
    "ros-sensor-msgs==5.3.6",
    "ros-std-msgs==5.3.6",
    "ros-std-srvs==5.3.6",
    "ros-trajectory-msgs==5.3.6",
    "ros-unique-identifier-msgs==2.5.0",
    "setuptools",
]

#: Of CMake's output, where it fails.
LAST_LINES = 60

# What one machine's build leaves behind and no other has a use for.
UNWANTED_DIRS = {"environment", "__pycache__", "parent_prefix_path"}
UNWANTED_SUFFIXES = (".pyc", ".egg-info")


def sourced_prefixes() -> list[Path]:
    """The prefixes of sourced setup files; without an earlier install of this very project."""
    entries = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    prefixes = [Path(entry) for entry in entries if entry]
    return [path for path in prefixes if not (path / "share" / NAME).is_dir() or has_ros(path)]


def has_ros(prefix: Path) -> bool:
    return (prefix / "share/std_msgs").is_dir()


def ros_prefixes() -> list[Path]:
    """Folders that hold ROS 2: those of sourced setup files, else where the ROS wheels are.

    `sys.prefix` is of no use: pip and uv build in an environment apart, and colcon sets it.
    """
    prefixes = sourced_prefixes()
    if not any(map(has_ros, prefixes)):
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
        return any(NAME not in file.read_text("utf-8") for file in files if file.is_file())

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
    return environment


def fresh_folder(work: Path, definitions: Path, prefixes: list[Path]) -> None:
    """Make the work folder; begin anew where CMake's cache would belong to another setup."""
    compilers = [os.environ.get(name, "") for name in ("CC", "CXX", "CFLAGS", "CXXFLAGS")]
    parts = [sys.executable, sys.version, str(definitions), *compilers, *map(str, prefixes)]
    key = "\n".join(parts)
    stamp = work / "built-for.txt"
    if work.exists() and not (stamp.is_file() and stamp.read_text() == key):
        shutil.rmtree(work)
    work.mkdir(parents=True, exist_ok=True)
    stamp.write_text(key)


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


def made_of(definitions: Path, prefixes: list[Path]) -> str:
    """What a build of messages depends on, as a hash: not on where pip keeps the build tools.

    pip has a new folder of them for each build in isolation, and CMake's cache is of no use there.
    """
    inside = sorted(path for path in definitions.rglob("*") if path.is_file())
    compilers = [os.environ.get(name, "") for name in ("CC", "CXX", "CFLAGS", "CXXFLAGS")]
    found = hashlib.sha256("\n".join([sys.version, *compilers]).encode())
    for path in [
        *inside,
        HERE / "tools" / "msg_defs.cmake",
        *packages_used(definitions, prefixes),
    ]:
        found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()


def build_messages(definitions: Path, work: Path, prefixes: list[Path], jobs: int) -> Path:
    """Build one interface package in the work folder, unless it is there; return its tree."""
    build, stage = work / "build", work / "stage"
    key, built = made_of(definitions, prefixes), work / "made-of.txt"
    if stage.is_dir() and built.is_file() and built.read_text() == key:
        return stage
    built.unlink(missing_ok=True)
    fresh_folder(work, definitions, prefixes)
    if stage.exists():
        shutil.rmtree(stage)  # or files of a message that is gone would be installed for ever
    settings = {
        "CMAKE_INSTALL_PREFIX": stage,
        "BUILD_TESTING": "OFF",
        "Python3_EXECUTABLE": sys.executable,
        "PYTHON_EXECUTABLE": sys.executable,
        "PYTHON_INSTALL_DIR": PYTHON_DIR,
        # Libraries find each other, and Python modules find the libraries, wherever installed.
        "CMAKE_INSTALL_RPATH": "$ORIGIN;$ORIGIN/../../..",
        "CMAKE_PROJECT_INCLUDE": HERE / "tools" / "msg_defs.cmake",
    }
    environment = build_environment(prefixes)
    arguments = [f"-D{key}={value}" for key, value in settings.items()]
    log = work / "cmake.log"  # hundreds of lines, most of them warnings about the files of ROS
    with log.open("w", encoding="utf-8") as written:
        for command in (
            ["cmake", "-S", str(definitions), "-B", str(build), *arguments],
            ["cmake", "--build", str(build), "--target", "install", "--parallel", str(jobs)],
        ):
            done = subprocess.run(
                command, env=environment, stdout=written, stderr=subprocess.STDOUT, check=False
            )
            if done.returncode != 0:
                last = log.read_text("utf-8", "replace").splitlines()[-LAST_LINES:]
                raise SystemExit(
                    "\n".join([*last, f"building the messages failed; the whole log: {log}"])
                )
    built.write_text(key)
    return stage


def staged_files(stage: Path) -> list[tuple[str, list[str]]]:
    """The staged tree as data files: pairs of a folder under the prefix and its files."""
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


def links(folder: Path, others: str) -> list[str]:
    """Write executables that run those of the same names in another folder.

    pip puts executables where shells look, colcon (setup.cfg) where `ros2 run` does; these make
    them be found in the other place, too.

    Args:
        folder: Where to write them.
        others: The folder of the executables, as seen from where these get installed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name in COMMANDS:
        path = folder / name
        path.write_text(f"""#!/bin/sh
exec "$(dirname "$(readlink -f "$0")")/{others}/{name}" "$@"
""")
        path.chmod(0o755)
        written.append(os.path.relpath(path))
    return written


class Build(build_ext):
    """`build_ext`: the messages, the modules of COMPILED, and links to the executables."""

    def run(self) -> None:
        jobs = int(self.parallel or os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL") or 0)
        # An editable install's own folders are gone afterwards, and the one above is everybody's.
        builds = HERE / "build" if self.editable_mode else Path(self.build_temp).resolve().parent
        known = self.distribution.data_files  # in place: install_data already holds this list
        kept = (f"share/{NAME}", "resource_index")
        known[:] = [pair for pair in known if any(part in pair[0] for part in kept)]
        by_pip = {"bdist_wheel", "editable_wheel"} & set(self.distribution.commands)
        place, others = (LIB, f"../../{BIN}") if by_pip else (BIN, f"../{LIB}")
        known.append((place, links(builds / "executables", others)))
        prefixes = ros_prefixes()
        if definitions_to_build(prefixes):
            require_tools()
        for name, definitions in definitions_to_build(prefixes).items():
            work = builds / f"{name}-{sys.implementation.cache_tag}"
            stage = build_messages(definitions, work, prefixes, jobs or os.cpu_count() or 1)
            known.extend(staged_files(stage))
        super().run()

    def build_extension(self, ext: Extension) -> None:
        """Compile one module; where that fails, the module stays Python and the build goes on."""
        Path(self.get_ext_fullpath(ext.name)).unlink(missing_ok=True)  # of an older source
        try:
            ext.sources = [str(translate(ext.name, HERE / ext.sources[0], Path(self.build_temp)))]
            super().build_extension(ext)
        except Exception as error:  # noqa: BLE001 - whatever is wrong, the module runs as it is
            say_uncompiled(ext.name, error)

    def get_outputs(self) -> list[str]:
        return [path for path in super().get_outputs() if Path(path).exists()]

    def get_output_mapping(self) -> dict[str, str]:
        mapping = super().get_output_mapping()
        return {built: path for built, path in mapping.items() if Path(built).exists()}

    def get_source_files(self) -> list[str]:
        folders = [MSG_DEFS, *VENDORED.values()]
        files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
        return sorted(os.path.relpath(path, HERE) for path in [*files, *HERE.glob("tools/*")])


class DistributionWithMessages(Distribution):
    """Says that there is something to compile and something to install beside the package."""

    def parse_config_files(self, *args: Any, **kwargs: Any) -> None:
        super().parse_config_files(*args, **kwargs)
        # colcon reads the attributes back from their repr(); that of a SpecifierSet is no Python.
        if self.python_requires is not None:
            self.python_requires = str(self.python_requires)
            self.metadata.python_requires = self.python_requires

    def has_ext_modules(self) -> bool:
        return True

    def has_data(self) -> bool:
        # Asked by editable installs only, which drop every data file without it.
        return True


def version() -> str:
    text = (HERE / NAME / "__init__.py").read_text(encoding="utf-8")
    found = re.search(r'^__version__ = "([^"]+)"$', text, re.MULTILINE)
    if found is None:
        raise SystemExit(f"no __version__ in {NAME}/__init__.py")
    return found.group(1)


PYBULLET = ["pybullet>=3.2.6"]
MUJOCO = ["mujoco-core>=4"]
# pybullet has no wheel for Python from 3.12 on, and is compiled for minutes: there it is an extra.
ENGINES = [
    *(f'{name}; python_version < "3.12"' for name in PYBULLET),
    *(f'{name}; python_version >= "3.12"' for name in MUJOCO),
]


def runtime_requirements() -> list[str]:
    """What pip installs; a sourced ROS 2 brings its own packages, which pip does not know."""
    plain = [
        "numpy>=1.26",
        "prompt_toolkit>=3.0",
        *ENGINES,
        "pyyaml>=6.0",
        "rich>=13.0",
    ]
    return plain if any(map(has_ros, sourced_prefixes())) else plain + ROS_WHEELS


XACRO = ["xacro>=2.1"]
PANEL = ["starlette>=1.0", "uvicorn>=0.50", "websockets>=15"]
RECORD = ["matplotlib>=3.8", "rosbags>=0.11"]
TUNE = ["optuna>=5.0"]
IDENTIFY = [*RECORD, "scipy>=1.11"]
TUNE_POSTGRESQL = [*TUNE, "psycopg[binary]>=3.2"]
TUNE_GRPC = [*TUNE, "grpcio>=1.68", "protobuf>=5.28"]
#: Drivers of motors, each with what its maker or its field offers.
MOTEUS = ["moteus>=1.1", "python-can>=4.3"]
DYNAMIXEL = ["dynamixel-sdk>=4.0"]
MIT_CAN = ["python-can>=4.3"]
CIA402 = ["canopen>=2.3", "python-can>=4.3"]
ODRIVE_CAN = ["python-can>=4.3"]
FEETECH = ["feetech-servo-sdk>=1.0", "pyserial>=3.5"]
DRIVES = [*MOTEUS, *DYNAMIXEL, *MIT_CAN, *CIA402, *ODRIVE_CAN, *FEETECH]
TEST = [
    "axe-playwright-python>=0.1.8",
    "control>=0.10",
    "hypothesis>=6.100",
    "matplotlib>=3.8",
    "msgpack>=1.0",
    "playwright>=1.50",
    "pytest>=8.2",
    "pytest-timeout>=2.3",
    "pytest-xdist>=3.6",
    *MUJOCO,
    *XACRO,
    "foxglove-sdk>=0.16",
    "gymnasium>=1.0",
    "pygame>=2.5",
    *PANEL,
    *RECORD,
    *IDENTIFY,
    *TUNE_POSTGRESQL,
    *TUNE_GRPC,
    *DRIVES,
]
GYM = ["gymnasium>=1.0", "pygame>=2.5", *MUJOCO]
FOXGLOVE = ["foxglove-sdk>=0.16"]
ICUB = ["icub-models==3.2.0"]
BENCH = ["pin>=3.0"]
SITE = ["furo>=2024.8", "myst-parser>=4", "sphinx>=8"]
DEV = [
    "import-linter>=2.1",
    "matplotlib>=3.8",
    "mypy>=1.13",
    "pip-audit>=2.7",
    "pre-commit>=4.0",
    "py-spy>=0.4",
    "ruff>=0.9",
    "types-PyYAML",
]

setup(
    name=NAME,
    version=version(),
    description="A robot joint control board with YARP/iCub control modes, as a ROS 2 node "
    "with a simulated arm",
    license="Apache-2.0",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={
        NAME: ["py.typed", "discovery.xml", "description/shipped/*.urdf"],
        f"{NAME}.recording": ["report.css", "report.js"],
        f"{NAME}.panel": ["page/*", "page/vendor/*", "page/vendor/loaders/*"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (
            f"share/{NAME}/config",
            sorted(
                os.path.relpath(path, HERE)
                for pattern in ("*.yaml", "*.xml")
                for path in (HERE / "config").glob(pattern)
            ),
        ),
        *(
            (
                f"share/{NAME}/{folder.relative_to(HERE)}",
                sorted(os.path.relpath(path, HERE) for path in folder.glob("*.yaml")),
            )
            for folder in sorted((HERE / "config/moveit").iterdir())
        ),
        (
            f"share/{NAME}/config/ros2_control",
            sorted(os.path.relpath(path, HERE) for path in HERE.glob("config/ros2_control/*")),
        ),
        (f"share/{NAME}/config/rviz", ["config/rviz/control_board.rviz"]),
        (f"share/{NAME}/config/foxglove", ["config/foxglove/control_board.json"]),
        (f"share/{NAME}/launch", ["launch/control_board.launch.py"]),
    ],
    install_requires=runtime_requirements(),
    extras_require={
        "test": TEST,
        "icub": ICUB,
        "xacro": XACRO,
        "mujoco": MUJOCO,
        "pybullet": PYBULLET,
        "panel": PANEL,
        "record": RECORD,
        "tune": TUNE,
        "identify": IDENTIFY,
        "gym": GYM,
        "foxglove": FOXGLOVE,
        "tune-postgresql": TUNE_POSTGRESQL,
        "tune-grpc": TUNE_GRPC,
        "moteus": MOTEUS,
        "dynamixel": DYNAMIXEL,
        "mit_can": MIT_CAN,
        "cia402": CIA402,
        "odrive_can": ODRIVE_CAN,
        "feetech": FEETECH,
        "bench": BENCH,
        "site": SITE,
        "dev": DEV,
    },
    entry_points={
        "console_scripts": [f"{command} = {called}" for command, called in COMMANDS.items()],
    },
    ext_modules=[extension(HERE, module) for module in COMPILED],
    cmdclass={"build_ext": Build},
    distclass=DistributionWithMessages,
    zip_safe=False,
)

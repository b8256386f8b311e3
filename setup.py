# SPDX-License-Identifier: Apache-2.0
"""The one build of the project, for pip, editable installs, uv and colcon.

The package is plain Python with two exceptions, both in `build_ext`. `msg_defs/` is an ament_cmake
package of interfaces: CMake builds it (tools/interfaces.py), and what came out goes to setuptools
as data files, so that every way of installing Python installs the messages too. So are those of
`vendor/`, parts of packages that the ROS wheels lack, where the ROS 2 at hand has none of that
name. The modules that compiled.py names are compiled by Cython where that is possible, beside
their sources. What is built is kept by its content (tools/store.py), and not built again.
"""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.dist import Distribution

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "tools"))
import store  # noqa: E402
from compile_modules import Translation, extension, say_uncompiled  # noqa: E402
from interfaces import (  # noqa: E402
    MSG_DEFS,
    VENDORED,
    build_interfaces,
    installed_files,
    is_sourced,
)
from interfaces import PROJECT as NAME  # noqa: E402

#: Plain Python in Cython's pure mode; runs as it is where it cannot be compiled.
COMPILED = runpy.run_path(str(HERE / NAME / "compiled.py"))
MODULES: tuple[str, ...] = COMPILED["MODULES"]
#: Executables, and what they call.
COMMANDS = {
    "control_board": f"{NAME}.node:start",
    "cbctl": f"{NAME}.cli:main",
    "control_board_conformance": f"{NAME}.conformance.app:main",
}
#: Where shells look for executables, and where `ros2 run` does.
BIN, LIB = "bin", f"lib/{NAME}"

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
    """`build_ext`: the messages, the modules of MODULES, and links to the executables."""

    def run(self) -> None:
        level = self.parallel or os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL")
        jobs = int(level or os.cpu_count() or 1)
        # An editable install's own folders are gone afterwards, and the one above is everybody's.
        here = self.editable_mode or self.inplace
        builds = HERE / "build" if here else Path(self.build_temp).resolve().parent
        known = self.distribution.data_files  # in place: install_data already holds this list
        kept = (f"share/{NAME}", "resource_index")
        known[:] = [pair for pair in known if any(part in pair[0] for part in kept)]
        commands = self.distribution.commands
        by_pip = {"bdist_wheel", "editable_wheel"} & {*commands} or commands == ["build_ext"]
        place, others = (LIB, f"../../{BIN}") if by_pip else (BIN, f"../{LIB}")
        known.append((place, links(builds / "executables", others)))
        # C++ programs, rosbag2 and other middlewares come with a ROS 2 that is sourced.
        python_only = bool(by_pip) and not is_sourced()
        with ThreadPoolExecutor(1) as beside:
            stages = beside.submit(build_interfaces, builds, jobs, python_only=python_only)
            super().run()
        for stage in stages.result():
            known.extend(installed_files(stage))

    def build_extensions(self) -> None:
        """Compile MODULES, and record what they are made from; all of them, or none."""
        self.translation = Translation(HERE, MODULES)
        super().build_extensions()
        built = [Path(self.get_ext_fullpath(name)) for name in MODULES]
        if all(path.exists() for path in built):
            self.record.write_text(
                json.dumps(self.translation.digests(COMPILED["digest"]), indent=1)
            )
        else:
            for path in [*built, self.record]:
                path.unlink(missing_ok=True)

    @property
    def record(self) -> Path:
        """The record of what is compiled, where it is built."""
        return Path(self.build_lib, NAME, COMPILED["RECORD"])

    def copy_extensions_to_source(self) -> None:
        super().copy_extensions_to_source()
        if self.record.exists():
            shutil.copy2(self.record, HERE / NAME)

    def build_extension(self, ext: Extension) -> None:
        """Compile one module; where that fails, the modules stay Python and the build goes on."""
        built = Path(self.get_ext_fullpath(ext.name))
        built.unlink(missing_ok=True)  # of an older source
        names = [one.name for one in self.extensions]
        print(f"laws {names.index(ext.name) + 1} of {len(names)}", flush=True)  # noqa: T201 - set_up.py shows it
        try:
            key = self.translation.key(ext.name)
            kept = store.find(ext.name, key)
            if kept is None:
                work = Path(self.build_temp)
                ext.sources = [str(self.translation.translate(ext.name, work))]
                super().build_extension(ext)
                made = work / "made" / ext.name
                made.mkdir(parents=True, exist_ok=True)
                shutil.copy2(built, made)
                store.keep(ext.name, key, made)
            else:
                built.parent.mkdir(parents=True, exist_ok=True)
                # made now: over a newer one in the sources setuptools copies no older one
                shutil.copy(kept / built.name, built)
        except Exception as error:  # noqa: BLE001 - whatever is wrong, the module runs as it is
            say_uncompiled(ext.name, error)

    def get_outputs(self) -> list[str]:
        outputs = [*super().get_outputs(), str(self.record)]
        return [path for path in outputs if Path(path).exists()]

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
    return plain if is_sourced() else plain + ROS_WHEELS


XACRO = ["xacro>=2.1"]
PANEL = ["starlette>=1.0", "uvicorn>=0.50", "websockets>=15"]
RECORD = ["matplotlib>=3.8", "rosbags>=0.11"]
TUNE = ["optuna>=5.0"]
IDENTIFY = [*RECORD, "scipy>=1.11"]
TUNE_POSTGRESQL = [*TUNE, "psycopg[binary]>=3.2"]
TUNE_GRPC = [*TUNE, "grpcio>=1.68", "protobuf>=5.28"]
#: Drivers of motors, each with what its maker or its field offers.
MOTEUS = ["moteus>=1.1", "python-can>=4.3"]
DYNAMIXEL = ["dynamixel-sdk>=3.8"]  # LeRobot wants less than 3.9
MIT_CAN = ["python-can>=4.3"]
CIA402 = ["canopen>=2.3", "python-can>=4.3"]
ODRIVE_CAN = ["python-can>=4.3"]
FEETECH = ["feetech-servo-sdk>=1.0", "pyserial>=3.5"]
DRIVES = [*MOTEUS, *DYNAMIXEL, *MIT_CAN, *CIA402, *ODRIVE_CAN, *FEETECH]
#: Clients of others, which operate the virtual drives (test/judged).
JUDGES = [
    "damiao-motor>=1.0",
    "durand>=0.5",
    "dynamixel-python>=0.0.8",
    "feetech-cli>=0.1.8",
    "motorbridge==0.5.6",
    "odrive-can>=2.1",
    "robstride-dynamics>=0.0.1",
    "st3215-bus>=0.1.1",
]
TEST = [
    *JUDGES,
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
    'oxlint==1.89.0; sys_platform == "linux" and platform_machine == "x86_64"',
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
    ext_modules=[extension(HERE, module) for module in MODULES],
    cmdclass={"build_ext": Build},
    distclass=DistributionWithMessages,
    zip_safe=False,
)

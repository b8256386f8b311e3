# SPDX-License-Identifier: Apache-2.0
"""The command line, and what a start needs: settings, the lock of the name, the plant.

The files and ``-p`` arguments are read here and not by rcl, which is silent about unknown
names and answers a broken file with a traceback; rclpy gets the rest of the arguments.
"""

from __future__ import annotations

import fcntl
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rclpy.parameter import Parameter as RosParameter

from ...core.terms.measurement import Plant
from ...plants.errors import PlantSettingsError
from ...settings.loading import Settings, load_layers
from ...settings.params_file import Entry, Layer, SettingsError, parse_value, read_file, shown
from ...settings.parts import ROBOT
from ...settings.schema import VIRTUAL
from ...sim.plant import SimulatedPlant
from .console import KnownError, temporary_folder

NODE = "control_board"
#: End of the reason of a silence where nothing but a process of ours can be silent.
TOO_SLOW = (
    "; virtual drives run in real time, and this process was stopped, or the computer is too slow "
    "for it: end other programs, or lower control_rate"
)

#: s that a start waits for the set-up of virtual drives: nothing but this computer delays it.
VIRTUAL_SET_UP = 60.0


@dataclass(frozen=True, slots=True)
class Start:
    """The settings and names that the command line selects.

    Attributes: settings, arguments (for ``rclpy.init``: the given ones without parameters),
    overrides (for ``Node(parameter_overrides=…)``: use_sim_time and qos_overrides), name and
    namespace of the node after remapping; of a robot of several parts, of the robot's own node.
    """

    settings: Settings
    arguments: list[str]
    overrides: list[RosParameter]
    name: str
    namespace: str

    @property
    def names(self) -> list[str]:
        """Names of all nodes: the parts', and last the whole robot's; or of the only one."""
        return [*self.settings.parts, self.name]


def settings_from_arguments(argv: Sequence[str]) -> Start:
    """Read ``--ros-args --params-file FILE -p name:=value -r __node:=name`` and load it all.

    Raises:
        SettingsError: one line: where, name, value, what is allowed, the next step.
    """
    options, rest = _split(argv)
    remapped, namespace, relative = NODE, "/", ""
    for option, value in options:
        if option == "remap":
            target, mark, new = value.partition(":=")
            owner, _, what = target.rpartition(":")
            if mark and owner in ("", NODE) and what in ("__node", "__name"):
                remapped = new
            elif mark and owner in ("", NODE) and what == "__ns":
                namespace = "/" + new.strip("/")
                relative = "" if new.startswith("/") else new
    full = f"{namespace.rstrip('/')}/{remapped}"
    layers = []
    for option, value in options:
        if option == "params-file":
            layers.append(_read(Path(value), full, f"{namespace.rstrip('/')}/{NODE}"))
        elif option == "param":
            layers.append(_argument(value, remapped, NODE))
    settings = load_layers(layers)
    overrides = [RosParameter(key, value=value) for key, value in settings.ros.items()]
    if settings.parts:  # a global rule would give all their nodes one name
        rest = without_names(rest)
        if remapped not in (NODE, ROBOT):
            warning = (
                f"-r __node:={remapped}: is not used; the nodes of a robot of several parts have "
                "the names of its parts, and robot_name is what they begin with"
            )
            settings = replace(settings, warnings=(*settings.warnings, warning))
        remapped = ROBOT
        if namespace.rpartition("/")[2] != settings.robot_name:
            namespace = f"{namespace.rstrip('/')}/{settings.robot_name}"
    elif relative:
        raise SettingsError(f"namespace {relative!r} is not allowed; write -r __ns:=/{relative}")
    return Start(settings, rest, overrides, remapped, namespace)


def without_names(arguments: Sequence[str]) -> list[str]:
    """Arguments without the rules that rename nodes."""
    rest: list[str] = []
    for argument in arguments:
        what = argument.partition(":=")[0].rpartition(":")[2]
        if rest and rest[-1] in ("-r", "--remap") and what in ("__node", "__name", "__ns"):
            rest.pop()
        else:
            rest.append(argument)
    return rest


def _split(argv: Sequence[str]) -> tuple[list[tuple[str, str]], list[str]]:
    """The ROS options read here, in order, and all arguments without parameters."""
    names = {"-p": "param", "--param": "param", "--params-file": "params-file"}
    names |= {"-r": "remap", "--remap": "remap"}
    options: list[tuple[str, str]] = []
    rest: list[str] = []
    inside = False
    arguments = iter(argv)
    for argument in arguments:
        if argument == "--ros-args":
            inside = True
        elif argument == "--":
            inside = False
        option = names.get(argument) if inside else None
        if option is None:
            rest.append(argument)
            continue
        value = next(arguments, None)
        if value is None:
            raise SettingsError(f"{argument}: has no value; see control_board --help")
        options.append((option, value))
        if option == "remap":
            rest += [argument, value]
    return options, rest


def _read(path: Path, full: str, before: str) -> Layer:
    """A parameter file's layer; sections may name the node as it is or before remapping."""
    try:
        return read_file(path, full)
    except SettingsError:
        if full == before:
            raise
    return read_file(path, before)


def _argument(text: str, *names: str) -> Layer:
    """The layer of one ``-p [node:]name:=value``."""
    target, mark, value = text.partition(":=")
    owner, _, name = target.rpartition(":")
    if not mark or not name:
        raise SettingsError(f"-p {shown(text)}: write -p name:=value")
    if owner.rsplit("/", 1)[-1] not in ("", *names):
        return Layer()
    where = f"-p {name}"
    parsed = parse_value(value, where)
    if parsed is None:
        raise SettingsError(f"{where}: has no value; write -p {name}:=value")
    return Layer({name: Entry(parsed, "-p")}, folder=Path.cwd())


def check_arguments(arguments: Sequence[str]) -> None:
    """Reject arguments outside of --ros-args, which ROS ignores silently."""
    among_ros = False
    for argument in arguments:
        if argument in {"--ros-args", "--"}:
            among_ros = argument == "--ros-args"
        elif not among_ros:
            raise KnownError(
                2,
                f"argument {argument!r} is not known; --help, --version and ROS arguments are, "
                "as in: control_board --ros-args -p robot:=panda",
            )


def check_name(name: str, namespace: str) -> None:
    """Reject invalid names in one line, before rcl rejects them in many."""
    word = r"[A-Za-z_][A-Za-z0-9_]*"
    if not re.fullmatch(word, name):
        raise KnownError(2, f"node name {name!r} is not allowed; letters, digits and _ are")
    if not re.fullmatch(rf"/|(/{word})+", namespace):
        raise KnownError(
            2, f"namespace {namespace!r} is not allowed; words after slashes are, as in /left/arm"
        )


def make_plant(start: Start) -> tuple[Start, Plant]:
    """The plant, and the start with settings within the plant's abilities (B2).

    Raises:
        PlantSettingsError: the plant is unknown, or does not fit the board.
        PlantError: the simulation cannot be made.
    """
    settings = start.settings
    if not (name := settings.values["plant"]):
        return start, SimulatedPlant(settings.board, settings.simulation)
    from ...plants.apart import PlantApart  # not for simulations
    from ...plants.entry_points import make
    from ...plants.guarded import FIRST_SAMPLE, GuardedPlant, patience
    from ...plants.interface import DrivePlant, RobotPlant
    from ...plants.offers import derived_gains, within

    joints, arguments = settings.board.names, settings.values["plant_arguments"]
    timeout = settings.values["plant_timeout"]
    theirs: RobotPlant | DrivePlant
    remark, first = "", FIRST_SAMPLE
    if name.startswith(VIRTUAL):
        remark, first = TOO_SLOW, VIRTUAL_SET_UP
        from ...plants.virtual.plant import make_virtual  # with the libraries of its driver

        theirs = make_virtual(name, settings, arguments)
    elif settings.values["plant_process"]:
        theirs = PlantApart(name, joints, arguments, patience(timeout, settings.board.period))
    else:
        theirs = make(name, joints, arguments)
    try:
        settings = within(settings, name, theirs.describe())
    except PlantSettingsError:
        theirs.close()
        raise
    derived = derived_gains(settings)
    plant = GuardedPlant(
        theirs, settings.board, timeout, first=first, remark=remark, derived=derived
    )
    return replace(start, settings=settings), plant


def runtime_folder() -> Path:
    """A folder of this user that lasts until the machine stops.

    Raises:
        OSError: it cannot be created, or belongs to another user.
    """
    xdg = os.environ.get("XDG_RUNTIME_DIR")
    base = Path(xdg) if xdg and os.access(xdg, os.W_OK) else temporary_folder()
    folder = base / f"control_board_ros-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.stat().st_uid != os.getuid() or folder.is_symlink():
        raise PermissionError(f"{folder} belongs to another user; remove it")
    return folder


def lock_name(full_name: str, domain: str, other: str = "-r __node:=name") -> Callable[[], None]:
    """Lock a node's full name on a ROS domain: two nodes of one name both execute every request.

    Returns:
        What releases the lock, if the process does not end before.

    Raises:
        KnownError: another process of this user holds the name (3), with its pid; or there is no
            folder for locks (1).
    """
    try:
        path = runtime_folder() / f"domain{domain}{full_name.replace('/', '.')}.lock"
        while True:
            file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                pid = os.read(file, 32).decode(errors="replace").strip() or "unknown"
                os.close(file)
                raise KnownError(
                    3,
                    f"{full_name} is already running on domain {domain}, pid {pid}; stop it "
                    f"first, or start this one under another name: --ros-args {other}",
                ) from None
            if is_at(file, path):
                break
            os.close(file)  # its holder has removed it since
        os.ftruncate(file, 0)
        os.write(file, f"{os.getpid()}\n".encode())
    except OSError as error:
        raise KnownError(1, f"no lock for {full_name}: {error}; set XDG_RUNTIME_DIR") from None

    def release() -> None:
        path.unlink(missing_ok=True)
        os.close(file)

    return release


def is_at(file: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file), path.stat())
    except FileNotFoundError:
        return False

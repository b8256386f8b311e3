# SPDX-License-Identifier: Apache-2.0
"""The executable ``control_board``: read the settings, lock the name, run, stop.

Exit codes: 0 stopped by SIGINT or SIGTERM, 2 wrong settings, 3 the name is in use, 4 the physics
server is gone, 5 stopped, but park_on_exit could not park the robot, 1 anything else.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..compiled import describe
from ..core.goals.pose import PARK
from ..core.terms.modes import CONFIGURED
from ..startup import (
    announce_often,
    defer_collection,
    environment_error,
    leave_out_the_generator,
)
from .loop.timing import take_priority
from .process.console import (
    KnownError,
    complain,
    provide_log_folder,
    say,
    settle_stdout,
    welcome,
)

if TYPE_CHECKING:
    from .loop.pulse import ThreadWatch
    from .process.boards import Boards
    from .process.start import Start

#: s for which a thread may keep the interpreter from others; the default makes cycles late.
SWITCH_INTERVAL = 5e-5
#: s to wait for the first control cycles before the joints are shown.
FIRST_CYCLES = 1.0

USAGE = """\
usage: control_board [--ros-args [--params-file FILE] [-p NAME:=VALUE] [-r FROM:=TO] ...]
       control_board --version

Starts a control board: a simulated robot, by default a KUKA iiwa, or a plant of motors.
  control_board --ros-args -p robot:=panda -p gui:=true
  control_board --ros-args --params-file my_robot.yaml -r __ns:=/left
Parameters: docs/parameters.md, or `ros2 param list /control_board` while it runs.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the node until a signal; returns the exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if {"-h", "--help"} & set(arguments):
        say(USAGE)
        return 0
    if "--version" in arguments:
        from ..sim.config import DEFAULT_PHYSICS

        say(f"control_board_ros {__version__}\nlaws: {describe()}\nphysics: {DEFAULT_PHYSICS}\n")
        return 0
    ended, at_once = threading.Event(), threading.Event()

    def end(*_: Any) -> None:
        (at_once if ended.is_set() else ended).set()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup
            signal.signal(number, end)
    sys.setswitchinterval(SWITCH_INTERVAL)
    defer_collection()
    leave_out_the_generator()
    provide_log_folder()
    announce_often()
    try:
        return run(arguments, ended, at_once)
    except KnownError as error:
        complain(str(error))
        return error.code
    finally:
        settle_stdout()


def run(
    arguments: list[str], ended: threading.Event, at_once: threading.Event | None = None
) -> int:
    """From the arguments to a running node, until ``ended`` is set; ``at_once``: without parking.

    Raises:
        KnownError: it cannot run, or did not end as it should.
    """
    if reason := environment_error():
        raise KnownError(2, f"ROS does not start: {reason}")
    from ..settings.params_file import SettingsError
    from .process.start import check_arguments, check_name, lock_name, settings_from_arguments

    check_arguments(arguments)
    try:
        start = settings_from_arguments(arguments)
    except SettingsError as error:
        raise KnownError(2, str(error)) from None
    check_name(start.name, start.namespace)
    other = "-p robot_name:=name" if start.settings.parts else "-r __node:=name"
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    with contextlib.ExitStack() as locks:
        for name in start.names:
            full_name = f"{start.namespace.rstrip('/')}/{name}"
            locks.callback(lock_name(full_name, domain, other))
        return run_alone(start, ended, at_once or threading.Event())


def run_alone(start: Start, ended: threading.Event, at_once: threading.Event) -> int:
    """From the settings to a running node, and back."""
    from ..sim.errors import PlantError, PlantGone
    from .process.start import make_plant

    try:
        start, plant = make_plant(start)
    except (PlantError, ValueError) as error:
        raise KnownError(4 if isinstance(error, PlantGone) else 2, str(error)) from None
    try:
        if refused := take_priority(start.settings.values, getattr(plant, "processes", ())):
            complain(refused)
        failure, unparked = serve(start, plant, ended, at_once)
    finally:
        plant.close()
    if isinstance(failure, PlantGone):
        raise KnownError(4, str(failure))
    if failure is not None:
        raise KnownError(1, f"the control loop failed: {type(failure).__name__}: {failure}")
    if unparked:
        raise KnownError(
            5, f"not parked: {unparked}; the joints are without power where they were"
        )
    return 0


def serve(
    start: Start, plant: Any, ended: threading.Event, at_once: threading.Event
) -> tuple[Exception | None, str]:
    """Run the node until ``ended`` is set.

    Returns:
        The failure of the control loop, if any; and the reason why the robot is not parked, or ''.
    """
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import try_shutdown

    from .loop.pulse import ThreadWatch
    from .process.boards import Boards
    from .process.executor import KeptWaitSetExecutor

    try:
        rclpy.init(args=start.arguments, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # noqa: BLE001 - rcl raises many kinds, all about arguments
        what = f"{type(error).__name__}: {error}"
        raise KnownError(2, f"ROS does not start: {what}; see control_board --help") from None
    boards = Boards(start, plant, on_end=ended.set)
    executor = KeptWaitSetExecutor(boards.on_error)
    for node in boards.nodes:
        executor.add_node(node)
    thread = threading.Thread(target=executor.spin, name="executor", daemon=True)
    boards.start()
    hung = ""
    try:
        thread.start()
        watch = ThreadWatch({"executor": (thread, executor.pulse)} | boards.threads())
        unparked, hung = attend(boards, watch, ended, at_once)
    finally:
        stopped = boards.stop()
    if not stopped:
        complain(f"{hung or 'the control loop hangs'}; the process ends without it")
        os._exit(1)
    executor.end()
    thread.join(timeout=0.5)
    if not thread.is_alive():  # else it hangs in a callback, and its node cannot be destroyed
        executor.shutdown()
        for node in boards.nodes:
            node.destroy_node()
        try_shutdown()
    if hung:
        cause = "" if executor.failure is None else f": {executor.failure}"
        raise KnownError(1, f"{hung}{cause}; the joints are without power")
    return boards.loop.failure, unparked


def attend(
    boards: Boards, watch: ThreadWatch, ended: threading.Event, at_once: threading.Event
) -> tuple[str, str]:
    """Print the welcome, wait for the end, and park; returns as ``parked``, and a hang (B8)."""
    from .process.lifecycle import starts_alone

    await_first_cycles(boards, ended)
    name, settings = boards.nodes[0].get_fully_qualified_name(), boards.settings
    parks, modes = bool(settings.values["park_on_exit"]), boards.loop.main.snapshots.modes.control
    waits = bool(settings.values["lifecycle"]) and not starts_alone(settings.values)
    by = settings.values["plant"] or settings.values["physics"]
    say(welcome(name, settings.board, modes, parks=parks, managed=waits, plant=by))
    if hung := watch.wait(ended):
        return "", hung
    return parked(boards, at_once) if parks and boards.loop.failure is None else "", ""


def parked(boards: Boards, at_once: threading.Event) -> str:
    """Move the robot to the pose park (R6); returns the reason of a failure, or an empty text."""
    from .process.parking import park

    def announce(time: float) -> None:
        say(f"parking, {time:.1f} s; a second Ctrl-C exits immediately, without power\n")

    reason = park(boards.main.member, boards.settings.poses[PARK], announce, at_once)
    if at_once.is_set():
        complain("not parked: a second signal came; the joints are without power where they were")
        return ""
    return reason


def await_first_cycles(boards: Boards, ended: threading.Event) -> None:
    """Wait until joints have left NOT_CONFIGURED, where they do so without a request (N2)."""
    from .process.lifecycle import starts_alone

    if not starts_alone(boards.settings.values):
        return
    # of a robot the first level is enough
    waiting = all if boards.parts else any
    deadline = time.monotonic() + FIRST_CYCLES
    while (
        waiting(m not in CONFIGURED for m in boards.loop.main.snapshots.modes.control)
        and time.monotonic() < deadline
        and not ended.wait(0.005)
    ):
        pass


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""Drives in another process than the board: no torque without it, whatever stops it (B5, S5)."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest
from control_board_msgs import msg, srv
from iiwa import JOINTS
from talk import Talker, talking_to
from waiting import until

from control_board_ros.testing import BoardProcess, board_process

pytestmark = [pytest.mark.ros, pytest.mark.slow]

SUPPORT = Path(__file__).parents[1] / "support"
JOINT = JOINTS[1]  # it carries the arm: held, it needs torque
TIMEOUT = 0.5  # s, plant_timeout
BURNERS = 6


class FarEnd:
    """Virtual drives in a process of their own, and what they print.

    Attributes: bus (as plant_arguments have it).
    """

    def __init__(self, driver: str, bus: str) -> None:
        line = [sys.executable, "-m", "control_board_ros.plants.virtual", driver]
        line += ["--physics", "mujoco", *(["--bus", bus] if bus else [])]
        self.process = subprocess.Popen(line, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.bus = self.process.stdout.readline().split()[-1]
        self._changed = threading.Condition()
        self._last: dict[str, str] = {}
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self.process.stdout or ():
            _, joint, what = line.split()
            with self._changed:
                self._last[joint] = what
                self._changed.notify_all()

    def until(self, what: str, seconds: float = 120.0) -> None:
        """Wait until the joint has torque, or is free."""
        with self._changed:
            found = self._changed.wait_for(lambda: self.has(what), seconds)
            assert found, f"it never is {what}: {self._last}"

    def has(self, what: str) -> bool:
        """Whether the joint has torque, or is free."""
        return self._last.get(JOINT) == what

    def close(self) -> None:
        self.process.terminate()
        self.process.wait(30.0)
        self._reader.join(30.0)
        self.process.stdout.close()


@pytest.fixture(scope="module")
def drives() -> Iterator[FarEnd]:
    """Controllers on a bus that processes share."""
    port = random.SystemRandom().randrange(20_000, 60_000)
    end = FarEnd("moteus", f"udp_multicast:239.74.163.2:{port}")
    yield end
    end.close()


@contextlib.contextmanager
def driven(
    end: FarEnd, plant: str = "moteus", exit_code: int = 0, command: Sequence[str] | None = None
) -> Iterator[tuple[BoardProcess, Talker]]:
    """A board that holds a joint with them."""
    params = {
        "plant": plant,
        "plant_arguments": [end.bus],
        "plant_timeout": TIMEOUT,
        "control_rate": 200.0,
        "joint_defaults.startup_mode": "idl",
        "joint_defaults.timeouts.encoder": TIMEOUT,  # a busy machine delays answers
    }
    with (
        board_process(params, exit_code=exit_code, command=command) as board,
        talking_to(board) as talker,
    ):
        hold(talker, end)
        yield board, talker


def plant_process(board: BoardProcess) -> int:
    """The process that holds the plant."""
    children = Path(f"/proc/{board.process.pid}/task/{board.process.pid}/children").read_text()
    tasks = Path(f"/proc/{board.process.pid}/task").iterdir()
    found = {int(pid) for task in tasks for pid in (task / "children").read_text().split()}
    (one,) = found | {int(pid) for pid in children.split()}
    return one


def hold(talker: Talker, end: FarEnd) -> None:
    """Raise the joint until it has torque: it may have fallen to where it needs none.

    A busy machine may delay the drives so that the joint is in fault again.
    """
    message = msg.PositionCommand(names=[JOINT], positions=[0.5])

    def holds() -> bool:
        if talker.modes()[1] != "pos":
            talker.set_mode([JOINT], "fidl")
            talker.set_mode([JOINT], "pos")
        talker.command("command/position", message)
        return end.has("torque")

    until(holds)


def back(talker: Talker, end: FarEnd) -> None:
    """The board says what happened; FORCE_IDLE, and then the joint has torque again."""
    talker.wait("modes", lambda modes: modes.control_modes[1] == "hwfa")
    assert talker.call("get_faults", srv.GetFaults, names=[JOINT]).faults[0].text
    hold(talker, end)


class Held(NamedTuple):
    """A board that holds the joint, a talker to it, and the file that makes its hook hang."""

    board: BoardProcess
    talker: Talker
    stall: Path


@pytest.fixture(scope="module")
def lasting(drives: FarEnd, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Held]:
    """A board for all that it survives; not beside one that a test kills."""
    stall = tmp_path_factory.mktemp("hook") / "stall"
    command = [sys.executable, str(SUPPORT / "stalled_node.py"), str(stall)]
    with driven(drives, command=command) as (board, talker):
        yield Held(board, talker, stall)


@pytest.fixture
def held(lasting: Held, drives: FarEnd) -> Held:
    hold(lasting.talker, drives)
    return lasting


def test_a_killed_board_leaves_no_torque(drives: FarEnd) -> None:
    """B5: the plant's own process ends it."""
    with driven(drives, exit_code=-signal.SIGKILL) as (board, _):
        board.process.kill()
        drives.until("free")


def test_a_board_killed_with_its_plant_leaves_no_torque(drives: FarEnd) -> None:
    """S5: only the drives' own watchdog is left."""
    with driven(drives, exit_code=-signal.SIGKILL) as (board, _):
        plant = plant_process(board)
        os.kill(plant, signal.SIGSTOP)  # it cannot let go
        board.process.kill()
        os.kill(plant, signal.SIGKILL)
        drives.until("free")


@pytest.mark.parametrize("whole", [False, True], ids=["the board", "and its plant"])
def test_a_stopped_board_has_no_torque(held: Held, drives: FarEnd, whole: bool) -> None:
    """B5, S5: SIGSTOP; it reports so when it continues, and recovers by FORCE_IDLE."""
    stopped = [held.board.process.pid, *([plant_process(held.board)] if whole else [])]
    for pid in stopped:
        os.kill(pid, signal.SIGSTOP)
    try:
        drives.until("free")
    finally:
        for pid in stopped:
            os.kill(pid, signal.SIGCONT)
    back(held.talker, drives)


def test_a_stalled_hook_leaves_no_torque(held: Held, drives: FarEnd) -> None:
    """B5: the control thread hangs in a hook, the rest of the node continues."""
    held.stall.touch()
    try:
        drives.until("free")
    finally:
        held.stall.unlink()
    back(held.talker, drives)


@pytest.mark.soak
def test_an_exhausted_processor_is_no_danger(held: Held, drives: FarEnd) -> None:
    """B5: starved, the board drives, or the joint has no torque and says why; then all is well."""
    board, talker, _ = held
    processor = min(os.sched_getaffinity(0))
    pids = [board.process.pid, plant_process(board)]
    tasks = [int(t.name) for pid in pids for t in Path(f"/proc/{pid}/task").iterdir()]
    everywhere = os.sched_getaffinity(0)
    burners = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(BURNERS)
    ]
    try:
        for pid in [*tasks, *(one.pid for one in burners)]:
            os.sched_setaffinity(pid, {processor})
        for pid in tasks:
            os.setpriority(os.PRIO_PROCESS, pid, 19)
        time.sleep(3.0)
    finally:
        for one in burners:
            one.kill()
            one.wait()
        for pid in tasks:
            with contextlib.suppress(ProcessLookupError):
                os.sched_setaffinity(pid, everywhere)
    if talker.modes()[1] == "hwfa":
        back(talker, drives)
    hold(talker, drives)


@pytest.mark.soak
def test_dynamixels_on_a_pseudo_terminal_hold_still() -> None:
    """S5: their watchdog stops them, and they hold: what on_silence says that they can."""
    end = FarEnd("dynamixel", "")
    try:
        with driven(end, "dynamixel", exit_code=-signal.SIGKILL) as (board, _):
            board.process.kill()
            end.until("torque")
    finally:
        end.close()


def test_a_trial_that_is_killed_leaves_no_power(tmp_path: Path) -> None:
    """Its drives are in a process of their own: a Feetech has no watchdog, and would hold."""
    end = FarEnd("feetech", "")
    robot = tmp_path / "robot.yaml"
    robot.write_text(
        "/**:\n  ros__parameters:\n    robot: iiwa\n    plant: feetech\n"
        f"    plant_timeout: {TIMEOUT}\n    plant_arguments: [{end.bus}]\n"
    )
    line = [sys.executable, "-m", "control_board_ros.plants", "try", str(robot), "--yes"]
    trial = subprocess.Popen(
        [*line, "--joints", JOINT], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert trial.stdout is not None
    try:
        end.until("torque")
        trial.kill()
        end.until("free")
        assert trial.wait(30.0) == -signal.SIGKILL
    except AssertionError as error:
        trial.kill()
        error.add_note(f"--- the trial printed:\n{trial.stdout.read()}")
        raise
    finally:
        trial.kill()
        trial.wait()
        trial.stdout.close()
        end.close()

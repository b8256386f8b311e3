# SPDX-License-Identifier: Apache-2.0
"""R6: parking at the end. On an ideal plant, as fast as possible; and the whole process once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rig import Rig, board_config, joint, plain, simulation_config
from talk import talking_to
from waiting import until

from control_board_ros.core.board import Board
from control_board_ros.core.goals.pose import Pose
from control_board_ros.core.goals.pose_moves import start_parking
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.node.loop.loop import ControlLoop
from control_board_ros.node.process.parking import PAUSED, park
from control_board_ros.sim.plant import SimulatedPlant
from control_board_ros.testing import board_process

PARK = Pose("park", ("a", "b"), (0.5, -0.5), 1.0)


@pytest.fixture
def loop() -> Iterator[ControlLoop]:
    """Two joints in POSITION, and b without a torque sensor."""
    config = board_config(joint("a"), plain("b"))
    plant = SimulatedPlant(config, simulation_config(config))
    made = ControlLoop(Board(config), plant, real_time_factor=0.0)
    made.start()
    until(lambda: made.main.snapshots.modes.control[0] is ControlMode.IDLE)
    with made.main.exclusive() as board:
        assert board.set_control_mode(None, "pos")
    yield made
    made.stop()


def parked(loop: ControlLoop, pose: Pose = PARK, at_once: bool = False) -> tuple[str, list[float]]:
    """Why it is not parked, and how long it was to take."""
    progress: list[float] = []
    second = threading.Event()
    if at_once:
        second.set()
    return park(loop.main, pose, progress.append, second), progress


def test_an_unexpected_error_is_told_as_the_reason(loop: ControlLoop) -> None:
    """R6: and not as a second signal."""

    def fails(_: float) -> None:
        raise ZeroDivisionError("of nothing")

    why = park(loop.main, PARK, fails, threading.Event())
    assert why == "internal error, ZeroDivisionError: of nothing"


def test_it_goes_to_park_first(loop: ControlLoop) -> None:
    """R6: takes the robot to park, and no power yet."""
    assert parked(loop) == ("", [pytest.approx(0.5)])
    with loop.main.exclusive() as board:
        assert board.get_encoder() == pytest.approx([0.5, -0.5], abs=0.01)
        assert [mode.code for mode in board.get_control_mode()] == ["pos", "pos"]


@pytest.mark.parametrize("modes", [["vel", "mix"], ["torq", "open"], ["posd", "posd"]])
def test_joints_with_power_are_switched(loop: ControlLoop, modes: list[str]) -> None:
    """R6, M2: the parameter is the user's word for it."""
    with loop.main.exclusive() as board:
        assert board.set_control_mode(None, modes)
    assert parked(loop)[0] == ""
    with loop.main.exclusive() as board:
        assert [mode.code for mode in board.get_control_mode()] == ["pos", "pos"]


CANNOT: dict[str, tuple[Callable[[Any], Any], str]] = {
    "idle": (lambda board: board.set_control_mode("b", "idl"), "b is in IDLE"),
    "fault": (
        lambda board: board.set_control_mode("b", "torq"),
        "b is in HW_FAULT (unsupported mode, torq",
    ),
    "power-on": (lambda board: board.power_cycle(), "in NOT_CONFIGURED"),
}


@pytest.mark.parametrize("case", CANNOT)
def test_joints_that_cannot_be_parked_report_why_and_stay(case: str) -> None:
    """R6: it ends with its reason; a joint without power gets none."""
    act, text = CANNOT[case]
    rig = Rig(board_config(joint("a"), plain("b"), autoconfigure=False))
    rig.board.configure()
    rig.tick(2)
    assert rig.board.set_control_mode(None, "vel")
    act(rig.board)
    modes = rig.board.get_control_mode()
    with pytest.raises(RequestError) as caught:
        start_parking(rig.board, PARK)
    assert text in str(caught.value)
    assert rig.board.get_control_mode() == modes
    assert rig.board.check_motion_done() == [True, True]


def test_a_paused_simulation_is_reported(loop: ControlLoop) -> None:
    """R6: it would never end."""
    loop.pause(True)
    assert parked(loop) == (PAUSED, [])


def test_a_second_signal_ends_the_wait(loop: ControlLoop) -> None:
    """R6: also where the loop hangs with its lock."""
    with loop.main.exclusive():
        assert parked(loop, at_once=True) == ("a second signal came", [])
    until(lambda: all(thread.name != "parking" for thread in threading.enumerate()))
    with loop.main.exclusive() as board:
        assert board.check_motion_done() == [True, True]


def test_a_joint_that_faults_on_the_way_ends_it(loop: ControlLoop) -> None:
    """R6: with its reason."""
    slow = Pose("park", ("a", "b"), (2.0, -2.0), 1e-3)

    def hurt(_: float) -> None:
        with loop.main.exclusive() as board:
            board.set_control_mode("b", "torq")

    reason = park(loop.main, slow, hurt, threading.Event())
    assert "b left for HW_FAULT" in reason


@pytest.mark.ros
@pytest.mark.slow
def test_the_process_parks_then_idles_then_ends() -> None:
    """R6: first signal: park, IDLE, exit code 0; 5 with the reason where that is not possible."""
    quick = {"park_on_exit": True, "real_time_factor": 4.0}
    with board_process(quick) as board, talking_to(board) as talker:
        board.process.send_signal(signal.SIGINT)
        board.wait_for_output("parking, 3.4 s")
        assert board.process.wait(120.0) == 0
        talker.wait("modes", lambda m: set(m.control_modes) == {"idl"})
        talker.wait("state", lambda s: list(s.position) == pytest.approx([0.0] * 7, abs=0.02))
    with board_process({"park_on_exit": True}) as board, talking_to(board):
        board.process.send_signal(signal.SIGTERM)
        board.wait_for_output("parking, ")
        assert board.stop(signal.SIGINT) == 0
        assert "not parked: a second signal came" in board.output
    with board_process({"park_on_exit": True}, exit_code=5) as board, talking_to(board) as talker:
        name = talker.names[2]
        assert talker.set_mode([name], "idl").success
        assert board.stop(signal.SIGTERM) == 5
        assert f"control_board: not parked: {name} is in IDLE" in board.output

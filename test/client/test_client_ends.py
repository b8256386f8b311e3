# SPDX-License-Identifier: Apache-2.0
"""How the client ends, and what goes wrong around it: users see BoardError, and nothing else."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from typing import Any

import pytest
from control_board_msgs.msg import JointFault, JointFaults
from processes import python
from talk import patient
from waiting import GUARD

from control_board_ros.client import BoardError, BoardTimeout, ControlBoardClient
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.interface import FAULTS
from control_board_ros.testing import BoardProcess, board_process, ros_node

pytestmark = pytest.mark.ros


@pytest.mark.parametrize(
    ("end", "text"), [("close", "the client was closed"), ("shutdown", "context was shut down")]
)
def test_a_call_that_waits_ends_with_its_client(board: BoardProcess, end: str, text: str) -> None:
    """Closed by another thread, or by rclpy.shutdown(); later calls say so, too."""
    with ros_node(board.domain, "short", spin=False) as node:
        client = patient(node, board.name)
        assert client.names
        ends = {"close": client.close, "shutdown": node.context.shutdown}
        threading.Timer(0.3, ends[end]).start()
        with pytest.raises(BoardError, match=text):
            client.wait_for_state(lambda _: False, GUARD)
        with pytest.raises(BoardError, match=text):
            client.get_control_mode()
        client.close()


PROGRAM = """
import rclpy
from control_board_ros.client import ControlBoardClient
rclpy.init()
node = rclpy.create_node("program")
client = ControlBoardClient(node, "control_board", find_timeout=60.0, answer_timeout=60.0)
"""
ASKING = f"{PROGRAM}print(client.get_control_mode(0)[0].name)"
SWEEPING = (
    f"{PROGRAM}client.follow_trajectory(0, [0.0, 60.0], [[0.0], [1.5]], None, "
    "lambda past: print('moving', flush=True), attended=True)"
)
MOVING = f"{PROGRAM}client.move(0, 1.5, 0.1, lambda feedback: print('moving', flush=True))"


@pytest.mark.slow
@pytest.mark.parametrize("end", ["", "; rclpy.shutdown()"], ids=["as it is", "shut down"])
def test_a_program_just_ends(board: BoardProcess, end: str) -> None:
    """Nothing needs to be closed: the program ends with code 0 and says nothing."""
    done = python(ASKING + end, env=board.environment)
    assert (done.stdout, done.stderr) == ("POSITION\n", "")


@pytest.mark.slow
def test_ctrl_c_where_rclpy_handles_signals(board: BoardProcess, node: Any) -> None:
    """As most programs are: rclpy shuts every context down first, and the joints stop still."""
    with patient(node, board.name) as client:
        assert client.set_control_mode(0, "pos")
        program = subprocess.Popen(
            [sys.executable, "-c", MOVING],
            env=board.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert program.stdout is not None
        assert program.stdout.readline() == "moving\n"
        assert client.check_motion_done(0) == [False]
        program.send_signal(signal.SIGINT)
        _, errors = program.communicate()
        assert errors.splitlines()[-1] == "KeyboardInterrupt"
        assert "BoardError" not in errors
        client.wait_for_state(lambda state: bool(state.motion_done[0]), GUARD)
        assert client.get_encoder(0)[0] < 1.4
        assert client.get_target_position(0) == pytest.approx([1.5])


@pytest.mark.slow
def test_a_trajectory_ends_with_its_program(board: BoardProcess, node: Any) -> None:
    """Killed, it cancels nothing: the board misses its heartbeats."""
    with patient(node, board.name) as client:
        assert client.set_control_mode(0, "posd")
        program = subprocess.Popen(
            [sys.executable, "-c", SWEEPING], env=board.environment, stdout=subprocess.PIPE
        )
        assert program.stdout is not None
        assert program.stdout.readline() == b"moving\n"
        client.wait_for_state(lambda state: bool(state.velocity_reference[0] > 0.0), GUARD)
        program.kill()
        program.communicate()
        client.wait_for_state(lambda state: bool(state.velocity_reference[0] == 0.0), GUARD)
        assert client.get_ref_position(0)[0] < 1.4


@pytest.mark.slow
def test_a_board_that_is_killed_ends_a_move() -> None:
    """Before discovery forgets it."""
    with (
        board_process(exit_code=-signal.SIGKILL) as board,
        ros_node(board.domain, "left", spin=False) as node,
        ControlBoardClient(node, board.name, find_timeout=GUARD) as client,
    ):
        with pytest.raises(BoardTimeout, match="went silent during move; is it still running"):
            client.move(0, 1.5, 0.01, lambda _: board.process.kill())
        assert client._link.is_there()


@pytest.mark.slow
@pytest.mark.parametrize("end", ["close", "shutdown", "destroy"])
def test_nodes_destroyed_during_calls_are_board_errors(board: BoardProcess, end: str) -> None:
    """Nothing of rclpy's comes through, in no thread, whatever it was doing."""
    ended: list[BaseException] = []
    with ros_node(board.domain, "brief", spin=False) as node:
        client = patient(node, board.name)
        assert client.set_control_mode(0, "vel")
        calls = [
            lambda: client.get_control_mode(0),
            lambda: client.velocity_move(0, 0.0),
            lambda: client.get_encoder(0),
            lambda: client.calibrate(6, wait=False),
        ]
        busy = threading.Barrier(len(calls) + 1)

        def call_for_ever(call: Any) -> None:
            call()
            busy.wait()
            try:
                while True:
                    call()
            except BaseException as error:  # noqa: BLE001
                ended.append(error)

        threads = [threading.Thread(target=call_for_ever, args=(call,)) for call in calls]
        for thread in threads:
            thread.start()
        busy.wait()
        if end == "close":
            client.close()
        else:
            node.context.shutdown()
        if end == "destroy":
            node.destroy_node()
        for thread in threads:
            thread.join()
        client.close()
    assert [type(error) for error in ended] == [BoardError] * len(calls)


def test_a_node_that_was_destroyed(board: BoardProcess) -> None:
    """A client cannot be made of it, and one made before goes on."""
    with ros_node(board.domain, "gone", spin=False) as node:
        client = patient(node, board.name)
        node.destroy_node()
        assert client.get_axes() == 7
        with pytest.raises(BoardError, match="make a new client"):
            ControlBoardClient(node, board.name)
        client.close()


@pytest.mark.slow
def test_a_message_that_cannot_be_read(board: BoardProcess, capfd: Any) -> None:
    """One line in the log, however many there are, and the next valid one is processed."""
    read: list[str] = []

    def take(message: Any) -> None:
        (fault,) = message.faults
        read.append(ControlMode[fault.text].code)

    with (
        ros_node(board.domain, "newer", spin=False) as newer,
        ros_node(board.domain, "reader", spin=False) as node,
        patient(node, "newer") as client,
    ):
        client._link.subscribe(FAULTS, take)
        publisher = newer.create_publisher(JointFaults, "newer/faults", FAULTS.qos.profile())
        said, later = "", 5
        while not said or later:  # until it is said, and some more
            publisher.publish(JointFaults(faults=[JointFault(text="?")]))
            time.sleep(0.02)
            said += capfd.readouterr().err
            later -= bool(said)
        while not read:
            publisher.publish(JointFaults(faults=[JointFault(text="IDLE")]))
            time.sleep(0.02)
    assert read[0] == "idl"
    (line,) = said.splitlines()
    assert "client of /newer: a message was lost: KeyError: '?'" in line
    assert line.endswith("are client and board of the same version?")

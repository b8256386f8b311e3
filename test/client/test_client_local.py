# SPDX-License-Identifier: Apache-2.0
"""A client of a simulation in the same process: no ROS, and time that passes in its calls."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from control_board_ros.client import BoardError, BoardTimeout, ControlBoardClient, connect
from control_board_ros.client.local_link import READINGS, LocalServices
from control_board_ros.core.terms.reply import Reply
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.interface import SERVICES, STATE
from control_board_ros.operations import OPERATIONS
from control_board_ros.simulation import Simulation

ARM = Path(__file__).parents[1] / "support" / "arm.yaml"


def load() -> Simulation:
    """Three joints in POSITION, without gravity or an engine; 500 Hz."""
    return Simulation.load(str(ARM), joint_defaults__startup_mode="pos")


@pytest.fixture
def simulation() -> Iterator[Simulation]:
    with load() as simulation:
        yield simulation


@pytest.fixture
def client(simulation: Simulation) -> Iterator[ControlBoardClient]:
    with connect(simulation) as client:
        yield client


PROGRAM = f"""
import sys
from control_board_ros.client import connect
from control_board_ros.operations import OPERATIONS
from control_board_ros.simulation import Simulation
with Simulation.load({str(ARM)!r}, left__startup_mode="pos") as arm, connect(arm) as board:
    assert board.move(0, 0.2)
loaded = {{name.partition(".")[0] for name in sys.modules}}
print(sorted(loaded & {{"rclpy", "control_board_msgs", "rcl_interfaces", "std_msgs"}}))
"""


def test_no_module_of_ros_is_loaded() -> None:
    """A program of a simulation runs where ROS is not installed."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.returncode) == ("[]\n", 0), done.stderr


def test_every_service_is_offered() -> None:
    """By a row of operations, or by a method of its own, never both."""
    names = {service.short for service in SERVICES}
    assert names >= OPERATIONS.keys()
    for name in names:
        assert hasattr(LocalServices, name) == (name not in OPERATIONS), name


def test_every_reading_is_in_the_state() -> None:
    fields = STATE.load().get_fields_and_field_types()
    assert {*READINGS, "header", "names"} == set(fields)


def test_a_run_gives_the_same_numbers(simulation: Simulation) -> None:
    """Time passes in calls only: nothing depends on how fast they are."""
    ends = []
    for _ in range(2):
        with load() as one, connect(one) as board:
            assert board.move(0, 0.3, 0.4)
            ends.append((board.get_state().stamp, board.get_encoder().tolist()))
    assert ends[0] == ends[1]
    assert simulation.time == 0.0


def test_time_passes_with_each_call(client: ControlBoardClient) -> None:
    """A cycle with a request or a reading, so that a program that polls comes to an end."""
    before = client.get_state().stamp
    assert client.get_state().stamp == pytest.approx(before + 0.002)
    assert client.position_move(0, 0.1, 1.0)
    while not all(client.check_motion_done()):
        pass
    with pytest.raises(BoardTimeout, match=r"after 0\.2 s of simulated time"):
        client.wait_for_state(lambda state: bool(state.position[0] > 9.0), 0.2)


def test_a_paused_simulation_steps(client: ControlBoardClient) -> None:
    """Nothing waits for ever: a call that would have to, says what to do."""
    assert "pause it first" in client.step(3).message
    assert client.pause()
    before = client.get_state().stamp
    assert client.step(25)
    assert client.get_state().stamp == pytest.approx(before + 0.05)
    with pytest.raises(BoardError, match=r"resume it with pause\(False\)"):
        client.move(0, 0.1)
    with pytest.raises(BoardError, match=r"resume it"):
        client.wait_for_state(lambda _: False)


def test_tasks_of_asyncio_share_the_time(client: ControlBoardClient) -> None:
    """Two moves at once take as long as the longer one; a cancelled task stops its joint."""

    async def both() -> None:
        start = client.get_state().stamp
        one, two = client.aio.move(0, 0.4, 0.4), client.aio.move(1, 0.2, 0.4)
        assert all(await asyncio.gather(one, two))
        assert client.get_state().stamp - start < 1.3
        move = asyncio.create_task(client.aio.move(0, -1.0, 0.2))
        while all(await client.aio.check_motion_done(0)):
            pass
        move.cancel()
        with pytest.raises(asyncio.CancelledError):
            await move
        assert await client.aio.check_motion_done(0) == [True]

    asyncio.run(both())


def test_trajectories(client: ControlBoardClient) -> None:
    """T1: followed to the end, interrupted, or refused with the reason."""
    assert "mode is POSITION" in client.follow_trajectory(0, [1.0], [[0.1]]).message
    assert client.set_control_mode(0, "posd")
    times: list[float] = []
    reply = client.follow_trajectory(0, [0.5, 1.0], [[0.1], [0.2]], [[0.2], [0.0]], times.append)
    assert reply, reply.message
    assert times == sorted(times)
    assert client.get_encoder(0)[0] == pytest.approx(0.2, abs=0.02)

    def interrupt(_: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        client.follow_trajectory(0, [2.0], [[1.0]], feedback=interrupt)
    client.wait_for_state(lambda state: not state.velocity_reference[0])
    assert client.get_encoder(0)[0] < 0.5


def test_parts_and_settings() -> None:
    """R1: a part is a board; its joints are those of the robot."""
    with Simulation.load("icub") as robot:
        with connect(robot, "head", answer_timeout=9.0) as head:
            assert head.board_name == "/head"
            names = head.names
            head.wait_for_state(lambda state: bool(state.calibrated.all()), 30.0)
            assert head.set_control_mode(0, "vel").modes == (M.VELOCITY,)
        with connect(robot) as board:
            assert board.get_control_mode(names[0]) == [M.VELOCITY]
        with pytest.raises(BoardError, match="'haed' unknown; did you mean 'head'"):
            connect(robot, "haed")
        assert robot.hooks == []


def test_without_settings(simulation: Simulation) -> None:
    """A simulation of a configuration has no parameters and poses, and says so."""
    simulation.settings = None
    with connect(simulation) as board:
        with pytest.raises(BoardError, match=r"make it with Simulation\.load"):
            board.list_parameters()
        assert board.get_velocity_limits().shape == (3,)


def test_closed(simulation: Simulation) -> None:
    board = connect(simulation)
    board.close()
    with pytest.raises(BoardError, match="the client was closed"):
        board.get_control_mode()


#: Calls whose arguments do not fit the method, and what is said.
MISFITS: list[tuple[Callable[[Any], object], str]] = [
    (
        lambda client: client.move(0, 0.1, timeout=3.0),
        "move() got an unexpected keyword argument 'timeout'; it is move(joints, positions, "
        "speeds=None, feedback=None)",
    ),
    (
        lambda client: client.set_control_mode("pos"),
        "set_control_mode() missing 1 required positional argument: 'modes'; it is "
        "set_control_mode(joints, modes)",
    ),
    (
        lambda client: client.relative_move(0, 0.1, 0.2, True),
        "relative_move() takes from 3 to 4 positional arguments but 5 were given; it is "
        "relative_move(joints, distances, speeds=None, *, together=False)",
    ),
    (lambda client: client.set_motors(0, max_current=3.0), "did you mean 'max_currents'?"),
]


@pytest.mark.parametrize(("call", "text"), MISFITS)
def test_a_misfit_names_the_method_and_what_it_takes(
    client: ControlBoardClient, call: Callable[[Any], object], text: str
) -> None:
    """No class of the library is in the text, and both forms say the same."""
    with pytest.raises(TypeError) as raised:
        call(client)
    assert text in str(raised.value)
    with pytest.raises(TypeError) as raised:
        asyncio.run(call(client.aio))  # type: ignore[arg-type]
    assert text in str(raised.value)


#: Calls with values of another type, and what the reply says.
WRONG_TYPES: list[tuple[Callable[[Any], Reply], str]] = [
    (lambda client: client.set_control_mode(0, None), "None is no control mode"),
    (lambda client: client.set_interaction_mode(0, 3.5), "3.5 is no interaction mode"),
    (lambda client: client.set_brake(0, 3), "brake mode '3' unknown"),
    (lambda client: client.set_manual_brake_active(0, None), "None is neither true nor false"),
    (lambda client: client.set_manual_brake_active(0, "open"), "'open' is neither true nor false"),
    (lambda client: client.set_auto_brake_enabled(0, 2), "2 is neither true nor false"),
    (lambda client: client.velocity_move(0, 0.1, valid_for="long"), "valid_for must be a number"),
    (lambda client: client.go_to_pose("home", "fast"), "speed must be a number, not 'fast'"),
    (lambda client: client.go_to_pose(None), "pose must be a text, not None"),
    (lambda client: client.go_to_pose(""), "pose '' unknown"),
    (lambda client: client.save_pose(None), "pose must be a text, not None"),
    (lambda client: client.save_pose("mine", speed="fast"), "speed must be a number"),
    (lambda client: client.step("x"), "steps must be a whole number, not 'x'"),
    (lambda client: client.inject_fault(0, None), "fault must be a text, not None"),
    (lambda client: client.follow_trajectory(0, [1.0], "ab"), "must be numbers"),
    (lambda client: client.follow_trajectory(0, [1, 2], [[0.1], [0.2, 0.3]]), "must be numbers"),
]


@pytest.mark.parametrize(("call", "text"), WRONG_TYPES)
def test_a_value_of_another_type_is_refused_in_words(
    client: ControlBoardClient, call: Callable[[Any], Reply], text: str
) -> None:
    """A: set methods answer; no error of the library's own code comes out of them."""
    reply = call(client)
    assert not reply
    assert text in reply.message


@pytest.mark.parametrize("given", [None, 0, [], "left", np.array([0, 1])])
def test_only_false_releases_an_emergency_stop(
    simulation: Simulation, client: ControlBoardClient, given: Any
) -> None:
    """E2: what would select joints in other methods stops all; here and on the board itself."""
    client.emergency_stop(given)
    assert set(client.get_control_mode()) == {M.HW_FAULT}
    client.emergency_stop(np.False_)
    assert client.recover()
    simulation.board.emergency_stop(given)
    simulation.step()
    assert set(client.get_control_mode()) == {M.HW_FAULT}


def test_a_stream_of_nothing_moves_nothing(client: ControlBoardClient) -> None:
    """M4: None for all joints, and then no values, is a reference that the board ignores."""
    client.set_control_mode(None, "posd")
    assert client.set_position(None, None)
    assert not client.set_position(None, None, answered=True)


def test_flags_of_numpy_are_flags(client: ControlBoardClient) -> None:
    """A message has those of Python only: with one of numpy a program over ROS was aborted."""
    assert client.position_move(0, 0.1, together=np.True_)
    assert client.recover(partial=np.True_)
    assert client.pause(np.True_)
    assert client.step(np.int64(2))


@pytest.mark.parametrize(
    ("guess", "name"),
    [
        ("get_position", "get_encoder"),
        ("set_mode", "set_control_mode"),
        ("get_motor", "get_motors"),
    ],
)
def test_a_guessed_name_leads_to_the_right_one(
    client: ControlBoardClient, guess: str, name: str
) -> None:
    with pytest.raises(AttributeError, match=name):
        getattr(client, guess)

# SPDX-License-Identifier: Apache-2.0
"""The executable: its end, its errors, its neighbours."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from control_board_msgs import msg
from diagnostic_msgs.msg import DiagnosticArray
from qos import BEST_EFFORT
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.qos import ReliabilityPolicy
from rclpy.utilities import try_shutdown
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool
from talk import Talker, talking_to
from waiting import GUARD, until

from control_board_ros.node.main import KnownError, run
from control_board_ros.node.process.start import make_plant
from control_board_ros.sim.errors import PlantGone
from control_board_ros.testing import (
    BoardProcess,
    board_process,
    child_environment,
    free_domain,
    ros_node,
)

pytestmark = pytest.mark.ros

NODE = [sys.executable, "-m", "control_board_ros.node.main"]


def start_and_fail(*arguments: str, domain: int = 39, **environment: str) -> tuple[int, str]:
    """Exit code and standard error of a board that does not start."""
    done = subprocess.run(
        [*NODE, *arguments],
        env=child_environment(domain) | environment,
        capture_output=True,
        text=True,
        timeout=GUARD,
        check=False,
    )
    return done.returncode, done.stderr


def refused(*arguments: str) -> str:
    """Why a board does not start, in this process; in one of its own: start_and_fail."""
    ended = threading.Event()
    ended.set()  # a board that starts all the same ends at once
    with pytest.raises(KnownError) as raised:
        run(list(arguments), ended)
    assert raised.value.code == 2
    text = str(raised.value)
    assert "\n" not in text
    return text


class Noted:
    """A plant that notes its last outputs, and when it is closed."""

    def __init__(self, plant: Any) -> None:
        self._plant, self.closed = plant, 0
        self.powered = self.drove = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    def write(self, actuation: Any) -> None:
        self.powered = bool(actuation.powered.any())
        self.drove |= self.powered
        self._plant.write(actuation)

    def close(self) -> None:
        self.closed += 1
        self._plant.close()


@pytest.fixture
def noted(monkeypatch: pytest.MonkeyPatch) -> list[Noted]:
    """The plants of nodes that run in this process."""
    made: list[Noted] = []

    def make(start: Any) -> tuple[Any, Any]:
        start, plant = make_plant(start)
        made.append(Noted(plant))
        return start, made[-1]

    monkeypatch.setattr("control_board_ros.node.process.start.make_plant", make)
    return made


def test_a_node_that_does_not_start_closes_the_plant(
    noted: list[Noted], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(**_: Any) -> None:
        raise RuntimeError("no middleware")

    monkeypatch.setattr("rclpy.init", fail)
    assert "no middleware" in refused("--ros-args", "-p", "physics:=ideal")
    assert noted[0].closed


def test_an_error_beside_the_loop_ends_it_without_power(
    noted: list[Noted], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever ends the node: no power, and the plant is let go."""

    def fail(*_: Any, **__: Any) -> None:
        until(lambda: noted[0].powered)
        raise OSError("no screen")

    monkeypatch.setattr("control_board_ros.node.main.welcome", fail)
    with free_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        with pytest.raises(OSError, match="no screen"):
            run(["--ros-args", "-p", "physics:=ideal"], threading.Event())
        try_shutdown()
    assert noted[0].drove
    assert not noted[0].powered
    assert noted[0].closed


@pytest.mark.slow
@pytest.mark.parametrize(("method", "text"), [
    ("_serve_once", "the executor thread ended: wait set"),
    ("_run_tasks", "the executor thread hangs for 1 s"),
])  # fmt: skip
def test_a_thread_that_ends_or_hangs_ends_the_node_without_power(
    noted: list[Noted], monkeypatch: pytest.MonkeyPatch, method: str, text: str
) -> None:
    """B8: an error of the middleware beside all callbacks; a callback that never returns."""
    forever = threading.Event()

    def fail(*_: Any) -> None:
        until(lambda: noted[0].powered)
        if method == "_run_tasks":
            forever.wait()
        raise RuntimeError("wait set")

    monkeypatch.setattr(
        f"control_board_ros.node.process.executor.KeptWaitSetExecutor.{method}", fail
    )
    with free_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        with pytest.raises(KnownError, match=text) as raised:
            run(["--ros-args", "-p", "physics:=ideal"], threading.Event())
        forever.set()
        try_shutdown()
    assert raised.value.code == 1
    assert noted[0].drove
    assert not noted[0].powered
    assert noted[0].closed


def test_a_plant_that_is_gone_has_its_own_exit_code(
    noted: list[Noted], monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: Any) -> None:
        raise PlantGone("the physics server is gone")

    monkeypatch.setattr(Noted, "write", gone)
    with free_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        with pytest.raises(KnownError, match="the physics server is gone") as raised:
            run(["--ros-args", "-p", "physics:=ideal"], threading.Event())
    assert raised.value.code == 4
    assert noted[0].closed


@pytest.mark.slow
def test_a_signal_while_paused_and_calibrating() -> None:
    """P11 of the promises: joints unpowered, last state published, exit code 0; also then."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it, and a board inherits that
    joint = "lbr_iiwa_joint_7"
    params = {joint: {"calibration": {"type": 3, "required": True, "start": 0.5, "speed": 0.02}}}
    with board_process(params, configured=False) as board, talking_to(board) as talker:
        talker.wait("modes", lambda m: m.control_modes[6] == "cal")
        assert talker.call("pause", SetBool, data=True).success
        assert board.stop(signal.SIGHUP) == 0
        talker.wait("modes", lambda m: set(m.control_modes) == {"idl"})
        talker.wait("state", lambda s: set(s.output) == {0.0})
        assert "Traceback" not in board.output


@pytest.fixture(scope="module")
def two() -> Iterator[tuple[BoardProcess, BoardProcess]]:
    """Boards of one name on one domain, in the namespaces left and right."""
    with (
        board_process(namespace="left") as left,
        board_process(namespace="right", domain=left.domain) as right,
    ):
        yield left, right


@pytest.mark.slow
def test_two_boards_in_two_namespaces(two: tuple[BoardProcess, BoardProcess]) -> None:
    """Everything is relative: commands to one board do not reach the other."""
    left, right = two
    with (
        talking_to(left, "left_talker") as a,
        talking_to(right, "right_talker") as b,
    ):
        assert a.set_mode([], "posd").success
        assert set(a.modes()) == {"posd"}
        assert set(b.modes()) == {"pos"}
        a.subscribe("diagnostics", DiagnosticArray, "/diagnostics")
        for side in ("left", "right"):
            a.wait("diagnostics", lambda d: d.status[0].name == f"{side}/control_board: loop")  # noqa: B023
        name = b.names[6]
        b.command("command/position", msg.PositionCommand(names=[name], positions=[0.2]))
        b.state(lambda s: s.position[6] > 0.1)
        assert abs(a.state().position[6]) < 0.01
        topics = {topic for topic, _ in a.node.get_topic_names_and_types()}
        assert {"/left/joint_states", "/right/joint_states"} <= topics
        assert {"/left/robot_description", "/right/robot_description"} <= topics


@pytest.mark.slow
def test_a_second_node_of_the_name_is_refused(two: tuple[BoardProcess, BoardProcess]) -> None:
    """Exit code 3 and the other's pid, in one line; another namespace is welcome."""
    left, right = two
    code, text = start_and_fail("--ros-args", "-r", "__ns:=/left", domain=left.domain)
    assert code == 3
    assert f"pid {left.process.pid}" in text
    assert text.count("\n") == 1
    assert right.name == "/right/control_board"


@pytest.mark.slow
def test_a_namesake_of_another_user_is_reported(
    two: tuple[BoardProcess, BoardProcess], tmp_path: Path
) -> None:
    """Where the lock cannot see the other one, the graph does, and both are warned."""
    elsewhere = {"XDG_RUNTIME_DIR": str(tmp_path)}
    with board_process(namespace="right", domain=two[0].domain, env=elsewhere) as other:
        line = other.wait_for_output("nodes are called /right/control_board on this domain")
    assert "2 nodes" in line


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["-p", "lbr_iiwa_joint_1.limits.lower:=9.0"], "limits.upper: 2.93"),
        (["-p", "plant:=nothing"], "packages offer others by the entry point"),
        (["-r", "__node:=no spaces"], "no spaces"),
        (["-r", "__ns:=/a//b"], "/a//b"),
    ],
)
def test_wrong_settings_end_it_with_one_line(arguments: list[str], text: str) -> None:
    """Exit code 2, one line, no traceback."""
    assert text in refused("--ros-args", *arguments)


@pytest.mark.parametrize(
    "arguments",
    [
        ["-p", "robot:=panda"],
        ["robot:=panda"],
        ["--foo"],
        ["--ros-args", "-p", "gui:=false", "--", "x"],
    ],
    ids=" ".join,
)
def test_arguments_that_ros_would_pass_over_are_refused(arguments: list[str]) -> None:
    """Exit code 2, one line that names the argument and shows how."""
    text = refused(*arguments)
    assert repr(arguments[-1] if arguments[-1] == "x" else arguments[0]) in text
    assert "control_board --ros-args -p robot:=panda" in text


def test_a_ros_argument_that_does_not_exist_is_named() -> None:
    """Exit code 2, one line on standard error."""
    code, text = start_and_fail("--ros-args", "-p", "niceness:=19", "--foo")  # allowed to any user
    assert code == 2, text
    assert "'--foo'" in text
    assert text.count("\n") == 1, text


UNCOMPILED = """
import sys
from control_board_ros import compiled
sys.meta_path.insert(0, compiled.Sources)
from control_board_ros.node.main import main
sys.exit(main())
"""


@pytest.mark.slow
def test_a_board_with_uncompiled_laws_says_so_once() -> None:
    """In one line; it works as others do, at the rate that plain Python reaches."""
    command = (sys.executable, "-c", UNCOMPILED)
    with board_process({"control_rate": 200.0}, command=command) as board:
        with talking_to(board) as talker:
            assert talker.set_mode([], "posd").success
        line = board.wait_for_output("laws: uncompiled (")
        assert "install again with Cython and a C compiler" in line
        board.wait_for_output("Stop with Ctrl-C")
        assert board.output.count("laws: ") == 1


@pytest.fixture(scope="module")
def unusual() -> Iterator[tuple[BoardProcess, Talker]]:
    """A board of other times and rates, and a topic of another quality of service."""
    override = "qos_overrides./control_board/command/position.subscription.reliability"
    with (
        board_process(
            {"use_sim_time": True, "control_rate": 250.0, "state_rate": 1000.0},
            arguments=["--ros-args", "-p", f"{override}:=best_effort"],
        ) as board,
        talking_to(board) as talker,
    ):
        yield board, talker
        assert board.stop(signal.SIGINT) == 0


@pytest.mark.slow
def test_use_sim_time_makes_one_time(unusual: tuple[BoardProcess, Talker]) -> None:
    """Stamps and /clock are simulated time; it cannot be changed while the board runs."""
    board, talker = unusual
    board.wait_for_output("use_sim_time: stamps are simulated time")
    talker.subscribe("clock", Clock, "/clock", BEST_EFFORT)
    clock = talker.wait("clock", lambda _: True, fresh=True).clock
    assert clock.sec < 10_000
    assert talker.state().header.stamp.sec < 10_000
    off = ParameterMessage(name="use_sim_time", value=ParameterValue(type=1, bool_value=False))
    answer = talker.call("set_parameters", SetParameters, parameters=[off]).results[0]
    assert not answer.successful
    assert "chosen at the start" in answer.reason


def test_a_state_rate_above_the_control_rate_is_reported(
    unusual: tuple[BoardProcess, Talker],
) -> None:
    """What is in force is said at the start."""
    board, talker = unusual
    board.wait_for_output("state_rate 1000 Hz is above control_rate; 250 Hz is in force")
    answer = talker.change(state_rate=251.0)
    assert not answer.successful
    assert "at most control_rate, 250 Hz" in answer.reason
    assert talker.change(state_rate=100.0).successful


def test_qos_overrides_act_on_their_topic_only(unusual: tuple[BoardProcess, Talker]) -> None:
    """A subscription's reliability is overridden by its parameter, and no other's."""
    board, talker = unusual

    def reliability(topic: str) -> ReliabilityPolicy:
        topic = f"{board.name}/command/{topic}"
        (info,) = talker.node.get_subscriptions_info_by_topic(topic)
        policy: ReliabilityPolicy = info.qos_profile.reliability
        return policy

    name = talker.names[6]
    move = msg.PositionCommand(names=[name], positions=[0.1])
    talker.until_state(
        lambda: talker.command("command/position", move), lambda s: not s.motion_done[6]
    )
    talker.command("command/velocity", msg.VelocityCommand(names=[name], velocities=[0.1]))
    assert reliability("position") is ReliabilityPolicy.BEST_EFFORT
    assert reliability("velocity") is ReliabilityPolicy.RELIABLE


def test_the_first_screen_says_what_to_do(unusual: tuple[BoardProcess, Talker]) -> None:
    """The modes, and lines to paste."""
    board, _ = unusual
    board.wait_for_output("Stop with Ctrl-C")
    board.wait_for_output("cbctl move lbr_iiwa_joint_1=")
    board.wait_for_output("cbctl watch")


@pytest.mark.slow
def test_closed_output_and_full_disks_do_not_end_it(tmp_path: Path) -> None:
    """Without a reader, room for logs or a home directory the board runs too."""
    for stdout in ("closed", "/dev/full"):
        with free_domain() as domain:
            environment = child_environment(domain) | {"HOME": "/proc/nowhere"}
            environment.pop("ROS_LOG_DIR", None)
            environment["TMPDIR"] = str(tmp_path)
            if stdout == "closed":
                read, write = os.pipe()
                os.close(read)
            else:
                write = os.open(stdout, os.O_WRONLY)
            process = subprocess.Popen(NODE, env=environment, stdout=write, stderr=write)
            os.close(write)
            try:
                with ros_node(domain, "peer") as node:
                    talker = Talker(node, "/control_board")
                    assert talker.set_mode([], "nonsense").success is False
                    for _ in range(3):
                        talker.command("command/torque", msg.TorqueCommand(torques=[1.0] * 7))
                    assert talker.set_mode([], "posd").success
            finally:
                process.terminate()
                code = process.wait(GUARD)
            assert code == 0


@pytest.mark.slow
def test_ignored_commands_are_logged_once_a_second_with_their_count(
    unusual: tuple[BoardProcess, Talker],
) -> None:
    """P2 of the promises: what was ignored, why, how often, and what to do."""
    board, talker = unusual
    name = talker.names[2]
    message = msg.VelocityCommand(names=[name], velocities=[0.1])
    begun = time.monotonic()
    while time.monotonic() - begun < 2.5:  # which lasts longer on a busy machine
        talker.command("command/velocity", message)
        time.sleep(0.01)
    line = board.wait_for_output("ignored in the last 1 s")
    assert f"velocity reference for {name} ignored: mode is POSITION (" in line
    assert line.rstrip().endswith("it is accepted in vel, mix")
    seconds = time.monotonic() - begun
    assert board.output.count(f"velocity reference for {name}") <= 2 + seconds

# SPDX-License-Identifier: Apache-2.0
"""control_board_ros.testing: what users build their own integration tests on."""

from __future__ import annotations

import fcntl
import os
import socket
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from waiting import until

from control_board_ros.testing import (
    board_process,
    child_environment,
    free_domain,
    ros_node,
)
from control_board_ros.testing.process import flatten, yaml_line

pytestmark = pytest.mark.slow

pytest_plugins = ["pytester"]

FAKE = [sys.executable, "-c"]


def test_params_as_yaml() -> None:
    """Nested names are joined; values read back as they were, floats as floats."""
    assert flatten({"a": {"b": 1, "c": {"d": 2}}, "e": 3}) == {"a.b": 1, "a.c.d": 2, "e": 3}
    for value in (1, 1.0, 1e-5, 1e30, -2.5, True, "text", "12", "", [1.0, 2.5], ["a", "b"], []):
        read = yaml.safe_load(yaml_line(value))
        assert read == value
        assert type(read) is type(value)
    assert yaml_line(float("inf")) == ".inf"


def test_domains_are_held_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two at a time never get the same; a domain in use on the host is passed over."""
    monkeypatch.setenv("CONTROL_BOARD_TEST_DOMAINS", "100-101")
    with free_domain() as first:
        with free_domain() as second:
            assert {first, second} == {100, 101}
            match = "no free ROS domain in 100-101"
            with pytest.raises(AssertionError, match=match), free_domain():
                pass
        for participant in (0, 1, 31):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
                other.bind(("", 7410 + 250 * second + 2 * participant))
                with pytest.raises(AssertionError, match=match), free_domain():
                    pass
        with free_domain() as again:
            assert again == second


def test_the_environment_of_a_child(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the wheels left behind goes; what a sourced ROS 2 set stays."""
    monkeypatch.setenv("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "1")
    monkeypatch.setenv("LD_LIBRARY_PATH", f"{sys.prefix}/lib:/opt/other")
    monkeypatch.setenv("AMENT_PREFIX_PATH", sys.prefix)
    child = child_environment(42)
    assert "_ROS_WHEELS_BOOTSTRAP_COMPLETE" not in child
    assert child["LD_LIBRARY_PATH"] == "/opt/other"
    assert "AMENT_PREFIX_PATH" not in child
    assert child["ROS_DOMAIN_ID"] == "42"
    assert child["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    monkeypatch.delenv("_ROS_WHEELS_BOOTSTRAP_COMPLETE")
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/opt/ros/jazzy")
    child = child_environment(42)
    assert child["LD_LIBRARY_PATH"] == f"{sys.prefix}/lib:/opt/other"
    assert child["AMENT_PREFIX_PATH"] == "/opt/ros/jazzy"


def test_shared_memory_left_by_killed_processes(tmp_path: Path) -> None:
    """Removed where no process holds it: segments that are old, and ports of this domain."""
    from control_board_ros.testing.domains import sweep

    kept = {"fastrtps_held", "fastrtps_held_el", "fastrtps_young", "other"}
    kept |= {"fastrtps_port7410", "fastrtps_port7410_el", "fastrtps_port7900"}  # domains 0 and 2
    gone = {"fastrtps_a", "fastrtps_a_el", "fastrtps_b_el", "fastrtps_port7660"}
    gone |= {"sem.fastrtps_port7660_mutex", "fastrtps_port7899", "fastrtps_port7899_el"}
    for name in kept | gone:
        path = tmp_path / name
        path.touch()
        if name not in ("fastrtps_young", "fastrtps_port7660"):
            os.utime(path, (1.0, 1.0))
    with (tmp_path / "fastrtps_held_el").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        sweep(1, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == kept
    sweep(1, tmp_path / "not_there")


@pytest.mark.ros
def test_a_board_that_ends_early_reports_why() -> None:
    """The error has the exit code and what it printed."""
    program = "print('bad configuration'); raise SystemExit(2)"
    with (
        pytest.raises(AssertionError, match="ended with code 2") as raised,
        board_process(command=[*FAKE, program]),
    ):
        pass
    assert "bad configuration" in "".join(raised.value.__notes__)


@pytest.mark.ros
def test_a_board_that_does_not_answer() -> None:
    """No answer within the time to start; the process is gone afterwards."""
    program = "import os, time; print(os.getpid()); time.sleep(60)"
    command = [*FAKE, program]
    with (
        pytest.raises(AssertionError, match="no answer from /left/arm within 5 s") as raised,
        board_process(command=command, name="arm", namespace="left", start_timeout=5.0),
    ):
        pass
    pid = int("".join(raised.value.__notes__).splitlines()[1])
    assert not Path(f"/proc/{pid}").exists()


STUBBORN = """
import signal, sys, threading, rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from control_board_msgs.msg import JointModes
from control_board_msgs.srv import GetControlMode, SetControlMode
ended = threading.Event()
signal.signal(signal.SIGTERM, lambda *_: ended.set())
rclpy.init(args=sys.argv, signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
node = rclpy.create_node("stubborn")
for kind, name in ((GetControlMode, "get_control_mode"), (SetControlMode, "set_control_mode")):
    node.create_service(kind, "~/" + name, lambda request, response: response)
qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
node.create_publisher(JointModes, "~/modes", qos).publish(JointModes())
print("started", flush=True)
ended.wait()
raise SystemExit(3)
"""


@pytest.mark.ros
def test_the_exit_code_is_checked() -> None:
    """SIGTERM at the end, and the code that comes back is part of the test."""
    with board_process(command=[*FAKE, STUBBORN], exit_code=3) as board:
        assert board.wait_for_output("started") == "started\n"
        with pytest.raises(AssertionError, match="no line with 'nothing'"):
            board.wait_for_output("nothing", timeout=0.1)
    with (
        pytest.raises(AssertionError, match="the board returned 3, not 0"),
        board_process(command=[*FAKE, STUBBORN]),
    ):
        pass


@pytest.mark.ros
def test_nodes_of_tests() -> None:
    """Two contexts on one domain, in one process; messages of one reach the other."""
    from std_msgs.msg import String

    received: list[str] = []
    with free_domain() as domain, ros_node(domain, "a") as a, ros_node(domain, "b") as b:
        assert a.context is not b.context
        publisher = a.create_publisher(String, "word", 10)
        b.create_subscription(String, "word", lambda m: received.append(m.data), 10)

        def reached() -> bool:
            publisher.publish(String(data="hello"))
            return bool(received)

        until(reached, period=0.02)
    assert received[0] == "hello"


@pytest.mark.ros
@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("from control_board_ros.testing import control_board", ()),
        ("", ("-p", "control_board_ros.testing")),
    ],
    ids=["imported", "plugin"],
)
def test_the_fixture(pytester: Any, line: str, words: tuple[str, ...]) -> None:
    """A user's own test, as the documentation shows it; as a plugin, without a word of import."""
    pytester.makepyfile(
        f"""
        import pytest
        from control_board_ros.client import ControlBoardClient
        from control_board_ros.testing import ros_node
        {line}

        @pytest.fixture
        def control_board_options():
            return {{"params": {{"state_rate": 50.0}}, "name": "arm", "namespace": "left"}}

        def test_my_controller(control_board):
            assert control_board.name == "/left/arm"
            with ros_node(control_board.domain) as node:
                with ControlBoardClient(node, control_board.name, answer_timeout=60.0) as client:
                    assert client.set_control_mode(None, "vel")
        """
    )
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", *words)
    result.assert_outcomes(passed=1)

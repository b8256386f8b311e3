# SPDX-License-Identifier: Apache-2.0
"""The interface of the package against its golden copy, and against the definitions."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from control_board_ros import interface
from control_board_ros.interface import ENDPOINTS, YARP

ROOT = Path(__file__).resolve().parents[2]
#: A line of each endpoint: kind, name, type, and QoS of a topic (R reliable, B best effort; T
#: transient local, V volatile). A line that changes here changes for users.
GOLDEN = Path(__file__).with_name("interface.txt")


def line(endpoint: interface.Endpoint) -> str:
    qos = endpoint.qos
    letters = f" {'R' if qos.reliable else 'B'}{'T' if qos.latched else 'V'}"
    yarps = "yarp " if endpoint in YARP else ""
    topic = endpoint.kind in ("topic", "command")
    return f"{yarps}{endpoint.kind} {endpoint.name} {endpoint.type}{letters if topic else ''}"


def test_it_is_the_golden_copy() -> None:
    """Every name, type and QoS of the golden copy, and no other."""
    assert sorted(map(line, ENDPOINTS + YARP)) == sorted(GOLDEN.read_text().splitlines())


@pytest.mark.parametrize("endpoint", ENDPOINTS + YARP, ids=lambda e: e.name)
def test_types_load_and_meanings_are_sentences(endpoint: interface.Endpoint) -> None:
    package, kind, name = endpoint.type.split("/")
    loaded = endpoint.load()
    assert (loaded.__module__.split(".")[:2], loaded.__name__) == ([package, kind], name)
    assert endpoint.meaning.endswith(".") or endpoint in YARP


@pytest.mark.parametrize(
    "endpoint",
    [e for e in interface.SERVICES + interface.ACTIONS if e.type.startswith("control_board_msgs")],
    ids=lambda e: e.name,
)
def test_definitions_begin_with_the_meaning(endpoint: interface.Endpoint) -> None:
    """What ``ros2 interface show`` says first."""
    _, kind, name = endpoint.type.split("/")
    text = (ROOT / "msg_defs" / kind / f"{name}.{kind}").read_text("utf-8")
    comment = text.partition("\n\n")[0].replace("\n# ", " ").removeprefix("# ")
    assert comment.startswith(endpoint.meaning)


def test_names_on_ros() -> None:
    """~/x is below the board's name, x in its namespace, /x absolute."""
    board = "/icub/left_arm"
    assert interface.MODES.of(board) == "/icub/left_arm/modes"
    assert interface.JOINT_STATES.of(board) == "/icub/joint_states"
    assert interface.JOINT_STATES.of("/control_board") == "/joint_states"
    assert interface.JOINT_STATES.of("control_board") == "joint_states"
    assert interface.CLOCK.of(board) == "/clock"
    assert interface.POSITION_COMMAND.short == "command/position"


def test_each_caller_gets_its_own_profile() -> None:
    """Each caller gets a new one: rclpy writes overrides into the profile it is given."""
    profile = interface.LATCHED.profile()
    assert profile is not interface.LATCHED.profile()
    assert (profile.depth, profile.durability.name) == (1, "TRANSIENT_LOCAL")
    assert interface.NEWEST.profile().reliability.name == "BEST_EFFORT"


def test_importing_it_imports_no_message() -> None:
    """So that a command line that only prints its help starts at once."""
    program = (
        "import sys, control_board_ros.interface;"
        "print([m for m in sys.modules if 'msgs' in m or m.startswith(('rclpy', 'numpy'))])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout == "[]\n"

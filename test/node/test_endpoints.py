# SPDX-License-Identifier: Apache-2.0
"""The interface of the package against its golden copy, and against the definitions."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import interface_table as golden
import pytest

from control_board_ros import interface
from control_board_ros.interface import ENDPOINTS, YARP, QoS

ROOT = Path(__file__).resolve().parents[2]
#: How the golden copy writes QoS: R reliable, B best effort; V volatile, T transient local.
LETTERS = {True: "R", False: "B"}, {True: "T", False: "V"}


def letters(qos: QoS) -> str:
    reliability, durability = LETTERS
    return reliability[qos.reliable] + durability[qos.latched]


def test_it_is_the_golden_copy() -> None:
    """Every name, type and QoS of the golden copy, and no other."""
    for table, endpoints in (
        (golden.PUBLISHED | golden.CLOCK | golden.TF, interface.PUBLISHED),
        (golden.SUBSCRIBED, interface.COMMAND_TOPICS),
        (golden.YARP_PUBLISHED, [e for e in interface.YARP if e.kind == "topic"]),
        (golden.YARP_SUBSCRIBED, [e for e in interface.YARP if e.kind == "command"]),
    ):
        assert {e.name: (e.type, letters(e.qos)) for e in endpoints} == table
    for table, endpoints in (
        (golden.SERVICES, interface.SERVICES),
        (golden.ACTIONS, interface.ACTIONS),
        (golden.YARP_SERVICES, [e for e in interface.YARP if e.kind == "service"]),
    ):
        assert {e.name: e.type for e in endpoints} == table


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

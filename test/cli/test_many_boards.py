# SPDX-License-Identifier: Apache-2.0
"""``--board`` with a pattern, and watching more joints than a terminal has lines."""

from __future__ import annotations

from contextlib import ExitStack, closing
from types import SimpleNamespace
from typing import Any

import cbctl_terminal
import pytest
from cbctl_process import Cbctl, until
from rich.text import Text

from control_board_ros.cli.app import for_several
from control_board_ros.cli.board.boards import is_pattern, robots_among
from control_board_ros.cli.board.session import Session
from control_board_ros.cli.line.options import Options
from control_board_ros.cli.line.words import short_names
from control_board_ros.cli.verbs.watch import DISPENSABLE, View, dense, fitting, on_screen
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.joint_limits import JointLimits
from control_board_ros.testing import board_process

PARTS = {
    "head": [f"neck_{k}" for k in range(3)],
    "torso": [f"torso_{k}" for k in range(3)],
    "left_arm": [f"l_wrist_pros_{k}" for k in range(7)],
    "right_arm": [f"r_wrist_pros_{k}" for k in range(7)],
    "left_leg": [f"l_ankle_{k}" for k in range(6)],
    "right_leg": [f"r_ankle_{k}" for k in range(6)],
}
EVERYONE = [name for names in PARTS.values() for name in names]
FAULT = "overcurrent, 23.9 A; the limit is 22 A"


def view(board: str, names: list[str], faulty: tuple[str, ...] = ()) -> View:
    """What was read of a board."""
    made: Any = object.__new__(View)
    made.board = board
    made.session = SimpleNamespace(kind=lambda _: JointKind.REVOLUTE, names=tuple(names))
    made._limits = dict.fromkeys(names, JointLimits(-3.0, 3.0, -3.1, 3.1, 2.0, 10.0, 100.0, 100.0))
    row = {
        "control_mode": "posd",
        "interaction_mode": "stif",
        "position": -2.9,
        "position_reference": -2.9,
        "torque": -125.51,
        "output": -100.0,
        "calibrated": True,
    }
    made.rows = {name: row | {"fault": FAULT if name in faulty else ""} for name in names}
    return made  # type: ignore[no-any-return]


def drawn(views: list[View], width: int, height: int) -> list[str]:
    """The lines that a terminal of this size shows."""
    return cbctl_terminal.drawn(on_screen(views, width, height), width).splitlines()


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 24), (160, 20), (200, 14)])
@pytest.mark.parametrize("split", [False, True], ids=["robot", "parts"])
def test_all_joints_are_seen(width: int, height: int, split: bool) -> None:
    """32 joints stand beside each other, with their modes and positions, and no line more."""
    views = [view(f"/icub/{part}", names) for part, names in PARTS.items()]
    lines = drawn(views if split else [view("/icub/robot", EVERYONE)], width, height)
    text = "\n".join(lines)
    assert len(lines) < height
    assert all(len(line) <= width for line in lines)
    for names in PARTS.values() if split else [EVERYONE]:
        for name in short_names(names).values():
            assert f"{name} " in text
    assert text.count("posd") == len(EVERYONE)
    assert text.count("-166.2°") >= len(EVERYONE)
    assert ("/icub/left_leg" in text) is split


def test_what_finds_no_room_is_told() -> None:
    """And never a line more than the terminal has."""
    lines = drawn([view("/icub/robot", EVERYONE)], 40, 12)
    assert len(lines) < 12
    assert lines[-1].startswith("… 24 lines more: a larger")


def test_faults_stand_below() -> None:
    """Three lines of them at most; the last counts the rest."""
    lines = drawn([view("/icub/robot", EVERYONE, tuple(EVERYONE[:2]))], 80, 24)
    assert lines[-2:] == [f"{name}: {FAULT}" for name in EVERYONE[:2]]
    lines = drawn([view("/icub/robot", EVERYONE, tuple(EVERYONE))], 80, 24)
    assert lines[-1] == "… 30 more in fault: cbctl faults"
    assert len(lines) < 24


def test_a_high_terminal_shows_the_table_as_ever() -> None:
    """One below the other, with all columns."""
    lines = drawn([view("/icub/robot", EVERYONE)], 120, 60)
    assert len(lines) == len(EVERYONE) + 2
    assert "its limits" in lines[0]


def test_columns_go_in_their_order() -> None:
    """Those that are not worth a joint's place go first."""
    columns = {title: [Text("x" * 10)] * 20 for title in ("joint", *DISPENSABLE)}
    assert fitting(columns, DISPENSABLE, 200, 30) == (columns, 2)
    kept, blocks = fitting(columns, DISPENSABLE, 80, 12)
    assert (list(kept), blocks) == (["joint", "torque", "int."], 2)
    assert dense(columns, (), (), 10, 12)[1] == 10


def test_a_robot_is_what_its_parts_are() -> None:
    """R1, R3: left out where they are shown; two boards alike are no robot of each other."""
    icub = {f"/icub/{part}": names for part, names in PARTS.items()}
    assert robots_among(icub | {"/icub/robot": EVERYONE}) == {"/icub/robot"}
    assert robots_among(icub) == set()
    assert robots_among({"/a/board": ["x", "y"], "/b/board": ["x", "y"]}) == set()
    assert robots_among({"/a": ["x"], "/b": ["y"], "/c/all": ["x", "y"]}) == set()
    assert robots_among({"/a": ["x"], "/b": ["x"]}) == set()


def test_what_a_pattern_is_and_who_takes_it() -> None:
    assert [is_pattern(name) for name in ("/icub/*", "arm?", "/[ab]/x", "/icub/head")] == [
        True,
        True,
        True,
        False,
    ]
    accepted = {"modes", "watch", "info", "references", "faults", "poses", "record"}
    accepted |= {"clear", "recover", "estop", "stop"}
    assert set(for_several()) == accepted


def test_a_verb_for_one_board_says_so(alone: Cbctl) -> None:
    """Exit code 2, before anything is looked for."""
    done = alone("--board", "/icub/*", "move", "0=1")
    assert done.code == 2
    assert "move is for one board, and --board /icub/* may be several" in done.err
    assert "For several: modes, watch, info" in done.err


@pytest.mark.ros
@pytest.mark.slow
def test_two_boards() -> None:
    """A table below each name, JSON by board, one verb for both; the boards are discovered."""
    arm, two = {"joints": ["lbr_iiwa_joint_1"]}, {"robot": "panda"}
    with (
        board_process(arm, namespace="a") as first,
        board_process(two, namespace="b", domain=first.domain),
        ExitStack() as stack,
    ):
        cbctl = stack.enter_context(closing(Cbctl(first.environment)))
        shown = cbctl("--board", "/*/control_board", "modes")
        assert (shown.code, shown.err) == (0, "")
        head, tail = shown.out.split("\n\n")
        assert head.startswith("/a/control_board\n")
        assert "lbr_iiwa_joint_1  pos" in head
        assert tail.startswith("/b/control_board\n")
        assert "panda_finger_joint1  pos" in tail
        read = cbctl("--board", "*", "--json", "modes", "finger").json
        assert list(read) == ["/b/control_board"]
        read = cbctl("--board", "*", "--json", "stop").json
        assert [one["success"] for one in read.values()] == [True, True]
        watched = cbctl("--board", "*", "watch", "--once", "--json").json
        assert set(watched["/a/control_board"]) == {"lbr_iiwa_joint_1"}
        assert len(watched["/b/control_board"]) == 8
        nobody = cbctl("--board", "*", "modes", "elbow")
        assert nobody.code == 1
        assert "'elbow' unknown" in nobody.err
        assert cbctl("--board", "/a/control_board", "mode", "vel").code == 0
        environment = cbctl.environment | {"COMP_WORDS": "cbctl --board /b", "COMP_CWORD": "2"}
        tab = Cbctl(environment | {"_CBCTL_COMPLETE": "bash"})
        until(lambda: tab.run().out.split() == ["/b/control_board"])  # Tab gives up soon


@pytest.mark.parametrize(
    ("options", "shown"),
    [
        (Options(), "cbctl mode all pos"),
        (
            Options(board="/icub/left_arm", domain=3),
            "cbctl --board /icub/left_arm --domain 3 mode all pos",
        ),
        (Options(namespace="/left"), "cbctl --namespace /left mode all pos"),
    ],
)
def test_the_next_step_is_for_the_board_that_is_meant(options: Options, shown: str) -> None:
    """As one types it; in the shell, which has the board already, without its name."""
    session = Session(options)
    assert session.line("mode", "all", "pos") == shown
    session.shared = True
    assert session.line("mode", "all", "pos") == "cbctl mode all pos"

# SPDX-License-Identifier: Apache-2.0
"""What Tab offers, in the shell of cbctl and in others."""

from __future__ import annotations

import pytest

from control_board_ros.cli.completion import complete, line_offers, offers
from control_board_ros.cli.verbs import VERBS as ALL_VERBS
from control_board_ros.cli.verbs import load
from control_board_ros.cli.verbs.modes import MODE_CODES
from control_board_ros.cli.verbs.terminal import HELP, LEAVE

IIWA = [f"lbr_iiwa_joint_{j}" for j in range(1, 4)]
SHORT = ["joint_1", "joint_2", "joint_3"]
VERBS = ["modes", "mode", "move", "info", "interaction"]


def test_modes_are_those_that_can_be_set() -> None:
    """M6: no status is offered."""
    assert MODE_CODES == (
        "pos", "posd", "vel", "mix", "torq", "open", "idl", "veld", "icur", "fidl",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", [*VERBS, "help", "?", "exit", "quit"]),
        ("mo", ["modes", "mode", "move"]),
        ("qu", ["quit"]),
        ("help mov", ["move"]),
        ("cbctl mov", ["move"]),
        ("move ", [f"{name}=" for name in SHORT]),
        ("move joint_1=3 j", [f"{name}=" for name in SHORT]),
        ("move lbr_iiwa_joint_2", ["lbr_iiwa_joint_2="]),
        ("mode ", [*SHORT, "all"]),
        ("mode 4 ", list(MODE_CODES)),
        ("mode 4 po", ["pos", "posd"]),
        ("mode 4 joint_", SHORT),
        ("interaction all ", ["stif", "comp"]),
        ("modes joint_3", ["joint_3"]),
        ("info ", []),
        ("nonsense ", []),
    ],
)
def test_a_line_of_the_shell(line: str, words: list[str]) -> None:
    assert line_offers(line, VERBS, load, IIWA, (*HELP, *LEAVE)) == words


def test_poses() -> None:
    """Those of the board, or save; a new name is nobody's to offer; then joints."""
    poses = ("home", "park")
    known = ["pose", "home"]
    for line, words in {
        "pose ": ["home", "park", "save"],
        "pose s": ["save"],
        "pose home ": [],
        "pose save ": [],
        "pose save here joint_2": ["joint_2"],
        "home ": [],
    }.items():
        assert line_offers(line, known, load, IIWA, (*HELP, *LEAVE), lambda: poses) == words


def test_a_fault_follows_joints() -> None:
    assert offers(load("inject"), ["joint_1"], "e", lambda: IIWA) == ["encoder", "external"]
    assert offers(load("inject"), [], "", lambda: IIWA) == [*SHORT, "all"]
    assert offers(load("move"), [], "--", lambda: IIWA) == []


def test_one_joint() -> None:
    """Verbs that measure one joint offer joints, and not all."""
    assert offers(load("step"), [], "", lambda: IIWA) == SHORT
    assert offers(load("chirp"), [], "joint_2", lambda: IIWA) == ["joint_2"]


def test_signals() -> None:
    """A joint, then what it has; or a kind of all joints."""
    assert offers(load("plot"), [], "jo", lambda: IIWA) == [f"{name}." for name in SHORT]
    assert offers(load("plot"), ["joint_1.torque"], "joint_2.po", lambda: IIWA) == [
        "joint_2.position",
        "joint_2.position_reference",
    ]
    assert offers(load("plot"), [], "cu", lambda: IIWA) == ["current"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("cbctl mo", ["modes", "mode", "move"]),
        ("cbctl --json mo", ["modes", "mode", "move"]),
        ("cbctl --b", ["--board"]),
        ("cbctl impedance --s", ["--stiffness"]),
        ("cbctl impedance 0 --d", ["--damping", "--domain"]),
        ("cbctl completion z", ["zsh"]),
        ("cbctl pause x", []),
        ("cbctl mode 4 po", ["pos", "posd"]),
        ("cbctl param s", ["show", "set", "save"]),
        ("cbctl report x", []),
        ("cbctl nonsense x", []),
        ("cbctl --board x", []),
        ("cbctl --timeout x mo", []),
    ],
)
def test_what_needs_no_board(
    capsys: pytest.CaptureFixture[str], line: str, words: list[str]
) -> None:
    """Verbs, options, shells; nothing where the value of an option is typed, or is wrong."""
    environment = {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split()) - 1)}
    assert complete(environment, list(ALL_VERBS), load) == 0
    assert capsys.readouterr().out.split() == words

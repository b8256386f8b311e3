# SPDX-License-Identifier: Apache-2.0
"""What Tab offers, in the shell of cbctl and in others."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from iiwa import JOINTS

from control_board_ros.cli.board.session import Session
from control_board_ros.cli.completion import complete
from control_board_ros.cli.line.options import Options
from control_board_ros.cli.verbs import VERBS
from control_board_ros.cli.verbs.modes import MODE_CODES
from control_board_ros.cli.verbs.terminal import line_offers

SHORT = ["joint_1", "joint_2", "joint_3"]


@pytest.fixture
def session() -> Session:
    """A session of a board with three joints and two poses."""
    session: Any = Session(Options())
    session.client = SimpleNamespace(names=JOINTS[:3], list_poses=lambda: ["home", "park"])
    return session  # type: ignore[no-any-return]


def test_modes_are_those_that_can_be_set() -> None:
    """M6: no status is offered."""
    assert MODE_CODES == (
        "pos", "posd", "vel", "mix", "torq", "open", "idl", "veld", "icur", "fidl",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", [*(verb for verb in VERBS if verb != "shell"), "help", "?", "exit", "quit"]),
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
        # poses, or save; a new name cannot be offered; then joints
        ("pose ", ["home", "park", "save"]),
        ("pose s", ["save"]),
        ("pose home ", []),
        ("pose save ", []),
        ("pose save here joint_2", ["joint_2"]),
        ("home ", []),
        ("inject joint_1 e", ["encoder", "external"]),
        ("inject ", [*SHORT, "all"]),
        ("move --", []),
        # verbs that measure one joint: not all
        ("step ", SHORT),
        ("chirp joint_2", ["joint_2"]),
        # a joint, then what it has; or a kind of all joints
        ("plot jo", [f"{name}." for name in SHORT]),
        ("plot joint_1.torque joint_2.po", ["joint_2.position", "joint_2.position_reference"]),
        ("plot cu", ["current"]),
    ],
)
def test_a_line_of_the_shell(session: Session, line: str, words: list[str]) -> None:
    assert line_offers(session, line) == words


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
def test_completions_without_a_board(
    capsys: pytest.CaptureFixture[str], line: str, words: list[str]
) -> None:
    """Verbs, options, shells; nothing where the value of an option is typed, or is wrong."""
    environment = {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split()) - 1)}
    assert complete(environment) == 0
    assert capsys.readouterr().out.split() == words

# SPDX-License-Identifier: Apache-2.0
"""Sessions of the conformance suite on boards that tests start, right ones and wrong ones."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from servo_arm import PARAMETERS as SERVOS

from control_board_ros.conformance import Outcome, Result
from control_board_ros.conformance.bench import Permissions
from control_board_ros.conformance.channel import Channel
from control_board_ros.conformance.rules import in_order
from control_board_ros.conformance.runner import Session, run, unread
from control_board_ros.conformance.shapes import Malformed
from control_board_ros.testing import BoardProcess, board_process

HERE = Path(__file__).parent
ARM, LAUNCHER = HERE / "arm.yaml", HERE / "wrong_boards.py"
RATE = {"state_rate": 100.0}
#: Of a board that drives: the arm with gains that each drive holds, and the SO-101 of servos.
DRIVEN = RATE | {
    "control_rate": 200.0,
    "plant_timeout": 1.0,
    "joint_defaults.position_pid.kp": 200.0,
    "joint_defaults.position_pid.kd": 4.0,
}
#: Boards that are tried from outside: a simulated arm, and the virtual drives of each make.
BOARDS: dict[str, dict[str, Any]] = {
    "simulated": RATE | {"control_rate": 250.0},
    "moteus": DRIVEN | {"plant": "virtual/moteus"},
    "damiao": DRIVEN | {"plant": "virtual/mit_can"},
    "robstride": DRIVEN | {"plant": "virtual/mit_can", "plant_arguments": ["model=rs03"]},
    "odrive_can": DRIVEN | {"plant": "virtual/odrive_can"},
    "cia402": DRIVEN | {"plant": "virtual/cia402"},
    "dynamixel": SERVOS | {"plant": "virtual/dynamixel"},
    "feetech": SERVOS | {"plant": "virtual/feetech"},
}


@contextlib.contextmanager
def session_on(board: BoardProcess, **options: Any) -> Iterator[Session]:
    from control_board_ros.client import ControlBoardClient
    from control_board_ros.testing import ros_node

    with (
        ros_node(board.domain, "conformance", spin=False) as node,
        ControlBoardClient(node, board.name, find_timeout=30.0, answer_timeout=30.0) as client,
        contextlib.closing(Session(Channel(node, board.name, 30.0), client, **options)) as session,
    ):
        yield session


def tried(
    board: BoardProcess, names: Sequence[str] | None = None, **options: Any
) -> dict[str, Result]:
    """Run rules on a board: the results by rule."""
    rules = [rule for rule in in_order() if names is None or rule.name in names]
    try:
        with session_on(board, **options) as session:
            results, problems = run(session, rules)
    except Malformed as error:
        results, problems = unread(rules, error), []
    assert not problems
    return {result.rule.name: result for result in results}


def tried_on(name: str) -> dict[str, tuple[str, str]]:
    """Outcome and evidence by rule, of all that may be tried, on one of BOARDS.

    What a busy machine was too slow for is tried again, twice.
    """
    allowed = Permissions(calibrate=True, power_cycle=True)
    found, left = dict[str, Result](), None
    with board_process(BOARDS[name], config=None if "robot" in BOARDS[name] else ARM) as board:
        for _ in range(3):
            found |= tried(board, left, allowed=allowed, rule_time=300.0)
            left = [rule for rule, r in found.items() if r.outcome is Outcome.NOT_TESTED]
            if not left:
                break
    return {rule: (str(result.outcome), result.evidence) for rule, result in found.items()}


def wrong_board(*names: str) -> Any:
    """The process of a board with these things broken."""
    return board_process(
        RATE, config=ARM, command=[sys.executable, str(LAUNCHER), "+".join(names)]
    )


def not_held(results: dict[str, Result]) -> dict[str, str]:
    return {n: r.evidence for n, r in results.items() if r.outcome is Outcome.NOT_HELD}

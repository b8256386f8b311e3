# SPDX-License-Identifier: Apache-2.0
"""Sessions of the conformance suite on boards that tests start, right ones and wrong ones."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from control_board_ros.conformance import Outcome, Result
from control_board_ros.conformance.channel import Channel
from control_board_ros.conformance.rules import in_order
from control_board_ros.conformance.runner import Session, run, unread
from control_board_ros.conformance.shapes import Malformed
from control_board_ros.testing import BoardProcess, board_process

HERE = Path(__file__).parent
ARM, LAUNCHER = HERE / "arm.yaml", HERE / "wrong_boards.py"
RATE = {"state_rate": 100.0}


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


def wrong_board(*names: str) -> Any:
    """The process of a board with these things broken."""
    return board_process(
        RATE, config=ARM, command=[sys.executable, str(LAUNCHER), "+".join(names)]
    )


def not_held(results: dict[str, Result]) -> dict[str, str]:
    return {n: r.evidence for n, r in results.items() if r.outcome is Outcome.NOT_HELD}

# SPDX-License-Identifier: Apache-2.0
"""The boards selected by a pattern, for verbs that run on several."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from ..line.words import Refused
from .only_board import GATHERING, POLL

if TYPE_CHECKING:
    from .session import Session


def is_pattern(board: str) -> bool:
    return any(mark in board for mark in "*?[")


@contextmanager
def sessions_meant(session: Session, joints: Sequence[str] = ()) -> Iterator[dict[str, Session]]:
    """A session for each board that ``--board`` selects, by the board's name, in their order.

    A robot of several parts is left out where its parts are selected as well.

    Args:
        session: of the command line; returned itself for a single board.
        joints: words for joints; boards without such joints are left out.

    Raises:
        Refused: no board fits, or none has such joints.
    """
    if not is_pattern(session.options.board):
        yield {session.options.board: session}
        return
    with ExitStack() as stack:
        sessions = {
            board: stack.enter_context(session.beside(board)) for board in boards_meant(session)
        }
        wholes = robots_among({board: s.names for board, s in sessions.items()})
        refusals, kept = [], {}
        for board, each in sessions.items():
            if board in wholes:
                continue
            try:
                each.joints(joints)
            except Refused as refusal:
                refusals.append(refusal)
            else:
                kept[board] = each
        if not kept:
            raise refusals[0]
        yield kept


def robots_among(boards: Mapping[str, Sequence[str]]) -> set[str]:
    """Boards whose joints are those of the boards beside them: robots of several parts.

    Args:
        boards: the joints of each, by its absolute name.
    """
    robots = set()
    for board, names in boards.items():
        folder = board.rpartition("/")[0]
        beside = [
            other
            for name, other in boards.items()
            if name != board and name.rpartition("/")[0] == folder
        ]
        joints = [joint for other in beside for joint in other]
        if len(beside) > 1 and len(joints) == len(names) and set(joints) == set(names):
            robots.add(board)
    return robots


def boards_meant(session: Session) -> list[str]:
    """Absolute names of the boards that ``--board`` selects, also by a pattern: ``/icub/*``.

    Raises:
        Refused: no board fits the pattern.
    """
    asked = session.options.board
    if not is_pattern(asked):
        return [asked]
    node = session.node
    from control_board_ros.client.ros_link import boards_on

    pattern = node.resolve_topic_name("x").rpartition("/")[0] + "/" + asked
    pattern = asked if asked.startswith("/") else pattern
    deadline = time.monotonic() + session.options.timeout
    boards: list[str] = []
    while time.monotonic() < deadline:
        now = [name for name in boards_on(node) if fnmatchcase(name, pattern)]
        if now and now == boards:
            return boards
        boards = now
        time.sleep(GATHERING if boards else POLL)
    there = ", ".join(boards_on(node)) or "none"
    raise Refused(f"no board fits {pattern}; boards there are: {there}")

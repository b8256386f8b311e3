# SPDX-License-Identifier: Apache-2.0
"""The boards selected by a pattern, for verbs that run on several."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from fnmatch import fnmatchcase
from threading import Thread
from typing import TYPE_CHECKING

from ..line.words import Refused
from .only_board import GATHERING, POLL

if TYPE_CHECKING:
    from .session import Session


def is_pattern(board: str) -> bool:
    return any(mark in board for mark in "*?[")


@contextmanager
def sessions_meant(
    session: Session,
    joints: Sequence[str] = (),
    request: Callable[[Session], None] | None = None,
) -> Iterator[dict[str, Session]]:
    """A session for each board that ``--board`` selects, by the board's name, in their order.

    A robot of several parts is left out where its parts are selected as well.

    Args:
        session: of the command line; returned itself for a single board.
        joints: words for joints; boards without such joints are left out.
        request: made of each board as soon as it is found, in a thread; the caller makes it again,
            and tells its errors.

    Raises:
        Refused: no board fits, or none has such joints.
    """
    if not is_pattern(session.options.board):
        yield {session.options.board: session}
        return
    with ExitStack() as stack:
        found: dict[str, Session] = {}
        for board in boards_found(session):
            each = found[board] = stack.enter_context(session.beside(board))
            if request is not None:
                _ = each.client  # one for both threads
                Thread(target=tried, args=(request, each), daemon=True).start()
        sessions = {board: found[board] for board in sorted(found)}
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


def tried(request: Callable[[Session], None], session: Session) -> None:
    """A request, whose errors the one that follows tells."""
    with suppress(Exception):
        request(session)


def boards_meant(session: Session) -> list[str]:
    """Absolute names of the boards that ``--board`` selects, also by a pattern: ``/icub/*``.

    Raises:
        Refused: no board fits the pattern.
    """
    return sorted(boards_found(session))


def boards_found(session: Session) -> Iterator[str]:
    """The same, each as soon as it is found; the last one GATHERING before the end.

    Raises:
        Refused: no board fits the pattern.
    """
    asked = session.options.board
    if not is_pattern(asked):
        yield asked
        return
    node = session.node
    from control_board_ros.client.ros_link import boards_on

    pattern = node.resolve_topic_name("x").rpartition("/")[0] + "/" + asked
    pattern = asked if asked.startswith("/") else pattern
    end = time.monotonic() + session.options.timeout
    found = set[str]()
    while time.monotonic() < end:
        for board in boards_on(node):
            if board not in found and fnmatchcase(board, pattern):
                yield board
                found.add(board)
                end = time.monotonic() + GATHERING
        time.sleep(POLL)
    if not found:
        there = ", ".join(boards_on(node)) or "none"
        raise Refused(f"no board fits {pattern}; boards there are: {there}")

# SPDX-License-Identifier: Apache-2.0
"""Where the time of a board's control cycles goes, as its diagnostics say."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from typing import Any

from ...interface import DIAGNOSTICS
from ..line.words import Refused
from .session import Session

#: Beginnings of the keys' second words in diagnostics, "read, mean (µs)".
FIGURES = ("mean", "worst", "longest cycle")
#: s without diagnostics, which come each second.
SILENCE = 5.0

#: Figure in µs by name, by phase of a cycle.
Phases = dict[str, dict[str, float]]


def phases_of(statuses: Iterator[Any], board: str) -> Phases:
    """The figures of a board, or of the robot that it is a part of; empty: none are there.

    Args:
        statuses: of diagnostics.
        board: its absolute name.
    """
    board_name = board.strip("/")
    loops = {f"{name}: loop" for name in (board_name, board_name.rpartition("/")[0])}
    phases: Phases = {}
    for pair in (pair for status in statuses if status.name in loops for pair in status.values):
        phase, _, figure = pair.key.removesuffix(" (µs)").partition(", ")
        if figure in FIGURES:
            phases.setdefault(phase, {})[figure] = float(pair.value)
    return phases


@contextlib.contextmanager
def timed_cycles(session: Session) -> Iterator[Iterator[Phases]]:
    """The figures of each second; the board times its cycles within this.

    Raises:
        Refused: the board does not time them, or nothing comes.
    """
    client = session.client
    before = client.get_parameters(["timing"])["timing"]
    try:  # Ctrl-C may arrive between the change and its reply
        if not before and not (reply := client.set_parameters({"timing": True})):
            raise Refused(reply.message)
        yield figures(session)
    finally:
        if not before:
            client.set_parameters({"timing": False})


def figures(session: Session) -> Iterator[Phases]:
    """The figures of each second, as they come."""
    from rclpy.executors import SingleThreadedExecutor

    board, node, arrays = session.client.board_name, session.node, list[Any]()
    topic = DIAGNOSTICS.of(board)
    subscription = node.create_subscription(
        DIAGNOSTICS.load(), topic, arrays.append, DIAGNOSTICS.qos.profile()
    )
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    try:
        last = time.monotonic()
        while time.monotonic() < last + SILENCE:
            executor.spin_once(timeout_sec=0.1)
            while arrays:
                if phases := phases_of(arrays.pop(0).status, board):
                    last = time.monotonic()
                    yield phases
        raise Refused(f"no timing of {board} came on {topic} for {SILENCE:g} s")
    finally:
        executor.remove_node(node)
        executor.shutdown()
        node.destroy_subscription(subscription)

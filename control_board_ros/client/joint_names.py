# SPDX-License-Identifier: Apache-2.0
"""Joint names of the board, from its ~/modes messages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from control_board_ros.core.selection import RequestError, Selector
from control_board_ros.interface import MOST_JOINTS
from control_board_ros.text import clean_names


def joint_names(names: Sequence[str]) -> tuple[str, ...]:
    """The joint names of a message, sanitised.

    Raises:
        RequestError: the names are invalid; the message is ignored.
    """
    if len(names) > MOST_JOINTS:
        raise RequestError(f"a message of {len(names)} joints is left out; {MOST_JOINTS} at most")
    known = clean_names(names)
    if len(set(known)) != len(known) or not all(known):
        raise RequestError("a message with a joint of no name, or of another's, is left out")
    return known


class JointNames:
    """The joints of the last message, updated by the link's thread.

    Attributes: selector (None before the first message).
    """

    def __init__(self) -> None:
        self.selector: Selector | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """In board order; empty before the first message."""
        return self.selector.names if self.selector is not None else ()

    def on_message(self, message: Any) -> None:
        """Process a JointModes message; a restarted board may have other joints."""
        names = joint_names(message.names)
        if names != self.names:
            self.selector = Selector(names)

# SPDX-License-Identifier: Apache-2.0
"""Which joints the board has, from its ~/modes messages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from control_board_ros.core.selection import RequestError, Selector
from control_board_ros.interface import MOST_JOINTS
from control_board_ros.text import clean_names


def joint_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names of a board's joints, made safe to show.

    Raises:
        RequestError: a board has no such names; what is heard with them is left out.
    """
    if len(names) > MOST_JOINTS:
        raise RequestError(f"a message of {len(names)} joints is left out; {MOST_JOINTS} at most")
    known = clean_names(names)
    if len(set(known)) != len(known) or not all(known):
        raise RequestError("a message with a joint of no name, or of another's, is left out")
    return known


class JointNames:
    """The joints last heard of, kept up by the link's thread.

    Attributes: selector (of the joints; None before the first message).
    """

    def __init__(self) -> None:
        self.selector: Selector | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """In the board's order; empty before the first message."""
        return self.selector.names if self.selector is not None else ()

    def on_message(self, message: Any) -> None:
        """Take a JointModes message; a board that was started anew may have other joints."""
        names = joint_names(message.names)
        if names != self.names:
            self.selector = Selector(names)

# SPDX-License-Identifier: Apache-2.0
"""What a client needs of its connection to a board: over ROS, or in the same process."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any, Protocol

from control_board_ros.core.terms.reply import Reply
from control_board_ros.interface import Endpoint

from .errors import BoardNotFound, BoardTimeout
from .state import State

#: Success, message and codes of a goal's result.
Outcome = tuple[bool, str, Sequence[str]]


class Link(Protocol):
    """A connection to one board.

    Attributes: name (of the board, absolute), find_timeout and answer_timeout (s), gone (the
    exceptions raised where the connection has ended).
    """

    name: str
    find_timeout: float
    answer_timeout: float
    gone: tuple[type[Exception], ...]

    def close(self) -> None:
        """End the connection; calls that wait raise BoardError."""

    def wake_user(self) -> None:
        """Wake the executor in which a user's coroutine waits."""

    def log_warning(self, text: str) -> None:
        """Log to the user's program."""

    def is_there(self) -> bool:
        """Whether the board is present now."""

    def not_found(self, after: float | None = None) -> BoardNotFound: ...

    def timed_out(self, endpoint: Endpoint, after: float | None = None) -> BoardTimeout: ...

    def until(self, condition: Callable[[], bool], timeout: float | None) -> Awaitable[bool]:
        """Wait until the condition holds; false after ``timeout`` s."""

    def call(self, service: Endpoint, **fields: Any) -> Awaitable[Any]:
        """The response of a service; references published before are in force when it answers."""

    def stop(self, service: Endpoint, **fields: Any) -> Awaitable[Any]:
        """The response of a stop, which waits for nothing else (E2)."""

    def check_asked(self, service: Endpoint, response: Any, count: int) -> None:
        """Reject the response of a getter without one entry for each of ``count`` joints."""

    def publish(self, topic: Endpoint, **fields: Any) -> Awaitable[None]:
        """Send a message on a command topic of the board."""

    def subscribe(self, topic: Endpoint, callback: Callable[..., None]) -> None:
        """Call back with each message of a topic."""

    def list_parameters(self) -> Awaitable[list[str]]:
        """Names of the board's parameters."""

    def get_parameters(self, names: Sequence[str]) -> Awaitable[list[Any] | None]:
        """Values, None where unset; None in all where one is unknown."""

    def set_parameters(
        self, values: Mapping[str, Any], present: Mapping[str, Any], /
    ) -> Awaitable[tuple[bool, str]]:
        """Set all or none, ``present`` their values now; returns success and why not."""


class States(Protocol):
    """The states of a board."""

    def changed(self) -> None:
        """Invalidate states from before a request."""

    def latest(self, *, fresh: bool = True) -> Awaitable[State]:
        """The last state; a fresh one includes the effect of earlier requests."""

    def following(self, timeout: float) -> Awaitable[State | None]:
        """The state after the last one; None after ``timeout`` s."""


class Goal(Protocol):
    """A goal of an action."""

    def run(
        self,
        fields: dict[str, Any],
        names: tuple[str, ...],
        feedback: Callable[[Any], None] | None,
        read: Callable[[Any], Any],
        *,
        to_the_end: bool = True,
        attended: bool = False,
    ) -> Awaitable[Reply]:
        """Send it and wait for the result, or for the first feedback.

        An interruption cancels the goal, which stops the joints.

        Args:
            fields: of the goal.
            names: of the joints concerned.
            feedback: called in the caller's thread.
            read: makes its argument of a feedback message.
            to_the_end: false: return at the first feedback.
            attended: send heartbeats of it, so that it ends with this program.
        """


#: Makes a goal: services, action, on_feedback, on_result, outcome.
GoalForm = Callable[..., Goal]

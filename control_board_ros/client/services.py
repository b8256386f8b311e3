# SPDX-License-Identifier: Apache-2.0
"""Which joints a request means, and the services that answer it: what the client's parts share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from control_board_ros.core.reply import Answer, Reply, refused
from control_board_ros.core.selection import RequestError, Selection, Selector
from control_board_ros.interface import Endpoint
from control_board_ros.protocols import Joints

from .link import Link
from .modes_view import ModesView
from .state import StateView
from .waiting import Steps


class Services:
    """The services of one board.

    Args:
        link: the connection.
        modes: what is known of joints and modes.
        states: what is known of the state.
    """

    def __init__(self, link: Link, modes: ModesView, states: StateView) -> None:
        self.link, self.modes, self.states = link, modes, states

    def find(
        self, timeout: float | None = None, also: Callable[[], bool] = lambda: True
    ) -> Steps[Selector]:
        """The board's joints, once it is found and what else is asked holds.

        Raises:
            BoardNotFound: not within the find timeout, or so many s.
        """
        patience = self.link.find_timeout if timeout is None else timeout
        found = yield from self.link.thread.until(lambda: self.modes.known() and also(), patience)
        if not found:
            raise self.link.discovery.not_found(patience)
        selector = self.modes.selector
        assert selector is not None
        return selector

    def select(self, joints: Joints) -> Steps[Selection]:
        """The joints meant.

        Raises:
            RequestError: an unknown joint, or one named twice.
        """
        selector = yield from self.find()
        return selector.select(joints)

    def call(self, service: Endpoint, selection: Selection, **fields: Any) -> Steps[Any]:
        """The response of a service that takes names."""
        return (yield from self.link.call(service, names=list(selection.names), **fields))

    def read(self, service: Endpoint, joints: Joints) -> Steps[Any]:
        """The response of a service that reads.

        Raises:
            RequestError: an unknown joint, or one named twice.
        """
        selection = yield from self.select(joints)
        response = yield from self.call(service, selection)
        if not response.success:
            raise RequestError(response.message)
        return response

    def change(self, service: Endpoint, selection: Selection, **fields: Any) -> Steps[Reply]:
        """The reply of a service that answers for each joint."""
        response = yield from self.call(service, selection, **fields)
        self.states.changed()
        return reply_of(response, selection)

    def trigger(self, service: Endpoint, **fields: Any) -> Steps[Reply]:
        """The reply of a service that concerns the whole board."""
        names = (yield from self.find()).names
        response = yield from self.link.call(service, **fields)
        self.states.changed()
        self.modes.doubt()
        return whole(response.success, response.message, names)


def reply_of(response: Any, selection: Selection) -> Reply:
    """The board's own answer for each joint; of none, where the request was wrong as a whole."""
    answers = tuple(Answer(text) for text in response.answers)
    names = selection.names if answers else ()
    reasons = tuple(response.reasons) if any(response.reasons) else ()
    return Reply(names, answers, response.message, reasons)


def whole(success: bool, message: str, names: tuple[str, ...]) -> Reply:
    """The reply of what succeeds or fails as a whole: one answer that holds for all joints."""
    if success:
        return Reply(names, (Answer.ACCEPTED,) * len(names), message)
    return refused(message, names)

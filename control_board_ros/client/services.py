# SPDX-License-Identifier: Apache-2.0
"""Joint selection and service calls, shared by the client's interfaces."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from enum import StrEnum
from typing import Any, TypeVar

import numpy as np

from control_board_ros.core.selection import RequestError, Selection, Selector, spread
from control_board_ros.core.terms.reply import Answer, Reason, Reply, refused
from control_board_ros.interface import MODES, Endpoint
from control_board_ros.protocols import Floats, Joints, Values
from control_board_ros.text import NAME, clean, count_of

from .errors import BoardError
from .link import Goal, GoalForm, Link, Outcome, States
from .state import CalibrationView, joint_names

Word = TypeVar("Word", bound=StrEnum)

#: Maximum characters of a message.
MAX_MESSAGE = 5000


class Services:
    """The services of one board.

    Args:
        link: the connection.
        states: of the board.
        goal: makes a goal of an action.

    Attributes: link, selector (the joints of the last ~/modes message; None before the first),
    states, calibrations (as last received), description (the URDF, once requested).
    """

    def __init__(self, link: Link, states: States, goal: GoalForm) -> None:
        self.link, self.states, self._goal = link, states, goal
        self.selector: Selector | None = None
        self.calibrations = CalibrationView()
        self.description: deque[str] = deque(maxlen=1)
        link.subscribe(MODES, self.on_modes)

    def on_modes(self, message: Any) -> None:
        """Process a JointModes message; a restarted board may have other joints."""
        names = joint_names(message.names)
        if self.selector is None or self.selector.names != names:
            self.selector = Selector(names)

    async def find(
        self, timeout: float | None = None, also: Callable[[], bool] = lambda: True
    ) -> Selector:
        """The board's joints, once it is found and ``also`` holds.

        Raises:
            BoardNotFound: not within ``timeout`` s (None: the find timeout).
        """
        patience = self.link.find_timeout if timeout is None else timeout
        discovered = await self.link.until(lambda: self.selector is not None and also(), patience)
        if not discovered:
            raise self.link.not_found(patience)
        assert self.selector is not None
        return self.selector

    async def select(self, joints: Joints) -> Selection:
        """Resolve joints.

        Raises:
            RequestError: an unknown joint, or one named twice.
        """
        selector = await self.find()
        return selector.select(joints)

    def refuse(self, joints: Joints, error: ValueError) -> Reply:
        """Refuse a request, for each joint that it names where the board's joints are known."""
        return self.selector.refuse(joints, error) if self.selector else refused(str(error))

    async def read(self, service: Endpoint, joints: Joints, **fields: Any) -> Any:
        """The response of a getter; ``fields``: others of the request.

        Raises:
            RequestError: an unknown joint, or one named twice.
            BoardError: the response is invalid.
        """
        selection = await self.select(joints)
        response = await self.link.call(service, names=list(selection.names), **fields)
        if not response.success:
            raise RequestError(clean(response.message, MAX_MESSAGE))
        self.link.check_asked(service, response, len(selection.names))
        return response

    async def change(
        self,
        service: Endpoint,
        joints: Joints,
        values: Mapping[str, Values | None] | None = None,
        **fields: Any,
    ) -> Reply:
        """The reply of a service with an answer per joint.

        Args:
            service: that changes joints.
            joints: target joints.
            values: by field, one for all joints or one each; None: the field is empty.
            fields: other fields of the request.

        Raises:
            RequestError: an unknown joint, one named twice, or values of another length.
        """
        names = (await self.select(joints)).names
        for field, entry in (values or {}).items():
            if entry is not None:
                fields[field] = spread(entry, len(names), field, one_for_all=True).tolist()
        reply, _ = await self.ask(service, names, **fields)
        return reply

    async def ask(
        self, service: Endpoint, names: Sequence[str], **fields: Any
    ) -> tuple[Reply, Any]:
        """The reply of a service with an answer per joint, and its response.

        Args:
            service: that changes joints.
            names: of the request, as sent; empty: the joints are those of the response.
            fields: other fields of the request.

        Raises:
            BoardError: the response is invalid.
        """
        response = await self.link.call(service, names=list(names), **fields)
        self.states.changed()
        return reply_of(response, tuple(names) or tuple(response.names)), response

    def goal(
        self,
        action: Endpoint,
        on_feedback: Callable[[Any], None] = lambda _: None,
        on_result: Callable[[Any], None] = lambda _: None,
        outcome: Callable[[Any], Outcome] = lambda r: (r.success, r.message, r.codes),
    ) -> Goal:
        """A goal of an action, to be run.

        Args:
            action: the action's endpoint.
            on_feedback: called with each feedback, in the link's thread.
            on_result: called with the result, likewise.
            outcome: reads a result: whether it succeeded, its message, and the codes of refusals.
        """
        return self._goal(self, action, on_feedback, on_result, outcome)

    async def stop(self, service: Endpoint, joints: Joints) -> Reply:
        """The reply of a stop of joints; it waits for nothing that names or all do not need (E2).

        Raises:
            RequestError: an unknown index of a joint, or one named twice.
        """
        several = [joints] if isinstance(joints, str) else joints
        if several is None or (
            isinstance(several, list | tuple) and all(isinstance(name, str) for name in several)
        ):
            names = tuple(several or ())
        else:
            names = (await self.select(joints)).names
        response = await self.link.stop(service, names=list(names))
        self.states.changed()
        return reply_of(response, names or (await self.find()).names)

    async def trigger(self, service: Endpoint, **fields: Any) -> Reply:
        """The reply of a service of the whole board."""
        names = (await self.find()).names
        response = await self.link.call(service, **fields)
        self.states.changed()
        return whole(response.success, response.message, names)


def arrays(response: Any, kind: type) -> dict[str, Floats]:
    """The fields of a response that a dataclass has, as arrays."""
    return {field.name: np.array(getattr(response, field.name), float) for field in fields(kind)}


def reply_of(response: Any, requested: tuple[str, ...]) -> Reply:
    """The board's answer per requested joint; none where the whole request was invalid.

    Raises:
        BoardError: the response is invalid.
    """
    answers = tuple(_word(Answer, text) for text in response.answers)
    if len(answers) not in (0, len(requested)):
        raise BoardError(f"{count_of(len(answers), 'answers')} came for {len(requested)} joints")
    names = requested if answers else ()
    reasons = tuple(map(clean, response.reasons)) if any(response.reasons) else ()
    codes = tuple(_word(Reason, code) for code in response.codes) if any(response.codes) else ()
    for field, entries in (("reasons", reasons), ("codes", codes)):
        if len(entries) not in (0, len(names)):
            raise BoardError(f"{count_of(len(entries), field)} came for {len(names)} joints")
    values = tuple(getattr(response, "values", ()))
    return Reply(names, answers, clean(response.message, MAX_MESSAGE), reasons, codes, values)


def whole(success: bool, message: str, names: tuple[str, ...], codes: Sequence[str] = ()) -> Reply:
    """The reply of a request that succeeds or fails as a whole.

    Raises:
        BoardError: a code is unknown.
    """
    message = clean(message, MAX_MESSAGE)
    if success:
        return Reply(names, (Answer.ACCEPTED,) * len(names), message)
    reply = refused(message, names)
    return replace(reply, codes=tuple(_word(Reason, code) for code in codes)) if codes else reply


def _word(kind: type[Word], text: str) -> Word:
    """Parse a word of the wire; raises BoardError for an unknown one."""
    try:
        return kind(text)
    except ValueError:
        words = f"{clean(text, NAME)!r} is no {kind.__name__.lower()}"
        raise BoardError(f"the board's answer is none: {words}") from None

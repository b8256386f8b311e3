# SPDX-License-Identifier: Apache-2.0
"""~/requests: requests to the board with their answers.

The executor's thread records them; the publishing thread makes and publishes the messages, so
that they delay no request; while nobody receives them, DELAY later, so that they do not compete
with the answer itself either.
"""

from __future__ import annotations

import json
import math
import time
from collections import deque
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any

from action_msgs.msg import GoalStatus

from ...interface import REQUEST_LOG, STEP, Endpoint
from ..loop.loop import Member
from .messages import set_stamp

#: Requests kept for a delayed publisher; older ones are lost.
MAX_ENTRIES = 1000
#: s from an answer until its message is made, while nobody receives it.
DELAY = 0.1
#: Most entries of an array, where the board has fewer joints; most characters of a text.
ENTRIES, CHARACTERS = 32, 500
GOAL_EVENTS = {
    GoalStatus.STATUS_SUCCEEDED: "succeeded",
    GoalStatus.STATUS_CANCELED: "canceled",
    GoalStatus.STATUS_ABORTED: "aborted",
}
#: Fields of a request that are joint names, and fields of a message without a name.
NAMES = ("names", "joint_names")
OF_RESPONSES = ("success", "message", "names", "answers", "reasons", "codes")


@dataclass(frozen=True, slots=True)
class Entry:
    """A request that was answered: of ``Request.msg``, its stamp, ns, and ``perf_counter``."""

    endpoint: Endpoint
    event: str
    request: Any
    response: Any
    success: bool
    message: str
    goal: str
    duration: float
    stamp: int
    noted: float


class RequestLog:
    """The requests to a board; ``publisher`` is rclpy's, of ~/requests."""

    def __init__(self, publisher: Any, member: Member) -> None:
        self._snapshots = member.snapshots
        self._longest = max(member.board.count, ENTRIES)
        self._entries: deque[Entry] = deque(maxlen=MAX_ENTRIES)
        self._publisher = publisher

    def note(
        self,
        endpoint: Endpoint,
        event: str,
        request: Any,
        response: Any,
        started: float,
        *,
        success: bool,
        message: str,
        goal: str = "",
    ) -> None:
        """Note an answer, fields as of ``Request.msg``; for the executor's thread.

        ``response`` is None while it is pending; ``started`` is in s of ``time.perf_counter``.
        """
        noted = time.perf_counter()
        self._entries.append(
            Entry(
                endpoint, event, request, response, success, message, goal,
                duration=noted - started, stamp=self._snapshots.now(), noted=noted,
            )
        )  # fmt: skip

    def answered(self, service: Endpoint, request: Any, response: Any, started: float) -> None:
        """Note the answer of a service that is not among those left out."""
        if not left_out(service):
            success, message = bool(response.success), getattr(response, "message", "")
            self.note(
                service, "answered", request, response, started, success=success, message=message
            )

    def publish(self) -> None:
        """Publish the noted answers; for the publishing thread."""
        listened = self._publisher.get_subscription_count() > 0
        due = time.perf_counter() - (0.0 if listened else DELAY)
        while self._entries and self._entries[0].noted <= due:
            self._publisher.publish(self._message(self._entries.popleft()))

    def _message(self, entry: Entry) -> Any:
        kind = REQUEST_LOG.load()
        request, response, longest = entry.request, entry.response, self._longest
        message = kind(
            kind=entry.endpoint.kind,
            name=entry.endpoint.short.rpartition("/")[2],
            event=entry.event,
            goal=entry.goal,
            names=cut(names_in(request), longest),
            request=as_json(request, NAMES, longest),
            success=entry.success,
            message=text(entry.message),
            response=as_json(response, OF_RESPONSES, longest),
            duration=entry.duration,
        )
        for field in ("answers", "reasons", "codes"):
            setattr(message, field, cut(getattr(response, field, ()), longest))
        set_stamp(message.header.stamp, entry.stamp)
        return message


class GoalRecord:
    """Records one goal; ``handle`` is rclpy's."""

    def __init__(self, log: RequestLog, action: Endpoint, handle: Any) -> None:
        self._log, self._action, self._handle = log, action, handle
        self._started = time.perf_counter()

    def accepted(self) -> None:
        self._note("accepted", None, success=True)
        self._started = time.perf_counter()

    def refused(self, result: Any) -> Any:
        """Note that it was refused; returns its result."""
        self._note("refused", result, success=False)
        return result

    def ended(self, result: Any) -> Any:
        """Note its end, in the present state of its handle; returns its result."""
        event = GOAL_EVENTS.get(self._handle.status, "aborted")  # rclpy aborts one without an end
        self._note(event, result, success=event == "succeeded")
        return result

    def _note(self, event: str, result: Any, *, success: bool) -> None:
        message = getattr(result, "message", getattr(result, "error_string", ""))
        self._log.note(
            self._action,
            event,
            self._handle.request,
            result,
            self._started,
            success=success,
            message=message,
            goal=bytes(self._handle.goal_id.uuid).hex(),
        )


def left_out(service: Endpoint) -> bool:
    """Whether a service only reads, or can be called in every control cycle."""
    word = service.short.rpartition("/")[2]
    return word.startswith(("get_", "list_")) or service.name == STEP.name


def names_in(request: Any) -> Iterable[str]:
    for field in NAMES:
        if hasattr(request, field):
            names: Iterable[str] = getattr(request, field)
            return names
    return getattr(getattr(request, "trajectory", None), "joint_names", ())


def as_json(message: Any, left: Collection[str], longest: int) -> str:
    """The fields of a message but those ``left`` out, as a JSON object of bounded size."""
    if message is None:
        return "{}"
    fields = message.get_fields_and_field_types()
    values = {name: plain(getattr(message, name), longest) for name in fields if name not in left}
    return json.dumps(values, ensure_ascii=False)


def plain(value: Any, longest: int) -> Any:
    """A field's value for JSON: non-finite numbers as text."""
    if isinstance(value, bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if isinstance(value, str):
        return text(value)
    if hasattr(value, "get_fields_and_field_types"):
        fields = value.get_fields_and_field_types()
        return {name: plain(getattr(value, name), longest) for name in fields}
    items = [plain(item, longest) for item in list(value[:longest])]
    return items if len(value) <= longest else [*items, f"… {len(value) - longest} more"]


def cut(texts: Any, longest: int) -> list[str]:
    """The first texts of an array, and the number of the others."""
    pieces = [text(item) for item in texts[:longest]]
    return pieces if len(texts) <= longest else [*pieces, f"… {len(texts) - longest} more"]


def text(value: str) -> str:
    """A text valid for any middleware, of bounded length."""
    shown = value if len(value) <= CHARACTERS else value[:CHARACTERS] + "…"
    return shown.encode("utf-8", "replace").decode("utf-8")

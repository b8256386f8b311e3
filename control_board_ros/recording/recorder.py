# SPDX-License-Identifier: Apache-2.0
"""Records the serialized topics of boards.

A middleware drops a participant not received for its lease, and may not notify one that is paused
or cut off in one direction. So a receiver without messages reconnects, and the gap is recorded.
"""

from __future__ import annotations

import contextlib
import importlib
import itertools
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.context import Context
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from ..client.executor_thread import GONE, ExecutorThread, hidden_node
from ..interface import MODES, QoS
from .errors import RecordingError
from .parameters import Parameters
from .topics import DEPTH, GAPS, PARAMETER_EVENTS, Topic, topic_of, topics_for_yarp, topics_of
from .writing import Sink, Writing

#: s without a message until a board is silent, and minimum periods of its state.
PATIENCE, PERIODS = 5.0, 3.0
#: s between reconnections, initially and at most.
SOONEST, LATEST = 5.0, 10.0


@dataclass(slots=True)
class _Reception:
    """A board: patience (s), last (reception: s, monotonic), stamp (the same, ns of the system's
    clock), due (next reconnection, s), pause (s between reconnections), silent.
    """

    patience: float
    last: float
    stamp: int
    due: float = 0.0
    pause: float = SOONEST
    silent: bool = False


class Gaps:
    """Detects silent boards.

    Args:
        rates: Of the states of each board, Hz.
        now: Time, s, monotonic.
        stamp: The same, ns of the system's clock.
    """

    def __init__(self, rates: Mapping[str, float], now: float, stamp: int) -> None:
        self._boards = {
            board: _Reception(max(PATIENCE, PERIODS / rate if rate > 0.0 else 0.0), now, stamp)
            for board, rate in rates.items()
        }

    @property
    def silent(self) -> list[str]:
        return [board for board, reception in self._boards.items() if reception.silent]

    def received(self, board: str, now: float, stamp: int) -> bytes:
        """Record a message of a board; returns the gap that it ends, of GAPS, as CDR."""
        reception = self._boards[board]
        before, was_silent = reception.stamp, reception.silent
        reception.last, reception.stamp = now, stamp
        if not was_silent:
            return b""
        reception.silent, reception.pause = False, SOONEST
        return gap(before, stamp)

    def look(self, now: float) -> bool:
        """Whether to reconnect to a silent board now, at growing intervals."""
        due = False
        for reception in self._boards.values():
            if not reception.silent and now - reception.last >= reception.patience:
                reception.silent, reception.due = True, now
            if reception.silent and now >= reception.due:
                reception.due = now + reception.pause
                reception.pause = min(2.0 * reception.pause, LATEST)
                due = True
        return due

    def running(self, stamp: int) -> dict[str, bytes]:
        """Gaps of boards silent at the end, by board."""
        return {board: gap(self._boards[board].stamp, stamp) for board in self.silent}


def gap(begin: int, end: int) -> bytes:
    """A message of GAPS; times in ns."""
    text = json.dumps({"begin": round(1e-9 * begin, 6), "end": round(1e-9 * end, 6)})
    return bytes(serialize_message(String(data=text)))


#: s to wait for latched topics.
LATCHED = 2.0

_numbers = itertools.count(1)


class Recorder:
    """Records boards from creation until ``close``.

    Args:
        context: Of rclpy, for the recorder's own node.
        parameters: Those of each board.
        sink: Destination of the messages.

    Attributes:
        ended: Reason for the end; empty while recording.
        counts: Messages received by topic.
        dropped: Messages of boards published and not received, or received and not written.
        skipped: Topics whose type is not installed here.
    """

    def __init__(self, context: Context, parameters: Sequence[Parameters], sink: Sink) -> None:
        self._parameters, self._sink = parameters, Writing(sink)
        self._boards = [known.board for known in parameters]
        self._context, self._own_context = context, False
        rates = {known.board: known.number("state_rate") for known in parameters}
        self._gaps = Gaps(rates, time.monotonic(), time.time_ns())
        self.ended = ""
        self.counts: dict[Topic, int] = {}
        self._lost = 0
        self.skipped: list[str] = []
        self._sequence: dict[Topic, int] = {}
        self._begun = False
        self._latched = {known.topic: known.message() for known in parameters}
        self._early: list[tuple[Topic, int, bytes]] = []
        self._start = time.monotonic()
        self._node = hidden_node(f"_recorder_{next(_numbers)}", context)
        topics = topics_of(self._boards) + topics_for_yarp(self._node, self._boards)
        self._awaited = {topic for topic in topics if topic.latched and topic.board}
        loaded = [(topic, load(topic)) for topic in topics]
        self.skipped = [topic.name for topic, kind in loaded if kind is None]
        self._loaded = [(topic, kind) for topic, kind in loaded if kind is not None]
        self._subscribe()

    def _subscribe(self) -> None:
        """Subscribe to all topics; a thread receives them."""
        self._subscriptions = [
            self._node.create_subscription(
                kind, topic.name, partial(self._receive, topic), qos(topic), raw=True
            )
            for topic, kind in self._loaded
        ]
        self._thread = ExecutorThread(self._node, self._report)

    @property
    def dropped(self) -> int:
        return self._lost + self._sink.left_out

    def look(self) -> None:
        """Reconnect to silent boards, with a new participant; to be called periodically.

        A new participant is discovered even where either side has dropped the old one. The end of
        a gap is recorded.
        """
        if self.ended or not self._gaps.look(time.monotonic()):
            return
        self._thread.close()
        context = Context()
        context.init(args=[], initialize_logging=False, domain_id=self._context.get_domain_id())
        self._release()
        self._context, self._own_context = context, True
        self._node = hidden_node(f"_recorder_{next(_numbers)}", context)
        self._subscribe()

    def _release(self) -> None:
        """Destroy the node, and the participant if owned by the recorder."""
        self._node.destroy_node()
        if self._own_context:
            self._context.try_shutdown()

    def await_first(self, name: str, patience: float) -> bool:
        """Wait for a message of a topic; false after ``patience`` s without one."""
        until = time.monotonic() + patience
        while not any(topic.name == name for topic in list(self.counts)):
            if self.ended or time.monotonic() > until:
                return False
            time.sleep(0.01)
        return True

    @property
    def silent(self) -> list[str]:
        """The boards without messages for a while, as ``look`` found them."""
        return self._gaps.silent

    def board_is_gone(self) -> bool:
        """Whether no board publishes its modes any more, none of them silent before.

        A board that ends is undiscovered immediately; one that is cut off is first silent, until
        the middleware drops it: reconnection applies.
        """
        if self.silent:
            return False
        return not any(self._node.count_publishers(MODES.of(board)) for board in self._boards)

    def close(self) -> None:
        """End, and complete the recording; the reason for a failure is in ``ended``.

        Messages received so far are processed first, topic by topic: on a busy machine, states at
        500 Hz may be queued for seconds.
        """
        now = time.time_ns()
        self._thread.close()
        with contextlib.suppress(*GONE):  # the context was shut down: nothing is left
            for subscription in self._subscriptions:
                self._take_rest(subscription, now)
        self._release()
        self._guard(self._finish)

    def _take_rest(self, subscription: Any, until: int) -> None:
        """Process the queued messages of a subscription up to a time, ns."""
        while not self.ended:
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, True)
            if taken is None or taken[1]["received_timestamp"] > until:
                return
            subscription.callback(*taken)

    # --- in the thread ------------------------------------------------------------------------

    def _receive(self, topic: Topic, data: bytes, info: Mapping[str, Any]) -> None:
        stamp = int(info["received_timestamp"]) or time.time_ns()
        self.counts[topic] = self.counts.get(topic, 0) + 1
        if topic.board:
            self._count_dropped(topic, info.get("publication_sequence_number"))
            if ended := self._gaps.received(topic.board, time.monotonic(), stamp):
                self._guard(self._take, topic_of(GAPS, topic.board), stamp, ended)
        if not self.ended:
            self._guard(self._take, topic, stamp, bytes(data))

    def _count_dropped(self, topic: Topic, number: int | None) -> None:
        if number is None:  # middleware without sequence numbers
            return
        before = self._sequence.get(topic)
        if before is not None and number > before + 1:
            self._lost += number - before - 1
        self._sequence[topic] = number

    def _take(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Pass a message to the sink, latched ones first."""
        if self._begun:
            self._sink.write(topic, stamp, data)
            if topic.name == PARAMETER_EVENTS.name:
                self._take_parameters(stamp, data)
            return
        if topic.latched and topic not in self._latched:
            self._latched[topic] = data
        else:
            self._early.append((topic, stamp, data))
        self._awaited.discard(topic)
        if not self._awaited or time.monotonic() - self._start > LATCHED:
            self._begin()

    def _begin(self) -> None:
        self._begun = True
        self._sink.begin(self._latched)
        early, self._early = self._early, []
        for message in early:
            self._take(*message)

    def _take_parameters(self, stamp: int, data: bytes) -> None:
        for known in self._parameters:
            if known.change(data):
                self._sink.write(known.topic, stamp, known.message())

    def _finish(self) -> None:
        if not self._begun:
            self._begin()
        now = time.time_ns()
        for board, ended in self._gaps.running(now).items():
            self._sink.write(topic_of(GAPS, board), now, ended)
        self._sink.close()

    def _guard(self, work: Callable[..., None], *values: Any) -> None:
        try:
            work(*values)
        except RecordingError as error:
            self.ended = self.ended or str(error)

    def _report(self, error: Exception) -> None:
        self.ended = self.ended or f"{type(error).__name__}: {error}"


def load(topic: Topic) -> Any:
    """The Python class of a topic's type; None where its package is not installed."""
    package, kind, name = topic.type.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), name)
    except ModuleNotFoundError:
        return None


def qos(topic: Topic) -> Any:
    """QoS of a subscription: as published, with a queue for slow disks."""
    return QoS(depth=DEPTH, reliable=topic.reliable, latched=topic.latched).profile()

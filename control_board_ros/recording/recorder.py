# SPDX-License-Identifier: Apache-2.0
"""Hears the topics of boards as they are on the wire, and keeps them."""

from __future__ import annotations

import contextlib
import importlib
import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Protocol

from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from control_board_ros.client.executor_thread import GONE, ExecutorThread
from control_board_ros.interface import MODES

from .errors import RecordingError
from .gaps import Gaps
from .parameters import Parameters
from .topics import (
    DEPTH,
    GAPS,
    PARAMETER_EVENTS,
    Topic,
    topic_of,
    topics_for_yarp,
    topics_of,
)

#: s that latched topics have to come first.
PATIENCE = 2.0

_numbers = itertools.count(1)


class Sink(Protocol):
    """What takes the messages: a bag, or a black box."""

    def begin(self, latched: Mapping[Topic, bytes]) -> None:
        """Take what latched topics had before anything else."""

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Take a message (CDR) that was heard at a time, ns."""

    def close(self) -> None:
        """Finish."""


class Recorder:
    """Records boards from when it is made until ``close``.

    Args:
        context: Of rclpy, in which it makes a node of its own.
        parameters: Those of each board.
        sink: Takes the messages.

    Attributes:
        ended: Why nothing is recorded any more; empty while all is well.
        counts: Messages heard by topic.
        dropped: Messages of boards that were published and did not come.
        skipped: Topics whose type is not installed here.
    """

    def __init__(self, context: Context, parameters: Sequence[Parameters], sink: Sink) -> None:
        self._parameters, self._sink = parameters, sink
        self._boards = [known.board for known in parameters]
        self._context, self._own_context = context, False
        rates = {known.board: known.number("state_rate") for known in parameters}
        self._gaps = Gaps(rates, time.monotonic(), time.time_ns())
        self.ended = ""
        self.counts: dict[Topic, int] = {}
        self.dropped = 0
        self.skipped: list[str] = []
        self._sequence: dict[Topic, int] = {}
        self._begun = False
        self._latched = {known.topic: known.message() for known in parameters}
        self._early: list[tuple[Topic, int, bytes]] = []
        self._start = time.monotonic()
        self._node = node_of(context)
        topics = topics_of(self._boards) + topics_for_yarp(self._node, self._boards)
        self._awaited = {topic for topic in topics if topic.latched and topic.board}
        loaded = [(topic, load(topic)) for topic in topics]
        self.skipped = [topic.name for topic, kind in loaded if kind is None]
        self._loaded = [(topic, kind) for topic, kind in loaded if kind is not None]
        self._listen()

    def _listen(self) -> None:
        """Subscribe to all topics, and hear them in a thread."""
        self._subscriptions = [
            self._node.create_subscription(
                kind, topic.name, partial(self._hear, topic), qos(topic), raw=True
            )
            for topic, kind in self._loaded
        ]
        self._thread = ExecutorThread(self._node, self._report)

    def look(self) -> None:
        """Look for boards that are silent, in a participant of its own; to be called now and then.

        One that has been forgotten by the other side, or has forgotten it, is a stranger to
        nobody then. A gap that ends is written into the recording.
        """
        if self.ended or not self._gaps.look(time.monotonic()):
            return
        self._thread.close()
        context = Context()
        context.init(args=[], domain_id=self._context.get_domain_id())
        self._let_go()
        self._context, self._own_context = context, True
        self._node = node_of(context)
        self._listen()

    def _let_go(self) -> None:
        """End the node, and the participant where it is the recorder's own."""
        self._node.destroy_node()
        if self._own_context:
            self._context.try_shutdown()

    def await_first(self, name: str, patience: float) -> bool:
        """Wait until a topic is heard; false when nothing of it comes for so many s."""
        until = time.monotonic() + patience
        while not any(topic.name == name for topic in list(self.counts)):
            if self.ended or time.monotonic() > until:
                return False
            time.sleep(0.01)
        return True

    def board_is_gone(self) -> bool:
        """Whether none of the boards publishes its modes any more, nor was silent before.

        One that ends says so at once; of one that is cut off nothing is heard for a while, and
        then the middleware forgets it: that one is looked for.
        """
        if self._gaps.silent:
            return False
        return not any(self._node.count_publishers(MODES.of(board)) for board in self._boards)

    def close(self) -> None:
        """End, and finish what was recorded; why that did not work is in ``ended``.

        What had come by now is taken first, topic by topic: on a busy machine, states at 500 Hz
        may wait for seconds while what comes once a second does not.
        """
        now = time.time_ns()
        self._thread.close()
        with contextlib.suppress(*GONE):  # the context was shut down: nothing is left to take
            for subscription in self._subscriptions:
                self._take_rest(subscription, now)
        self._let_go()
        self._guard(self._finish)

    def _take_rest(self, subscription: Any, until: int) -> None:
        """Hear what came of a subscription until a time, ns, and still waits in it."""
        while not self.ended:
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, True)
            if taken is None or taken[1]["received_timestamp"] > until:
                return
            subscription.callback(*taken)

    # --- in the thread ------------------------------------------------------------------------

    def _hear(self, topic: Topic, data: bytes, info: Mapping[str, Any]) -> None:
        stamp = int(info["received_timestamp"]) or time.time_ns()
        self.counts[topic] = self.counts.get(topic, 0) + 1
        if topic.board:
            self._count_dropped(topic, info.get("publication_sequence_number"))
            if ended := self._gaps.heard(topic.board, time.monotonic(), stamp):
                self._guard(partial(self._take, topic_of(GAPS, topic.board), stamp, ended))
        if not self.ended:
            self._guard(partial(self._take, topic, stamp, bytes(data)))

    def _count_dropped(self, topic: Topic, number: int | None) -> None:
        if number is None:  # a middleware that does not number messages
            return
        before = self._sequence.get(topic)
        if before is not None and number > before + 1:
            self.dropped += number - before - 1
        self._sequence[topic] = number

    def _take(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Give a message to the sink, the latched ones first."""
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
        if not self._awaited or time.monotonic() - self._start > PATIENCE:
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

    def _guard(self, work: Callable[[], None]) -> None:
        try:
            work()
        except RecordingError as error:
            self.ended = self.ended or str(error)

    def _report(self, error: Exception) -> None:
        self.ended = self.ended or f"{type(error).__name__}: {error}"


def node_of(context: Context) -> Node:
    """A node that only listens."""
    return Node(
        f"_recorder_{next(_numbers)}",
        context=context,
        use_global_arguments=False,
        enable_rosout=False,
        start_parameter_services=False,
    )


def load(topic: Topic) -> Any:
    """The Python class of a topic's type; None where its package is not installed."""
    package, kind, name = topic.type.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), name)
    except ModuleNotFoundError:
        return None


def qos(topic: Topic) -> QoSProfile:
    """How to subscribe: as published, with room for what comes while the disk is slow."""
    return QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE
        if topic.reliable
        else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL
        if topic.latched
        else DurabilityPolicy.VOLATILE,
    )

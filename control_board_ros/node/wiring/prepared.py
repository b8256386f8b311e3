# SPDX-License-Identifier: Apache-2.0
"""Messages of which only numbers change, as the bytes that are sent.

A message of the same names has the same layout every time. So it is serialized once, the places
of its numbers are found, and from then on the bytes of new numbers are joined to the rest. Where
anything about the layout is unknown, the message itself is sent: slower, with the same content.
"""

from __future__ import annotations

import itertools
from array import array
from collections.abc import Callable, Mapping
from struct import Struct
from types import SimpleNamespace
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message

from .messages import NANOSECONDS, set_stamp, split_time

STAMP = Struct("=iI")
#: Times that the layout is looked for, and serialized messages that are compared each time.
ATTEMPTS, SAMPLES = 5, 4
#: A byte of the numbers of a marked message, and a stamp without a zero byte, ns.
MARK, MARKED_STAMP = 0x41, 0x41414141 * NANOSECONDS + 0x11111111
#: A stamp to try a layout with, ns.
TRIAL_STAMP = 1_234_567_890_123_456_789
#: Type codes of :mod:`array` for the fields whose bytes are those of a snapshot's numbers.
CODES = {"sequence<double>": "d", "sequence<uint64>": "Q"}


class UnknownLayout(Exception):  # noqa: N818  (not raised out of this module)
    """Why the layout of a serialized message is not understood."""


class PreparedMessage:
    """A message ready to be published, with other numbers each time.

    Args:
        message: the message of some numbers and a stamp (ns).
        pieces: the bytes of the same, in the message's order.
        blank, marked: numbers of zero bytes only, and of other bytes only.
        trial: other numbers in every place, to try a layout with.

    Attributes: fallback (why whole messages are published; empty where their bytes are).
    """

    def __init__(
        self,
        message: Callable[[Any, int], Any],
        pieces: Callable[[Any, int], list[bytes]],
        blank: Any,
        marked: Any,
        trial: Any,
    ) -> None:
        self._message, self._pieces = message, pieces
        #: What stays the same, and between each two of them what changes.
        self._parts: list[bytes] = []
        self._size = 0
        for _ in range(ATTEMPTS):  # padding, of any value, may look like numbers
            self.fallback = ""
            try:
                self._parts = self._cut(blank, marked)
                self._size = sum(map(len, self._parts))
                self._try(trial)
                return
            except Exception as error:  # noqa: BLE001 - whatever it is, whole messages can go out
                self._fall_back(str(error) if isinstance(error, UnknownLayout) else repr(error))

    def of(self, numbers: Any, nanoseconds: int) -> Any:
        """The message of some numbers, stamped: its bytes, or the message itself."""
        if self.fallback:
            return self._message(numbers, nanoseconds)
        self._parts[1::2] = self._pieces(numbers, nanoseconds)
        made = b"".join(self._parts)
        if len(made) != self._size:
            self._fall_back("the numbers have another size")
            return self._message(numbers, nanoseconds)
        return made

    def _fall_back(self, reason: str) -> None:
        self.fallback = f"whole messages are published, more slowly: {reason}"

    def _cut(self, blank: Any, marked: Any) -> list[bytes]:
        """The bytes of the blank message, cut where its numbers begin and end."""
        looks = [
            bytes(serialize_message(self._message(numbers, stamp)))
            for _ in range(SAMPLES)
            for numbers, stamp in ((blank, 0), (marked, MARKED_STAMP))
        ]
        places = changing(looks[::2], looks[1::2])
        edges, begin = [0], 0
        for size in map(len, self._pieces(marked, MARKED_STAMP)):
            piece = places[begin : begin + size]
            if len(piece) < size or piece[-1] - piece[0] != size - 1:
                break
            edges += [int(piece[0]), int(piece[-1]) + 1]
            begin += size
        if begin != len(places):
            raise UnknownLayout(f"numbers are in {len(places)} places of {len(looks[0])}")
        edges.append(len(looks[0]))
        return [looks[0][a:b] for a, b in itertools.pairwise(edges)]

    def _try(self, trial: Any) -> None:
        """Read a message from bytes, and compare it with the original."""
        whole = self._message(trial, TRIAL_STAMP)
        if deserialize_message(self.of(trial, TRIAL_STAMP), type(whole)) != self._message(
            trial, TRIAL_STAMP
        ):
            raise UnknownLayout("a message made of bytes reads otherwise")


def changing(blank: list[bytes], marked: list[bytes]) -> np.ndarray[Any, Any]:
    """The places of numbers: zero in all blank messages, and the same mark in all marked ones.

    Other bytes may differ: what pads a message to the size of its numbers is not always set.

    Raises:
        UnknownLayout: the messages differ in size.
    """
    if len(set(map(len, (*blank, *marked)))) > 1:
        raise UnknownLayout("the size of a message changes with its numbers")
    without, having = (
        np.array([np.frombuffer(look, dtype=np.uint8) for look in looks])
        for looks in (blank, marked)
    )
    zero, same = (without == 0).all(axis=0), (having == having[0]).all(axis=0)
    return np.flatnonzero(zero & same & (having[0] != 0))


def prepared_state(message: Any, sources: Mapping[str, str], count: int) -> PreparedMessage:
    """The message of one snapshot after the other, ready to be published.

    Args:
        message: with its names set, and nothing else.
        sources: for each field of numbers, in the message's order, the snapshot's attribute.
        count: how many numbers a field has.
    """
    kinds = {field: message.get_fields_and_field_types()[field] for field in sources}
    attributes = tuple(sources.values())

    def whole(snapshot: Any, nanoseconds: int) -> Any:
        set_stamp(message.header.stamp, nanoseconds)
        for field, source in sources.items():
            setattr(message, field, field_of(kinds[field], getattr(snapshot, source)))
        return message

    def pieces(snapshot: Any, nanoseconds: int) -> list[bytes]:
        stamp = STAMP.pack(*split_time(nanoseconds))
        return [stamp, *(getattr(snapshot, source).tobytes() for source in attributes)]

    def sample(values: Callable[[int, str], Any]) -> SimpleNamespace:
        numbers = (values(k, kind) for k, kind in enumerate(kinds.values()))
        return SimpleNamespace(**dict(zip(attributes, numbers, strict=True)))

    return PreparedMessage(
        whole,
        pieces,
        blank=sample(lambda _, kind: of_byte(kind, 0, count)),
        marked=sample(lambda _, kind: of_byte(kind, MARK, count)),
        trial=sample(lambda k, kind: trial_values(kind, np.arange(1, count + 1) + 100 * k)),
    )


def field_of(kind: str, values: Any) -> array[Any] | list[Any]:
    """The values of a snapshot as a message's field, of whatever kind it is."""
    if kind in CODES:
        return array(CODES[kind], np.asarray(values, dtype=CODES[kind]).tobytes())
    one_by_one: list[Any] = values.tolist()
    return one_by_one


def of_byte(kind: str, byte: int, count: int) -> Any:
    """``count`` numbers for a field, each of this byte only; flags are false for 0."""
    if kind == "sequence<boolean>":
        return np.full(count, bool(byte))
    return np.frombuffer(bytes([byte]) * (8 * count), dtype=CODES.get(kind, "d"))


def trial_values(kind: str, values: Any) -> Any:
    """Different numbers of the field's kind, from whole ones."""
    if kind == "sequence<boolean>":
        return values % 2 == 0
    return values.astype(np.uint64) if kind == "sequence<uint64>" else values + 0.125

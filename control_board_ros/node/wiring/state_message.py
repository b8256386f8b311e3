# SPDX-License-Identifier: Apache-2.0
"""Messages of which only numbers change, as the bytes that go out.

A message of the same names has the same layout every time. So it is serialized once, the places
of its numbers are found, and from then on the bytes of a snapshot are joined to the rest. Where
anything about the layout is unknown, the message itself goes out: slower, and the same.
"""

from __future__ import annotations

import itertools
from array import array
from collections.abc import Mapping
from struct import Struct
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message

from .messages import set_stamp, split_time

STAMP = Struct("=iI")
#: In a byte of each number while its place is looked for; makes a double that is a number.
MARK = 0x41
#: Bytes from one place where a field may begin to the next.
ALIGNED = 4
#: Times that the layout is looked for.
ATTEMPTS = 5
#: A stamp to try a layout with, ns.
TRIAL = 1_234_567_890_123_456_789
#: Type codes of :mod:`array` for the fields whose bytes are those of a snapshot's numbers.
CODES = {"sequence<double>": "d", "sequence<uint64>": "Q"}


class UnknownLayout(Exception):  # noqa: N818  (not raised out of this module)
    """Why the layout of a serialized message is not understood."""


class StateMessage:
    """The message of one snapshot after the other, ready to be published.

    Args:
        message: with its names set, and nothing else.
        sources: for each field of numbers, in the message's order, the snapshot's attribute.
        count: how many numbers a field has.

    Attributes: fallback (why whole messages are published; empty where their bytes are).
    """

    def __init__(self, message: Any, sources: Mapping[str, str], count: int) -> None:
        self._message, self._fields = message, dict(sources)
        self._sources = tuple(sources.values())
        self._kinds = {field: message.get_fields_and_field_types()[field] for field in sources}
        #: What stays the same, and between each two of them what changes.
        self._parts: list[bytes] = []
        self._size = 0
        self._find_layout(count)

    def _find_layout(self, count: int) -> None:
        """Cut the message; again where padding, of any value, looked like numbers."""
        for _ in range(ATTEMPTS):
            self.fallback = ""
            try:
                self._parts = self._cut(count)
                self._size = sum(map(len, self._parts))
                self._try(count)
                return
            except Exception as error:  # noqa: BLE001 - whatever it is, whole messages can go out
                self._fall_back(str(error) if isinstance(error, UnknownLayout) else repr(error))

    def of(self, snapshot: Any, nanoseconds: int) -> Any:
        """The message of what has the sources, stamped: its bytes, or the message itself."""
        if self.fallback:
            return self._plain(snapshot, nanoseconds)
        self._parts[1::2] = [
            STAMP.pack(*split_time(nanoseconds)),
            *(getattr(snapshot, source).tobytes() for source in self._sources),
        ]
        made = b"".join(self._parts)
        if len(made) != self._size:
            self._fall_back("the numbers of a snapshot have another size")
            return self._plain(snapshot, nanoseconds)
        return made

    def _fall_back(self, reason: str) -> None:
        self.fallback = f"states go out as messages, not as bytes ready made: {reason}"

    def _plain(self, snapshot: Any, nanoseconds: int) -> Any:
        """The message itself."""
        set_stamp(self._message.header.stamp, nanoseconds)
        for field, source in self._fields.items():
            setattr(self._message, field, field_of(self._kinds[field], getattr(snapshot, source)))
        return self._message

    def _cut(self, count: int) -> list[bytes]:
        """The bytes of the message, cut where its numbers begin and end."""
        message = self._message
        for field, kind in self._kinds.items():
            setattr(message, field, numbers(kind, 0, count))
        message.header.stamp = Time()
        blank = bytes(serialize_message(message))
        message.header.stamp = Time(sec=-1, nanosec=0xFFFFFFFF)
        places = [place_of(blank, bytes(serialize_message(message)), b"\xff" * STAMP.size)]
        message.header.stamp = Time()
        for field, kind in self._kinds.items():
            marked = numbers(kind, MARK, count)
            setattr(message, field, marked)
            mark = bytes(marked) if isinstance(marked, list) else marked.tobytes()
            places.append(place_of(blank, bytes(serialize_message(message)), mark))
            setattr(message, field, numbers(kind, 0, count))
        edges = [0, *(edge for span in places for edge in (span.start, span.stop)), len(blank)]
        if edges != sorted(edges):
            raise UnknownLayout("the fields are not in their order")
        return [blank[a:b] for a, b in itertools.pairwise(edges)]

    def _try(self, count: int) -> None:
        """Read a message from bytes, and compare it with the original."""
        trial = TrialSnapshot(self._fields, self._kinds, count)
        made = deserialize_message(self.of(trial, TRIAL), type(self._message))
        if made != self._plain(trial, TRIAL):
            raise UnknownLayout("a message made of bytes reads otherwise")


class TrialSnapshot:
    """A snapshot with other numbers in every place, to try a layout with."""

    def __init__(self, fields: Mapping[str, str], kinds: Mapping[str, str], count: int) -> None:
        for k, (field, source) in enumerate(fields.items()):
            values = np.arange(1, count + 1) + 100 * k
            if kinds[field] == "sequence<boolean>":
                setattr(self, source, values % 2 == 0)
            elif kinds[field] == "sequence<uint64>":
                setattr(self, source, values.astype(np.uint64))
            else:
                setattr(self, source, values + 0.125)


def field_of(kind: str, values: Any) -> array[Any] | list[Any]:
    """The values of a snapshot as a message's field, of whatever kind it is."""
    if kind in CODES:
        return array(CODES[kind], np.asarray(values, dtype=CODES[kind]).tobytes())
    one_by_one: list[Any] = values.tolist()
    return one_by_one


def numbers(kind: str, byte: int, count: int) -> array[Any] | list[bool]:
    """``count`` numbers for a field, each of this byte only.

    Raises:
        UnknownLayout: a kind of field whose bytes are not those of numpy.
    """
    if kind == "sequence<boolean>":
        return [bool(byte)] * count
    if kind not in CODES:
        raise UnknownLayout(f"a field is {kind}")
    return array(CODES[kind], bytes([byte]) * (8 * count))


def place_of(blank: bytes, marked: bytes, mark: bytes) -> slice:
    """Where a serialized message holds a mark, and one without it zeros.

    Other bytes may differ: what pads a message to the size of its numbers is not always set.
    Every field of numbers begins where a 32-bit length may end.

    Raises:
        UnknownLayout: in no place, or in several.
    """
    if len(blank) != len(marked):
        raise UnknownLayout("the size of a message changes with its numbers")
    size, found = len(mark), []
    at = marked.find(mark)
    while at >= 0:
        if at % ALIGNED == 0 and not any(blank[at : at + size]):
            found.append(at)
        at = marked.find(mark, at + 1)
    if len(found) != 1:
        raise UnknownLayout(f"numbers are in {len(found)} places")
    return slice(found[0], found[0] + size)

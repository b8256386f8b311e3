# SPDX-License-Identifier: Apache-2.0
"""Messages of which only numbers change, as the bytes that go out.

A message of the same names has the same layout every time. So it is serialized once, the places
of its numbers are found, and from then on the bytes of a snapshot are joined to the rest.
"""

from __future__ import annotations

import itertools
from array import array
from collections.abc import Mapping
from struct import Struct
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message

from ..core.state import Snapshot
from .messages import split_time

STAMP = Struct("=iI")
#: In a byte of each number while its place is looked for; makes a double that is a number.
MARK = 0x41


class Template:
    """The bytes of a message for one snapshot after the other.

    Args:
        message: with its names set, and nothing else.
        sources: for each field of numbers, in the message's order, the snapshot's attribute.
        count: how many numbers a field has.
    """

    def __init__(self, message: Any, sources: Mapping[str, str], count: int) -> None:
        self._sources = tuple(sources.values())
        kinds = message.get_fields_and_field_types()
        for field in sources:
            setattr(message, field, numbers(kinds[field], 0, count))
        blank = serialize_message(message)
        message.header.stamp = Time(sec=-1, nanosec=0xFFFFFFFF)
        places = [place(blank, serialize_message(message), STAMP.size)]
        message.header.stamp = Time()
        for field in sources:
            marked = numbers(kinds[field], MARK, count)
            setattr(message, field, marked)
            size = memoryview(marked).nbytes if isinstance(marked, array) else count
            places.append(place(blank, serialize_message(message), size))
            setattr(message, field, numbers(kinds[field], 0, count))
        edges = [0, *(edge for span in places for edge in (span.start, span.stop)), len(blank)]
        #: What stays the same, and between each two of them what changes.
        self._parts = [blank[a:b] for a, b in itertools.pairwise(edges)]

    def of(self, snapshot: Snapshot, nanoseconds: int) -> bytes:
        """The message of a snapshot, stamped."""
        stamp = STAMP.pack(*split_time(nanoseconds))
        self._parts[1::2] = [
            stamp,
            *(getattr(snapshot, source).tobytes() for source in self._sources),
        ]
        return b"".join(self._parts)


def numbers(kind: str, byte: int, count: int) -> array[Any] | list[bool]:
    """So many numbers for a field, each made of this byte alone."""
    if kind == "sequence<boolean>":
        return [bool(byte)] * count
    code = {"sequence<double>": "d", "sequence<uint64>": "Q"}[kind]
    return array(code, bytes([byte]) * (8 * count))


def place(blank: bytes, marked: bytes, size: int) -> slice:
    """Where two serialized messages differ.

    Raises:
        RuntimeError: not in so many bytes in a row: this middleware lays messages out otherwise.
    """
    found = [i for i, (a, b) in enumerate(zip(blank, marked, strict=True)) if a != b]
    if not found or found != list(range(found[0], found[0] + size)):
        raise RuntimeError(
            "this middleware has no fixed layout; use RMW_IMPLEMENTATION=rmw_fastrtps_cpp"
        )
    return slice(found[0], found[0] + size)

# SPDX-License-Identifier: Apache-2.0
"""Messages of which only numbers change, as the bytes that are sent.

A message of the same names has the same layout every time. So it is serialized once, the bytes of
its numbers are found there, and from then on those of new numbers are joined to the rest. Where
they are not found, the message itself is sent: slower, with the same content.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping
from struct import Struct
from types import SimpleNamespace
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message

from .messages import set_stamp, split_time

STAMP, LENGTH = Struct("=iI"), Struct("=I")
#: A stamp to find in a message, ns.
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
        trial: numbers to find in a message: different ones in every place.
        other: others in every place, to try what was found with.

    Attributes: fallback (why whole messages are published; empty where their bytes are).
    """

    def __init__(
        self,
        message: Callable[[Any, int], Any],
        pieces: Callable[[Any, int], list[bytes]],
        trial: Any,
        other: Any,
    ) -> None:
        self._message, self._pieces = message, pieces
        #: What stays the same, and between each two of them what changes.
        self._parts: list[bytes] = []
        self._size = 0
        self.fallback = ""
        try:
            self._parts = self._cut(trial)
            self._size = sum(map(len, self._parts))
            self._try(other)
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

    def _cut(self, trial: Any) -> list[bytes]:
        """The bytes of a message, cut where its numbers begin and end."""
        rest = bytes(serialize_message(self._message(trial, TRIAL_STAMP)))
        parts = []
        for piece in self._pieces(trial, TRIAL_STAMP):
            # Few flags look like other bytes: they are found by their length, right before them.
            for length in (LENGTH.pack(len(piece)), b""):
                before, place, after = rest.partition(length + piece)
                if place:
                    break
            else:
                raise UnknownLayout("the places of its numbers are not found")
            parts += [before + length, piece]
            rest = after
        return [*parts, rest]

    def _try(self, other: Any) -> None:
        """Read a message from bytes, and compare it with the original."""
        made = self.of(other, TRIAL_STAMP + 1)
        whole = self._message(other, TRIAL_STAMP + 1)
        if deserialize_message(made, type(whole)) != whole:
            raise UnknownLayout("a message made of bytes reads otherwise")


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

    def sample(first: int) -> SimpleNamespace:
        rows = enumerate(zip(attributes, kinds.values(), strict=True))
        values = {
            name: trial_values(kind, np.arange(count) + first + 100 * k)
            for k, (name, kind) in rows
        }
        return SimpleNamespace(**values)

    return PreparedMessage(whole, pieces, trial=sample(1), other=sample(2))


def field_of(kind: str, values: Any) -> array[Any] | list[Any]:
    """The values of a snapshot as a message's field, of whatever kind it is."""
    if kind in CODES:
        return array(CODES[kind], np.asarray(values, dtype=CODES[kind]).tobytes())
    one_by_one: list[Any] = values.tolist()
    return one_by_one


def trial_values(kind: str, values: Any) -> Any:
    """Different numbers of the field's kind, from whole ones."""
    if kind == "sequence<boolean>":
        return values % 2 == 0
    return values.astype(np.uint64) if kind == "sequence<uint64>" else values + 0.125

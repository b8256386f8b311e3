# SPDX-License-Identifier: Apache-2.0
"""Serialization of messages."""

from __future__ import annotations

from functools import cache
from typing import Any

from rclpy.serialization import serialize_message

from .definitions import definition
from .errors import library

#: Bytes of the CDR header.
HEADER = 4


def serialize(message: Any, type_name: str) -> bytes:
    """A message as CDR, without the padding of rmw.

    rmw overestimates the size of nested sequences, and readers of recordings reject the rest as
    a broken message.
    """
    data = bytes(serialize_message(message))
    store = store_of(type_name)
    known = store.get_msgdef(type_name)
    _, end = known.deserialize_cdr_le(data[HEADER:], 0, known.cls, store)
    return data[: HEADER + end]


@cache
def store_of(type_name: str) -> Any:
    """The library's type store of a type and those it refers to."""
    types = library("rosbags.typesys")
    store = types.get_typestore(types.Stores.EMPTY)
    store.register(types.get_types_from_msg(definition(type_name).text, type_name))
    return store

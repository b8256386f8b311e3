# SPDX-License-Identifier: Apache-2.0
"""A frame of python-can, and the flags that its id can have here."""

from __future__ import annotations

from functools import cache
from typing import Any

#: The largest id of 11 bits.
SHORT = 0x7FF
#: Flag of a frame's id, as socketcan has it: a remote frame, which requests that of its id.
REMOTE = 0x40000000
#: Another: 29 bits, of an id that would fit into 11.
EXTENDED = 0x80000000


@cache
def frame() -> Any:
    """A message of python-can that shares its data with its copies.

    A virtual bus copies each message for each receiver; copying its data is slow.
    """
    import can

    class Frame(can.Message):
        __slots__ = ()

        def __deepcopy__(self, memo: object) -> Any:
            return self.__copy__()

    return Frame


def message(frame_id: int, data: bytes, *, fd: bool) -> Any:
    """A frame of python-can, of 29 bits where its id needs them or has EXTENDED; see REMOTE."""
    return frame()(
        arbitration_id=frame_id & ~(REMOTE | EXTENDED),
        is_remote_frame=bool(frame_id & REMOTE),
        data=data,
        is_extended_id=frame_id & ~REMOTE > SHORT,
        is_fd=fd,
        bitrate_switch=fd,
    )

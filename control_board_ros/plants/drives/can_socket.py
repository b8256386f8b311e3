# SPDX-License-Identifier: Apache-2.0
"""CAN buses as drivers use them: frames by their ids, without an object of python-can for each.

python-can opens all of them, but the adapter of ``fdcanusb``. Where a bus is a socket with one
frame per datagram, that is written and read here: socketcan, and udp_multicast.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import socket
import struct
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

from .can_frame import EXTENDED, REMOTE, SHORT, message

#: A frame of socketcan: id with flags, length, flags of CAN FD; its data fill 8 or 64 bytes.
HEAD, CLASSIC, LONGEST = struct.Struct("=IBB2x"), 8, 64
#: Flag of an id: a frame of the interface about errors; its id is a mask of these.
ERROR = 0x20000000
#: Flags of a frame of CAN FD with fast data (CANFD_BRS, CANFD_FDF).
FAST = 0x05
#: Bytes of the longest datagram.
DATAGRAM = 4096
#: Of sockets on Linux: a filter of what they receive; where such a program finds the IP header.
ATTACH_FILTER, IP_HEADER = 26, 0xFFF00000
#: Of Linux: whether a socket receives the groups that others joined.
MULTICAST_ALL = {
    socket.AF_INET: (socket.IPPROTO_IP, 49),
    socket.AF_INET6: (socket.IPPROTO_IPV6, 29),
}


class Received(NamedTuple):
    """A frame, by the names that python-can's messages have."""

    arbitration_id: int
    data: bytes
    is_extended_id: bool
    is_remote_frame: bool
    is_error_frame: bool = False


def received(frame_id: int, data: bytes) -> Received:
    """A frame by its id with flags; see ``can_frame``."""
    number = frame_id & ~(REMOTE | EXTENDED)
    return Received(number, data, frame_id & ~REMOTE > SHORT, bool(frame_id & REMOTE))


class CanBus(Protocol):
    """An open bus. It raises OSError, or can.CanError."""

    def put(self, frame_id: int, data: bytes) -> None:
        """Send a frame; its id may have the flags of ``can_frame``."""
        ...

    def recv(self, timeout: float) -> Any:
        """The next frame, see ``Received``; None after a timeout, s."""
        ...

    def shutdown(self) -> None:
        """Leave the bus."""
        ...


class MessageBus:
    """A bus of python-can, by its messages.

    Args:
        bus: That is open.
        fd: Frames that are sent are CAN FD.
    """

    def __init__(self, bus: Any, *, fd: bool) -> None:
        self._bus, self._fd = bus, fd
        self.recv, self.shutdown = bus.recv, bus.shutdown

    def put(self, frame_id: int, data: bytes) -> None:
        self._bus.send(message(frame_id, data, fd=self._fd))


class SocketBus(ABC):
    """A bus that is a socket with one frame per datagram.

    Args:
        bus: Of python-can, which opened the socket and closes it.
        fd: Frames that are sent are CAN FD.
    """

    def __init__(self, bus: Any, *, fd: bool) -> None:
        self._bus, self._fd = bus, fd
        self._socket = socket.socket(fileno=os.dup(bus.fileno()))
        self._socket.setblocking(False)
        #: The next datagram of another sender.
        self._next: Callable[[int], bytes] = self._socket.recv

    def recv(self, timeout: float) -> Received | None:
        end: float | None = None
        while True:
            try:
                if (frame := self._read(self._next(DATAGRAM))) is not None:
                    return frame
            except BlockingIOError:
                if timeout <= 0.0:
                    return None
                now = time.monotonic()
                end = now + timeout if end is None else end
                if end <= now or not select.select([self._socket], [], [], end - now)[0]:
                    return None

    def fileno(self) -> int:
        """The number of its socket."""
        return self._socket.fileno()

    def shutdown(self) -> None:
        self._socket.close()
        self._bus.shutdown()

    @abstractmethod
    def _read(self, datagram: bytes) -> Received | None:
        """The frame of a datagram, or None: it has none."""


#: In a datagram of udp_multicast before the length of the data.
DATA = b"\xa4data\xc4"


@lru_cache(256)
def head(frame_id: int, length: int, fd: bool) -> bytes:
    """What a datagram of udp_multicast begins with, up to the data, which are the last."""
    import msgpack

    fields = {
        "timestamp": 0.0,
        "arbitration_id": frame_id & ~(REMOTE | EXTENDED),
        "is_extended_id": frame_id & ~REMOTE > SHORT,
        "is_remote_frame": bool(frame_id & REMOTE),
        "is_error_frame": False,
        "channel": None,
        "dlc": length,
        "is_fd": fd,
        "bitrate_switch": fd,
        "error_state_indicator": False,
        "data": bytes(length),
    }
    packed: bytes = msgpack.packb(fields)
    return packed[: len(packed) - length]


@lru_cache(256)
def fields_of(head: bytes, rest: bytes) -> tuple[bool, int, list[bool]]:
    """Whether a datagram is CAN FD, its id, and its flags as in ``Received``.

    Args:
        head: Up to its data.
        rest: After them.

    Raises:
        Exception: msgpack's own, or another: it is no message.
    """
    import msgpack

    fields = msgpack.unpackb(head + bytes(head[-1]) + rest)
    flags = [bool(fields[name]) for name in Received._fields[2:]]
    return bool(fields["is_fd"]), int(fields["arbitration_id"]), flags


def drop_from(line: socket.socket, host: str, port: int) -> None:
    """Drop what comes from an address before it wakes the reader of a UDP socket of Linux.

    A group returns each datagram to its sender: to a thread that waits for answers, as many
    wake-ups again. The filter is a classic BPF program: source port and address, from the headers
    of UDP and IP.

    Raises:
        OSError: there is no such filter here.
    """
    address = int.from_bytes(socket.inet_aton(host), "big")
    steps = (
        (0x28, 0, 0, 0),  # load half a word: the source port
        (0x15, 0, 3, port),
        (0x20, 0, 0, IP_HEADER + 12),  # load a word: the source address
        (0x15, 0, 1, address),
        (0x06, 0, 0, 0),  # drop
        (0x06, 0, 0, 0xFFFFFFFF),  # keep
    )
    program = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in steps))
    where = struct.pack("@HP", len(steps), ctypes.addressof(program))
    line.setsockopt(socket.SOL_SOCKET, ATTACH_FILTER, where)


class SocketCan(SocketBus):
    """An interface of socketcan."""

    def put(self, frame_id: int, data: bytes) -> None:
        if frame_id & ~(REMOTE | EXTENDED) > SHORT:
            frame_id |= EXTENDED
        room, flags = (LONGEST, FAST) if self._fd else (CLASSIC, 0)
        self._socket.send(HEAD.pack(frame_id, len(data), flags) + data.ljust(room, b"\0"))

    def _read(self, datagram: bytes) -> Received:
        number, length, _ = HEAD.unpack_from(datagram)
        flags = number & EXTENDED > 0, number & REMOTE > 0, number & ERROR > 0
        data = datagram[HEAD.size : HEAD.size + length]
        return Received(number & ~(EXTENDED | REMOTE | ERROR), data, *flags)


class Multicast(SocketBus):
    """A group of udp_multicast: each datagram is a message of python-can, by names.

    Of IPv4 it stays on this computer: no frame of a virtual drive gets onto a network, where
    sending it takes more than twice as long.

    Args:
        group, port: Its address.
    """

    def __init__(self, bus: Any, group: str, port: int, *, fd: bool) -> None:
        super().__init__(bus, fd=fd)
        self._out = socket.socket(self._socket.family, socket.SOCK_DGRAM)
        if self._socket.family == socket.AF_INET:
            self._out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        with contextlib.suppress(OSError):  # the other groups of its port are received, too
            self._socket.setsockopt(*MULTICAST_ALL[self._socket.family], 0)
        self._out.connect((group, port))
        self._own = self._out.getsockname()[:2]
        try:
            drop_from(self._socket, *self._own)
        except OSError:  # IPv6, or no such filter
            self._next = self._of_others

    def _of_others(self, size: int) -> bytes:
        while True:
            datagram, source = self._socket.recvfrom(size)
            if source[:2] != self._own:
                return datagram

    def put(self, frame_id: int, data: bytes) -> None:
        self._out.send(head(frame_id, len(data), self._fd) + data)

    def _read(self, datagram: bytes) -> Received | None:
        begin = datagram.find(DATA) + len(DATA) + 1
        try:
            end = begin + datagram[begin - 1]
            fast, number, flags = fields_of(datagram[:begin], datagram[end:])
        except Exception:  # noqa: BLE001 - it is no message, whatever the reason
            return None
        if fast > self._fd or end > len(datagram):
            return None
        return Received(number, datagram[begin:end], *flags)

    def shutdown(self) -> None:
        self._out.close()
        super().shutdown()

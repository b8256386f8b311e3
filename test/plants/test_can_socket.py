# SPDX-License-Identifier: Apache-2.0
"""Frames of socketcan, judged by python-can's, on a pair of sockets that keeps datagrams."""

from __future__ import annotations

import contextlib
import os
import select
import socket
from collections.abc import Iterator
from types import SimpleNamespace

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame, dissect_can_frame

from control_board_ros.plants.drives.can_frame import EXTENDED, REMOTE, message
from control_board_ros.plants.drives.can_line import BUS_OFF, open_bus
from control_board_ros.plants.drives.can_socket import (
    Multicast,
    SocketCan,
    drop_from,
    head,
    received,
)

#: Of IPv4 on Linux: a socket is told the time to live of what it receives, and by what.
RECEIVE_TTL, TTL = 12, 2
FRAMES = [(1, b""), (0x7FF, b"\1\2"), (0x800, bytes(8)), (0x12 | EXTENDED, b"\0\1"),
          (0x12 | REMOTE, b""), (0x800 | REMOTE, b"")]  # fmt: skip


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Ours, and that of the kernel."""
    ours, kernel = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with ours, kernel:
        yield ours, kernel


@pytest.mark.parametrize("fd", [False, True])
def test_frames_are_those_that_python_can_builds(
    pair: tuple[socket.socket, socket.socket], fd: bool
) -> None:
    ours, kernel = pair
    shut: list[bool] = []
    bus = SocketCan(SimpleNamespace(fileno=ours.fileno, shutdown=lambda: shut.append(True)), fd=fd)
    for frame_id, data in [*FRAMES, *([(0x8001, bytes(range(48)))] if fd else [])]:
        bus.put(frame_id, data)
        sent, meant = kernel.recv(100), build_can_frame(message(frame_id, data, fd=fd))
        assert (len(sent), dissect_can_frame(sent)) == (len(meant), dissect_can_frame(meant))
        kernel.send(meant)
        assert bus.recv(0.0) == received(frame_id, data)
    error = message(BUS_OFF | EXTENDED, bytes(8), fd=False)
    error.is_error_frame = True
    kernel.send(build_can_frame(error))
    assert bus.recv(0.0)[0::4] == (BUS_OFF, True)  # type: ignore[index]
    assert bus.recv(1e-3) is None
    with contextlib.suppress(BlockingIOError):
        ours.setblocking(False)
        while True:
            ours.send(b"?")
    with pytest.raises(BlockingIOError):  # the queue is full
        bus.put(1, b"")
    bus.shutdown()
    assert shut == [True]


@pytest.fixture
def groups() -> Iterator[tuple[Multicast, can.BusABC]]:
    """A group of udp_multicast as drivers use it, and python-can's own member of it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        port = free.getsockname()[1]
    try:
        ours = open_bus(f"udp_multicast:239.74.163.9:{port}", fd=True)
        theirs = can.Bus(interface="udp_multicast", channel="239.74.163.9", port=port, fd=True)
    except (OSError, can.CanError):
        pytest.skip("this computer has no multicast")
    assert isinstance(ours, Multicast)
    yield ours, theirs
    ours.shutdown()
    theirs.shutdown()


def test_a_group_does_not_wake_its_sender(groups: tuple[Multicast, can.BusABC]) -> None:
    """Each datagram would come back; what others send arrives."""
    ours, theirs = groups
    for frame_id, data in [*FRAMES[:4], (0x8001, bytes(range(48)))]:  # FD has no remote frames
        ours.put(frame_id, data)
        came = theirs.recv(10.0)
        assert came is not None
        frame = received(frame_id, data)
        assert (came.arbitration_id, bytes(came.data), came.dlc) == (*frame[:2], len(data))
        assert (came.is_extended_id, came.is_remote_frame, came.is_fd) == (*frame[2:4], True)
    assert select.select([ours.fileno()], [], [], 0.0)[0] == []
    theirs.send(message(5, b"12", fd=True))
    assert select.select([ours.fileno()], [], [], 10.0)[0] == [ours.fileno()]
    assert ours.recv(0.0) == received(5, b"12")


def test_what_is_no_message_is_dropped(groups: tuple[Multicast, can.BusABC]) -> None:
    """Another program's, a part of one, another format; what comes behind it is read."""
    ours, theirs = groups
    whole = head(5, 2, True) + b"12"
    parts = (b"", b"?", whole[:-1], whole[:40], whole.replace(b"is_fd", b"is_ff"))
    with (
        socket.socket(fileno=os.dup(theirs.fileno())) as port,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line,
    ):
        line.connect(("239.74.163.9", port.getsockname()[1]))
        for part in (*parts, whole):
            line.send(part)
        assert ours.recv(10.0) == received(5, b"12")
    assert ours.recv(0.0) is None


def test_a_group_stays_on_this_computer(groups: tuple[Multicast, can.BusABC]) -> None:
    """Frames for virtual drives do not get onto a network: their time to live is 0."""
    ours, theirs = groups
    with socket.socket(fileno=os.dup(theirs.fileno())) as line:
        line.setsockopt(socket.IPPROTO_IP, RECEIVE_TTL, 1)
        ours.put(1, b"")
        line.settimeout(10.0)
        _, notes, _, _ = line.recvmsg(1000, 1000)
    assert int.from_bytes(b"".join(value for _, kind, value in notes if kind == TTL)) == 0
    assert any(kind == TTL for _, kind, _ in notes)


def test_only_datagrams_of_that_address_are_dropped() -> None:
    with contextlib.ExitStack() as stack:
        line, one, other = (
            stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in "123"
        )
        line.bind(("127.0.0.1", 0))
        for sender in (one, other):
            sender.connect(line.getsockname())
        drop_from(line, *one.getsockname())
        one.send(b"1")
        other.send(b"2")
        line.settimeout(10.0)
        assert line.recv(10) == b"2"
        drop_from(line, "127.0.0.2", one.getsockname()[1])
        one.send(b"3")
        assert line.recv(10) == b"3"

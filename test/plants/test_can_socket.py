# SPDX-License-Identifier: Apache-2.0
"""Frames of socketcan, judged by python-can's, on a pair of sockets that keeps datagrams."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

pytest.importorskip("can")

from can.interfaces.socketcan.socketcan import build_can_frame, dissect_can_frame

from control_board_ros.plants.drives.can_frame import EXTENDED, REMOTE, message
from control_board_ros.plants.drives.can_line import BUS_OFF
from control_board_ros.plants.drives.can_socket import SocketCan, received

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

# SPDX-License-Identifier: Apache-2.0
"""Buses that are read here: frames as python-can's, on sockets that keep datagrams; lines."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame, dissect_can_frame
from manual_clock import ManualClock

from control_board_ros.plants.drives import can_line, can_socket, fdcanusb
from control_board_ros.plants.drives.can_frame import EXTENDED, REMOTE, message
from control_board_ros.plants.drives.can_line import BUS_OFF, open_bus
from control_board_ros.plants.drives.can_socket import (
    Multicast,
    SocketCan,
    drop_from,
    head,
    received,
)

#: A read that waits for ever ends here.
pytestmark = pytest.mark.timeout(60)
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
        assert (sent[:7], sent[8:]) == (meant[:7], meant[8:])  # python-can's own length is there
        assert dissect_can_frame(sent) == dissect_can_frame(meant)
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
    assert (shut, bus.fileno()) == ([True], -1)


class Waits:
    """In place of ``select``: each wait passes 0.2 s at most, and does something.

    Attributes: clock, waits (timeouts, s), then (what each does).
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, module: Any) -> None:
        self.clock, self.waits, self.then = ManualClock(), list[float](), list[Any]()
        time = SimpleNamespace(monotonic=self.clock.now)
        monkeypatch.setattr(module, "time", time)
        monkeypatch.setattr(module, "select", SimpleNamespace(select=self.select))

    def select(self, reads: list[Any], _w: Any, _x: Any, seconds: float) -> tuple[Any, Any, Any]:
        self.waits.append(seconds)
        self.clock.pass_by(min(seconds, 0.2))
        return (self.then.pop(0)() or reads) if self.then else [], [], []


def test_it_waits_until_a_frame_comes_or_the_time_is_up(
    pair: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What wakes it without a frame gives it no more time."""
    ours, kernel = pair
    bus = SocketCan(SimpleNamespace(fileno=ours.fileno, shutdown=lambda: None), fd=False)
    far, frame = Waits(monkeypatch, can_socket), build_can_frame(message(5, b"", fd=False))
    far.then = [lambda: None, lambda: None, lambda: None]
    assert bus.recv(0.5) is None
    assert far.waits == pytest.approx([0.5, 0.3, 0.1])
    assert bus.recv(0.5) is None
    far.then = [lambda: kernel.send(frame) and None]
    assert bus.recv(0.5) == received(5, b"")
    bus.shutdown()


def test_messages_of_other_buses_are_python_can_s() -> None:
    ours, theirs = open_bus("virtual:words"), can.Bus(interface="virtual", channel="words")
    ours.put(0x12 | EXTENDED, b"\1")
    came = theirs.recv(10.0)
    assert came is not None
    assert (came.arbitration_id, came.is_extended_id, came.data) == (0x12, True, b"\1")
    theirs.send(message(5, b"", fd=False))
    assert ours.recv(10.0).arbitration_id == 5
    ours.shutdown()
    theirs.shutdown()


class Adapter:
    """A device of ``serial``: what it gives, one after the other; what it was told."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.gives, self.told, self.state = list[bytes](), b"", list[str]()
        self.fileno, self.read = lambda: 7, lambda most: self.gives.pop(0)[:most]
        self.reset_input_buffer = lambda: self.state.append("flushed")
        self.close = lambda: self.state.append("closed")
        monkeypatch.setitem(sys.modules, "serial", SimpleNamespace(Serial=self.open))

    def open(self, *device: str, **how: Any) -> Adapter:
        self.opened = (*device, how)
        return self

    def write(self, data: bytes) -> None:
        self.told += data


def test_an_adapter_of_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its lines come in parts; noise does not fill the memory."""
    device, far = Adapter(monkeypatch), Waits(monkeypatch, fdcanusb)
    bus = open_bus("fdcanusb:/dev/x", fd=True)
    how = {"timeout": 0, "write_timeout": 0.05, "exclusive": True}
    assert (device.opened, device.state) == (("/dev/x", how), ["flushed"])
    bus.put(0x8001, b"\1\xff")
    open_bus("fdcanusb:/dev/x").put(5, b"")
    assert device.told == b"can send 8001 01ff BF\ncan send 0005  bf\n"
    device.gives = [b"OK\r\nrcv 81", b"00 0102ff BF\r\nrcv 5  bf\r\n"]
    far.then = [lambda: None] * 2
    assert bus.recv(0.5) == received(0x8100, b"\1\2\xff")
    assert far.waits == pytest.approx([0.5, 0.3])
    assert bus.recv(0.0) == received(5, b"")
    assert (len(far.waits), bus.recv(-1.0)) == (2, None)
    assert far.waits[2] == 0.0
    device.gives = [b"x" * 9000] * 3 + [b"\nrcv\nOK 7 00\nrcv 7 0g\nrcv 6 00\n"]
    far.then = [lambda: None] * 3
    assert bus.recv(0.7) is None
    assert len(bus._bytes) < 9000
    far.then = [lambda: None]
    assert bus.recv(0.1) == received(6, b"\0")
    bus.shutdown()
    assert device.state[-1] == "closed"


@pytest.fixture(params=["IPv4", "IPv6", "no filter"])
def groups(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[Multicast, can.BusABC]]:
    """A group of udp_multicast as drivers use it, and python-can's own member of it."""
    group = "ff15::63" if request.param == "IPv6" else "239.74.163.9"
    if request.param == "no filter":
        monkeypatch.setattr(can_socket, "ATTACH_FILTER", -1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        port = free.getsockname()[1]
    try:
        theirs = can.Bus(interface="udp_multicast", channel=group, port=port, fd=True)
        monkeypatch.setattr(can_line, "PORT", port)
        ours = open_bus(f"udp_multicast:{group}", fd=True)
    except (OSError, can.CanError):
        pytest.skip("this computer has no multicast")
    assert isinstance(ours, Multicast)
    yield ours, theirs
    ours.shutdown()
    theirs.shutdown()
    assert ours._out.fileno() == ours.fileno() == -1


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
        assert [came.is_error_frame, came.error_state_indicator] == [False, False]
    if ours._next == ours._socket.recv:  # the filter
        assert select.select([ours.fileno()], [], [], 0.0)[0] == []
    assert ours.recv(0.0) is None
    theirs.send(message(0x800, b"12", fd=True))
    assert select.select([ours.fileno()], [], [], 10.0)[0] == [ours.fileno()]
    assert ours.recv(0.0) == received(0x800, b"12")


def test_what_is_no_message_is_dropped(groups: tuple[Multicast, can.BusABC]) -> None:
    """Another program's, a part of one, another format; what comes behind it is read."""
    ours, _ = groups
    whole = head(5, 2, True) + b"12"
    parts = (b"", b"?", whole[:-1], whole[:40], whole.replace(b"is_fd", b"is_ff"))
    with (
        socket.socket(ours._out.family, socket.SOCK_DGRAM) as line,
    ):
        line.connect(ours._out.getpeername())
        for part in (*parts, whole):
            line.send(part)
        assert ours.recv(10.0) == received(5, b"12")
    assert ours.recv(0.0) is None


def test_another_group_of_its_port_and_faster_frames_are_not_heard(
    groups: tuple[Multicast, can.BusABC],
) -> None:
    ours, theirs = groups
    group = "ff15::64" if ours._out.family == socket.AF_INET6 else "239.74.163.10"
    other = can.Bus(interface="udp_multicast", channel=group, port=can_line.PORT, fd=True)
    other.send(message(7, b"", fd=False))
    ours._fd = False
    theirs.send(message(6, b"", fd=True))
    theirs.send(message(5, b"", fd=False))
    assert ours.recv(10.0) == received(5, b"")
    other.shutdown()


def test_a_group_stays_on_this_computer(groups: tuple[Multicast, can.BusABC]) -> None:
    """Frames for virtual drives do not get onto a network: their time to live is 0."""
    ours, theirs = groups
    if ours._out.family != socket.AF_INET:
        pytest.skip("of IPv4")
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

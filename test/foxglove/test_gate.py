# SPDX-License-Identifier: Apache-2.0
"""The gate of cbctl foxglove: permitted web pages only connect, and none goes around it."""

from __future__ import annotations

import ipaddress
import socket
import threading
from collections.abc import Iterator

import pytest
from waiting import GUARD, until

from control_board_ros.foxglove.gate import MOST, Gate, inner_host, refusal

NAMES = frozenset({"robot.local"})
ORIGINS = frozenset({"https://app.foxglove.dev"})


def head(*lines: str, upgrade: str = "websocket") -> bytes:
    text = ["GET / HTTP/1.1", *lines, "Connection: Upgrade", f"Upgrade: {upgrade}"]
    return "".join(f"{line}\r\n" for line in [*text, ""]).encode()


@pytest.mark.parametrize(
    "lines",
    [
        ["Host: 127.0.0.1:8765"],  # a program
        ["Host: localhost:8765", "Origin: https://app.foxglove.dev"],
        ["Host: robot.local:8765", "Origin: https://app.foxglove.dev"],
        ["Host: 127.0.0.1:8765", "Origin: http://127.0.0.1:8765"],
        ["host: [::1]:8765"],
    ],
)
def test_programs_and_foxglove_connect(lines: list[str]) -> None:
    assert refusal(head(*lines), NAMES, ORIGINS) == ""


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        (["Host: 127.0.0.1:8765", "Origin: https://evil.example"], "evil.example may not connect"),
        (["Host: 127.0.0.1:8765", "Origin: null"], "null may not connect"),
        (["Host: 127.0.0.1:8765", "Origin: http://127.0.0.1:1"], "may not connect"),
        (["Host: 127.0.0.1:8765", "Origin: https://app.foxglove.dev.evil.example"], "may not"),
        (["Host: 127.0.0.1", "Origin: https://app.foxglove.dev", "Origin: null"], "may not"),
        (["Host: evil.example:8765"], "host name"),
        (["Host: evil.example", "Host: 127.0.0.1"], "host name"),
        (["Origin: https://app.foxglove.dev"], "host name"),
        (["X: y" * 10] * 200, "invalid"),
        (["Host: 127.0.0.1", "X y", "Origin: https://evil.example"], "invalid"),
        (["Host: 127.0.0.1", "Origin : https://evil.example"], "invalid"),
        (["Host: 127.0.0.1", "X: y\nOrigin: https://evil.example"], "invalid"),
        (["Host: 127.0.0.1", " folded"], "invalid"),
    ],
)
def test_other_web_pages_do_not(lines: list[str], why: str) -> None:
    """Of another name for this machine (DNS rebinding) neither."""
    assert why in refusal(head(*lines), NAMES, ORIGINS)


def test_what_is_no_websocket_is_refused() -> None:
    """A page may send a GET without an Origin; a later request on it would not be checked."""
    assert "no WebSocket" in refusal(head("Host: 127.0.0.1", upgrade="h2c"), NAMES, ORIGINS)
    assert "no WebSocket" in refusal(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", NAMES, ORIGINS)


def test_the_server_behind_it_is_hard_to_find() -> None:
    hosts = {inner_host() for _ in range(100)}
    assert len(hosts) > 95
    assert all(ipaddress.ip_address(host).is_loopback for host in hosts)
    assert "127.0.0.1" not in hosts


@pytest.fixture
def gate() -> Iterator[tuple[tuple[str, int], list[str]]]:
    """The address of a gate before a server that returns what it gets, and what the gate says."""
    said: list[str] = []
    echo = socket.create_server((inner_host(), 0))
    ended = threading.Event()

    def serve() -> None:
        while not ended.is_set():
            try:
                connection, _ = echo.accept()
            except OSError:
                return
            threading.Thread(target=answer, args=(connection,)).start()

    def answer(connection: socket.socket) -> None:
        with connection:
            while data := connection.recv(1 << 16):
                connection.sendall(data)

    thread = threading.Thread(target=serve)
    thread.start()
    listening = socket.create_server(("127.0.0.1", 0))
    address = listening.getsockname()
    made = Gate(listening, "127.0.0.1", echo.getsockname(), frozenset(), said.append)
    yield address, said
    made.close()
    ended.set()
    echo.shutdown(socket.SHUT_RDWR)
    echo.close()
    thread.join(GUARD)


def talk(address: tuple[str, int], sent: bytes) -> bytes:
    """What is received until the other side closes, or as much as was sent."""
    received = b""
    with socket.create_connection(address, GUARD) as connection:
        connection.sendall(sent)
        while len(received) < len(sent) and (data := connection.recv(1 << 16)):
            received += data
    return received


def test_permitted_bytes_pass_unchanged(gate: tuple[tuple[str, int], list[str]]) -> None:
    sent = head("Host: 127.0.0.1") + bytes(range(256)) * 4000
    assert talk(gate[0], sent) == sent
    assert gate[1] == []


def test_a_refused_one_reaches_nothing(gate: tuple[tuple[str, int], list[str]]) -> None:
    """It gets the reason, and the log a line."""
    answer = talk(gate[0], head("Host: 127.0.0.1", "Origin: https://evil.example") + bytes(9999))
    assert answer.startswith(b"HTTP/1.1 403")
    assert b"https://evil.example may not connect" in answer
    assert bytes(100) not in answer
    assert gate[1][0].endswith("permit it with --origin")


def test_a_long_head_is_closed(gate: tuple[tuple[str, int], list[str]]) -> None:
    with socket.create_connection(gate[0], GUARD) as connection:
        try:
            connection.sendall(b"x" * 100_000)
            assert connection.recv(1) == b""
        except (ConnectionResetError, BrokenPipeError):
            pass  # closed before all of it was sent


def test_the_number_of_connections_is_limited(gate: tuple[tuple[str, int], list[str]]) -> None:
    """And a place is free again when one ends."""
    opened = [socket.create_connection(gate[0], GUARD) for _ in range(MOST)]
    for connection in opened:
        connection.sendall(head("Host: 127.0.0.1"))
        assert connection.recv(1)
    assert b"connections already" in talk(gate[0], head("Host: 127.0.0.1") + bytes(999))
    for connection in opened:
        connection.close()
    until(lambda: talk(gate[0], head("Host: 127.0.0.1")).startswith(b"GET"))

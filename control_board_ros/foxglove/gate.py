# SPDX-License-Identifier: Apache-2.0
"""The gate before the SDK's server, which accepts a WebSocket from any web page.

The gate listens on the address that is announced, reads the head of each connection, and passes on
those with a Host of this machine and a permitted Origin. The SDK's server listens on a random
address of 127.0.0.0/8 and a random port: a web page would have to guess 38 bits.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import secrets
import socket
import threading
from collections.abc import Callable

from control_board_ros.text import clean
from control_board_ros.web_access import allowed_host, own_names, same_origin

#: Maximum bytes of a connection's head, s to send it, maximum number of connections.
MAX_HEAD, HEAD_TIME, MOST = 16 * 1024, 5.0, 16
#: Maximum number of headers; one of them (RFC 9110, 5.1 and 5.5).
MOST_HEADERS = 100
HEADER = re.compile(r"([!#$%&'*+.^_`|~\w-]+):[ \t]*([^\x00-\x08\n-\x1f\x7f]*?)[ \t]*", re.ASCII)
#: Origins of Foxglove's own application in a browser.
FOXGLOVE = ("https://app.foxglove.dev",)


def inner_host() -> str:
    """A random address of the loopback network."""
    return "127." + ".".join(str(1 + secrets.randbelow(254)) for _ in range(3))


def refusal(head: bytes, names: frozenset[str], origins: frozenset[str]) -> str:
    """Why a connection is refused; empty if it is permitted.

    Args:
        head: its request line and headers.
        names: of this machine.
        origins: of permitted web pages, beside this server's own. Programs that are no browser
            send none.
    """
    headers = headers_of(head)
    if headers is None:
        return "its headers are invalid"
    hosts, sent = headers.get("host", []), headers.get("origin", [])
    if [value.lower() for value in headers.get("upgrade", [])] != ["websocket"]:
        return "it is no WebSocket; open it in Foxglove"
    if len(hosts) != 1 or not allowed_host(hosts[0], names):
        return "its host name is not one of this machine; use the address"
    if sent and not (len(sent) == 1 and (sent[0] in origins or same_origin(sent[0], hosts[0]))):
        return f"the web page {sent[0]} may not connect; permit it with --origin"
    return ""


def headers_of(head: bytes) -> dict[str, list[str]] | None:
    """Values by name, in lower case; None if a line is no header: no other may hide behind it."""
    lines = head.decode("iso-8859-1").removesuffix("\r\n\r\n").split("\r\n")[1:]
    matches = [HEADER.fullmatch(line) for line in lines]
    if len(lines) > MOST_HEADERS:
        return None
    headers: dict[str, list[str]] = {}
    for header in matches:
        if header is None:
            return None
        headers.setdefault(header[1].lower(), []).append(header[2])
    return headers


class Gate:
    """Passes permitted connections on to a server.

    Args:
        listening: the socket of clients.
        host: name or address that it listens on.
        inner: address and port of the server.
        origins: of permitted web pages, beside FOXGLOVE.
        report: called with log lines.
    """

    def __init__(
        self,
        listening: socket.socket,
        host: str,
        inner: tuple[str, int],
        origins: frozenset[str],
        report: Callable[[str], None],
    ) -> None:
        self._listening, self._inner, self._report = listening, inner, report
        self._names, self._origins = own_names(host), origins | frozenset(FOXGLOVE)
        self._count = 0
        self._loop = asyncio.new_event_loop()
        self._ended = asyncio.Event()
        self._thread = threading.Thread(target=self._loop.run_until_complete, args=(self._run(),))
        self._thread.start()

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join()
        self._loop.close()

    async def _run(self) -> None:
        server = await asyncio.start_server(self._serve, sock=self._listening, limit=MAX_HEAD)
        await self._ended.wait()
        server.close()
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection."""
        self._count += 1
        try:
            head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), HEAD_TIME)
            why = refusal(head, self._names, self._origins)
            if self._count > MOST:
                why = f"there are {MOST} connections already"
            if why:
                text = clean(f"a connection is refused: {why}")
                self._report(text)
                body = f"{text}\n".encode()
                writer.write(
                    b"HTTP/1.1 403 Forbidden\r\nConnection: close\r\nContent-Type: text/plain; "
                    b"charset=utf-8\r\nContent-Length: %d\r\n\r\n%b" % (len(body), body)
                )
                await writer.drain()
            else:
                await self._pass_on(head, reader, writer)
        except (OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass  # gone, too slow, or no head: closed without an answer
        finally:
            self._count -= 1
            writer.close()

    async def _pass_on(
        self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Pass bytes on, both ways, until either side ends."""
        inner_reader, inner_writer = await asyncio.open_connection(*self._inner)
        try:
            inner_writer.write(head)
            ways = (copy(reader, inner_writer), copy(inner_reader, writer))
            tasks = [asyncio.ensure_future(way) for way in ways]
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        finally:
            inner_writer.close()


async def copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Pass bytes on until the end."""
    with contextlib.suppress(OSError):
        while data := await reader.read(1 << 16):
            writer.write(data)
            await writer.drain()

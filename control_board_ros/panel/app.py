# SPDX-License-Identifier: Apache-2.0
"""``cbctl panel``: the server's start and end."""

from __future__ import annotations

import ipaddress
import logging
import secrets
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import uvicorn
from rclpy.node import Node

from control_board_ros.web_access import in_address, listen, own_names

from . import security
from .hub import Hub
from .server import make_app

#: s for open connections to close at the end.
GOODBYE = 2
EVERYWHERE = ("0.0.0.0", "::")


def addresses(host: str, port: int, token: str) -> list[str]:
    """The addresses to open, with the token; the network address where listening on all."""
    hosts = ["127.0.0.1", *own_addresses()] if host in EVERYWHERE else [host]
    return [f"http://{in_address(name)}:{port}/?token={token}" for name in hosts]


def own_addresses() -> list[str]:
    """The network address of this machine, if any; sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # a documentation address
        except OSError:
            return []
        address = str(probe.getsockname()[0])
    return [] if ipaddress.ip_address(address).is_loopback else [address]


def run(
    node: Node,
    host: str,
    port: int,
    *,
    read_only: bool,
    answer_timeout: float,
    takeover: float,
    recordings: Path,
    announce: Callable[[list[str]], None],
    report: Callable[[str], None],
) -> None:
    """Serve until a signal.

    Args:
        node: of the panel; not spun.
        host: address to listen on.
        port: port to listen on; 0: a free one.
        read_only: operation disabled.
        answer_timeout: timeout of a board's answer, s.
        takeover: timeout of the operator's answer to a takeover request, s.
        recordings: folder of the recordings' folders.
        announce: called with the addresses to open, when they are served.
        report: called with log lines.

    Raises:
        CannotListen: the address is not available.
    """
    listening = listen(host, port)
    try:
        port = listening.getsockname()[1]
        token = secrets.token_urlsafe(24)  # 192 bits
        hub = Hub(
            node,
            read_only=read_only,
            answer_timeout=answer_timeout,
            report=report,
            answer_time=takeover,
            recordings=recordings,
        )
        app = make_app(hub, token, port, own_names(host), report)
        server = Server(config_of(app), lambda: announce(addresses(host, port, token)))
        server.run(sockets=[listening])
    finally:
        listening.close()


class Server(uvicorn.Server):
    """Says when it serves, and from then on ends well by a signal."""

    def __init__(self, config: uvicorn.Config, announce: Callable[[], None]) -> None:
        super().__init__(config)
        self._announce = announce

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            self._announce()


def config_of(app: Any) -> uvicorn.Config:
    """The server's configuration: bounded sizes and rates, silent, uncompressed."""
    logging.getLogger("uvicorn.error").setLevel(logging.CRITICAL)
    return uvicorn.Config(
        app,
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        lifespan="on",
        limit_concurrency=100,
        timeout_keep_alive=10,
        timeout_graceful_shutdown=GOODBYE,
        h11_max_incomplete_event_size=security.MAX_MESSAGE,
        ws="websockets-sansio",
        ws_max_size=security.MAX_MESSAGE,
        ws_per_message_deflate=False,
        ws_ping_interval=2.0,
        ws_ping_timeout=4.0,
    )

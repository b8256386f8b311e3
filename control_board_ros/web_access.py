# SPDX-License-Identifier: Apache-2.0
"""A server on this machine: its socket, and which web pages may connect (Host and Origin).

A page of anybody's, open in a browser here, reaches servers that listen on 127.0.0.1, too.
"""

from __future__ import annotations

import ipaddress
import socket
from urllib.parse import urlsplit

from .text import clean


class CannotListen(OSError):  # noqa: N818
    """The address or the port is not available; one line: which, why, next step."""


def listen(host: str, port: int) -> socket.socket:
    """A listening socket; port 0 selects a free one.

    Raises:
        CannotListen: in use, or not an address of the host.
    """
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        # With an explicit protocol asyncio sets TCP_NODELAY.
        listening = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen()
    except (OSError, OverflowError) as error:
        why = clean(getattr(error, "strerror", None) or error)
        raise CannotListen(
            f"cannot listen on {host} port {port}: {why}; give another --host or --port"
        ) from None
    return listening


def in_address(host: str) -> str:
    """The host as part of a URL: IPv6 in brackets."""
    return f"[{host}]" if ":" in host else host


def own_names(host: str) -> frozenset[str]:
    """Accepted host names of this machine."""
    names = {host, socket.gethostname(), socket.getfqdn(), f"{socket.gethostname()}.local"}
    return frozenset(name.lower() for name in names)


def host_name(host: str) -> str | None:
    """The name in a Host header, without its port; None if invalid."""
    try:
        parts = urlsplit(f"//{host}")
        if parts.username is not None or parts.path or parts.query or parts.fragment:
            return None
        _ = parts.port  # raises if not a number
    except ValueError:
        return None
    return parts.hostname


def allowed_host(host: str | None, names: frozenset[str]) -> bool:
    """Whether a Host header names this machine.

    A foreign page can map its own name to this address (DNS rebinding); the browser then treats
    this server as that page's. This fails for addresses and for this machine's own names.

    Args:
        host: the header.
        names: of this machine, in lower case, beside ``localhost``.
    """
    name = None if host is None else host_name(host)
    if name is None:
        return False
    if name == "localhost" or name in names:
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def same_origin(origin: str | None, host: str | None) -> bool:
    """Whether a WebSocket is opened by the panel's own page, by its Origin."""
    if not origin or not host:
        return False
    scheme, mark, rest = origin.partition("://")
    return bool(mark) and scheme in ("http", "https") and rest.lower() == host.lower()

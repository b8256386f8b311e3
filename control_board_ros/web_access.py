# SPDX-License-Identifier: Apache-2.0
"""Which web pages may connect to a server on this machine: Host and Origin.

A page of anybody's, open in a browser here, reaches servers that listen on 127.0.0.1, too.
"""

from __future__ import annotations

import ipaddress
import socket
from urllib.parse import urlsplit


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

# SPDX-License-Identifier: Apache-2.0
"""Access control: token, Host, Origin, sizes and rates. Pure functions, no ROS."""

from __future__ import annotations

import hmac
import ipaddress
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import urlsplit

#: Maximum bytes of a browser's message, and of a request's headers.
MAX_MESSAGE = 16 * 1024
#: Messages of a browser: mean rate, 1/s, and burst.
RATE, BURST = 80.0, 160.0
#: Maximum number of browsers.
MAX_BROWSERS = 16

#: Headers of every answer: no foreign content in the page, no embedding of the page.
HEADERS = {
    "Cache-Control": "no-cache",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


def is_token(given: str | None, token: str) -> bool:
    """Whether it is the token, compared in constant time."""
    return given is not None and hmac.compare_digest(given.encode(), token.encode())


def cookie_of(header: str | None, name: str) -> str | None:
    """The value of a cookie in a Cookie header."""
    if not header:
        return None
    try:
        morsel = SimpleCookie(header).get(name)
    except CookieError:
        return None
    return None if morsel is None else morsel.value


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


@dataclass(slots=True)
class TokenBucket:
    """Permits bursts of ``burst`` and a mean rate of ``rate``, 1/s.

    Attributes: rate (1/s), burst, level (remaining), at (s, last update).
    """

    rate: float
    burst: float
    level: float
    at: float

    def take(self, now: float) -> bool:
        """Whether one more is permitted at time ``now``, s."""
        self.level = min(self.level + (now - self.at) * self.rate, self.burst)
        self.at = now
        if self.level < 1.0:
            return False
        self.level -= 1.0
        return True

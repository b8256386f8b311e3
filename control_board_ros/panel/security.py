# SPDX-License-Identifier: Apache-2.0
"""Who may come in: token, Host, Origin, sizes and rates. Pure functions, and no ROS."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import urlsplit

#: Bytes of a message of a browser, and of all the header lines of a request.
MAX_MESSAGE = 16 * 1024
#: Messages a second of one browser in the long run, and at once.
RATE, BURST = 80.0, 160.0
#: Browsers at a time.
MAX_BROWSERS = 16

#: What every answer says: nothing of others runs in the page, and the page runs in no other.
HEADERS = {
    "Cache-Control": "no-cache",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


def new_token() -> str:
    """A token that nobody guesses: 192 bits."""
    return secrets.token_urlsafe(24)


def cookie_name(port: int) -> str:
    """Browsers keep cookies by host, not by port: two panels on one host need two names."""
    return f"control_board_panel_{port}"


def is_token(given: str | None, token: str) -> bool:
    """Whether it is the token; takes as long for every wrong one."""
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
    """The name in a Host header, without its port; None where it is no such header."""
    try:
        parts = urlsplit(f"//{host}")
        if parts.username is not None or parts.path or parts.query or parts.fragment:
            return None
        _ = parts.port  # raises where it is no number
    except ValueError:
        return None
    return parts.hostname


def allowed_host(host: str | None, names: frozenset[str]) -> bool:
    """Whether a Host header names this machine.

    A foreign page can make a name of its own point here (DNS rebinding), and the browser then
    takes us for that page's server. It cannot do so with an address, nor with names of ours.

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
    """Whether a page that opens a WebSocket is our own: every browser says where it is from."""
    if not origin or not host:
        return False
    scheme, mark, rest = origin.partition("://")
    return bool(mark) and scheme in ("http", "https") and rest.lower() == host.lower()


@dataclass(slots=True)
class TokenBucket:
    """Lets through ``burst`` at once, and ``rate`` a second in the long run.

    Attributes: rate (1/s), burst, level (what is left), at (s, of the last look).
    """

    rate: float
    burst: float
    level: float
    at: float

    @classmethod
    def full(cls, rate: float, burst: float, now: float) -> TokenBucket:
        """A bucket from which nothing was taken."""
        return cls(rate, burst, burst, now)

    def take(self, now: float) -> bool:
        """Whether one more may pass at this time, s."""
        self.level = min(self.level + (now - self.at) * self.rate, self.burst)
        self.at = now
        if self.level < 1.0:
            return False
        self.level -= 1.0
        return True

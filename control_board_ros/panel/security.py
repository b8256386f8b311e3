# SPDX-License-Identifier: Apache-2.0
"""Access control: token, sizes and rates. Pure functions, no ROS."""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie

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


def is_token(text: str | None, token: str) -> bool:
    """Whether it is the token, compared in constant time."""
    return text is not None and hmac.compare_digest(text.encode(), token.encode())


def cookie_of(header: str | None, name: str) -> str | None:
    """The value of a cookie in a Cookie header."""
    if not header:
        return None
    try:
        morsel = SimpleCookie(header).get(name)
    except CookieError:
        return None
    return None if morsel is None else morsel.value


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

# SPDX-License-Identifier: Apache-2.0
"""Errors in users' files, one line each."""

from __future__ import annotations


class OneLineError(ValueError):
    """A one-line error text; unprintable characters are replaced."""

    def __init__(self, text: str) -> None:
        shown = (c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
        super().__init__("".join(shown))

# SPDX-License-Identifier: Apache-2.0
"""Errors about files of users, each one line for people."""

from __future__ import annotations


class OneLineError(ValueError):
    """Says in one line what is wrong, whatever characters a path or a file brought in."""

    def __init__(self, text: str) -> None:
        shown = (c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
        super().__init__("".join(shown))

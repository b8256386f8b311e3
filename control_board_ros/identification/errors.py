# SPDX-License-Identifier: Apache-2.0
"""Why something cannot be identified."""

from __future__ import annotations


class IdentificationError(Exception):
    """A value that is not allowed, or data that shows nothing; one line for people."""

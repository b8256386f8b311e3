# SPDX-License-Identifier: Apache-2.0
"""Errors of a search."""


class TuningError(Exception):
    """One line: cause and next step."""

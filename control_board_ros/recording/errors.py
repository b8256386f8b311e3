# SPDX-License-Identifier: Apache-2.0
"""Errors of recordings."""

from __future__ import annotations

import importlib
from typing import Any


class RecordingError(Exception):
    """One line: cause and next step."""


def library(name: str) -> Any:
    """Import a module of the extra ``record``; raises RecordingError where it is not installed."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        package = name.partition(".")[0]
        raise RecordingError(
            f"{package} is not installed; install it with: pip install 'control_board_ros[record]'"
        ) from error

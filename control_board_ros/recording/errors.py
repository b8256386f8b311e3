# SPDX-License-Identifier: Apache-2.0
"""What goes wrong with recordings."""

from __future__ import annotations

import importlib
from typing import Any


class RecordingError(Exception):
    """One line: what does not work, and what to do."""


def library(name: str) -> Any:
    """A module of the extra ``record``.

    Raises:
        RecordingError: it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        package = name.partition(".")[0]
        raise RecordingError(
            f"{package} is not installed; install it with: pip install 'control_board_ros[record]'"
        ) from error

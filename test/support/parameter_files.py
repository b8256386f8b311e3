# SPDX-License-Identifier: Apache-2.0
"""Parameter files of tests, and what is said of those that are refused."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from control_board_ros.settings.loading import load
from control_board_ros.settings.yaml_tree import SettingsError


def written(folder: Path, text: str | bytes, section: str = "control_board") -> Path:
    path = folder / "board.yaml"
    if isinstance(text, str) and section:
        body = "\n".join("    " + line for line in text.splitlines())
        text = f"{section}:\n  ros__parameters:\n{body}\n"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def refusal(*arguments: Any) -> str:
    start = time.process_time()
    with pytest.raises(SettingsError) as caught:
        load(*arguments)
    text = str(caught.value)
    assert "\n" not in text
    assert len(text) < 1000
    assert time.process_time() - start < 15.0  # s of CPU time; a bomb takes far more
    return text

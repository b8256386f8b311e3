# SPDX-License-Identifier: Apache-2.0
"""docs/modes.md is drawn from the tables, and fresh."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

from control_board_ros.core.terms.modes import STATES, TRANSITIONS

DIAGRAM = Path(__file__).resolve().parents[2] / "docs" / "diagram.py"


def load() -> Any:
    spec = importlib.util.spec_from_file_location("diagram", DIAGRAM)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_fresh() -> None:
    written = DIAGRAM.with_name("modes.md").read_text(encoding="utf-8")
    assert written.endswith(load().page()), "docs/modes.md is stale; write it with: make docs"


def test_every_row_is_drawn() -> None:
    """Each transition has its arrow, with its trigger at it; each state is in the table."""
    diagram = load()
    page = diagram.page()
    for (mode, trigger), target in TRANSITIONS.items():
        if diagram.word(trigger) == "power-on":
            assert "[*] --> NOT_CONFIGURED : power-on" in page
            continue
        for box in diagram.boxes(target):
            start = diagram.node(mode)
            if start == box == "IDLE":
                continue
            line = next(line for line in page.splitlines() if f"{start} --> {box} :" in line)
            assert diagram.word(trigger) in line
    for mode in STATES:
        assert f"| {mode.name} | `{mode.code}` |" in page

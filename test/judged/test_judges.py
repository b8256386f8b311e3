# SPDX-License-Identifier: Apache-2.0
"""The how-to and ``cbctl drives`` name the same judges."""

from __future__ import annotations

from pathlib import Path

import pytest

from control_board_ros.plants.entry_points import DRIVERS
from control_board_ros.plants.judges import JUDGED, JUDGES, judgement

PAGE = (Path(__file__).parents[2] / "docs" / "howto" / "drives.md").read_text("utf-8")


def test_every_driver_says_who_judged_it() -> None:
    assert set(JUDGES) == set(DRIVERS)


@pytest.mark.parametrize("driver", JUDGES)
def test_the_how_to_names_each_judge(driver: str) -> None:
    section = PAGE.partition("## Judged by")[2].partition("\n## ")[0]
    assert JUDGED in section
    for judge in JUDGES[driver]:
        assert judge.removesuffix(" (device)") in section
        assert judge in judgement(driver)

# SPDX-License-Identifier: Apache-2.0
"""The page with the iCub: 32 joints in six parts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from browsing import context_of
from marks import needs_icub
from waiting import until

from control_board_ros.testing import BoardProcess, board_process

pytestmark = [pytest.mark.slow, pytest.mark.ros, needs_icub]
PARTS = ["head", "torso", "left_arm", "right_arm", "left_leg", "right_leg"]


@pytest.fixture(scope="module")
def process() -> Iterator[BoardProcess]:
    with board_process({"robot": "icub", "physics": "ideal"}, robot="icub") as board:
        yield board


@pytest.fixture
def page(browser: Any, address: str) -> Iterator[Any]:
    """A large screen."""
    with context_of(browser, viewport={"width": 1920, "height": 1080}) as context:
        page = context.new_page()
        page.goto(address)
        until(lambda: page.locator("article.card").count() == 32)
        yield page


def test_32_joints_fit(page: Any) -> None:
    """As a table by default, in the robot's order, with whole names, the log beside them."""
    until(lambda: page.locator("h2.part").all_inner_texts() == PARTS)
    assert page.locator("#cards.as-table").count() == 1
    inside = (
        "all => all.every((e) => { const b = e.getBoundingClientRect(), j ="
        " (e.closest('.joints') ?? document.body).getBoundingClientRect();"
        " return b.height > 0 && b.top >= 0 && b.bottom <= j.bottom + 0.5 && b.right <= 1920.5 })"
    )
    assert page.locator("article.card, #log").evaluate_all(inside)
    names = page.locator("article h3")
    assert names.evaluate_all("all => all.every((e) => e.scrollWidth <= e.clientWidth)")
    assert "shoulder_pitch" in names.all_inner_texts()
    page.get_by_label("Joints as: Cards").click()
    assert page.locator("#cards.as-cards").count() == 1
    page.reload()
    until(lambda: page.locator("#cards.as-cards article").count() == 32)

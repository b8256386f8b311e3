# SPDX-License-Identifier: Apache-2.0
"""The page with the iCub: 32 joints in six parts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from browsing import PHONE, context_of
from marks import needs_icub
from waiting import until

from control_board_ros.testing import BoardProcess, board_process

pytestmark = [pytest.mark.slow, pytest.mark.ros, needs_icub]
PARTS = ["head", "torso", "left_arm", "right_arm", "left_leg", "right_leg"]


@pytest.fixture(scope="module")
def process() -> Iterator[BoardProcess]:
    params = {"robot": "icub", "physics": "ideal", "control_rate": 250.0}
    with board_process(params, robot="icub") as board:
        yield board


#: Parts of cards that are not inside their card, or lie on each other: texts by their letters.
OUTSIDE = """() => {
  const PARTS = "h3, .mode, header [role=radio], .more, .l, .n, .u, .value .icon, .limit, .number,"
    + " .jog, .steps button";
  const shown = (e) => e.checkVisibility({ visibilityProperty: true });
  const box = (e) => {
    if (e.children.length || !e.firstChild) return e.getBoundingClientRect();
    const range = document.createRange();
    range.selectNodeContents(e);
    return range.getBoundingClientRect();
  };
  const wrong = [];
  for (const card of document.querySelectorAll("article.card")) {
    const c = card.getBoundingClientRect();
    const parts = [...card.querySelectorAll(PARTS)].filter(shown);
    for (const [k, part] of parts.entries()) {
      const a = box(part);
      const name = part.getAttribute("class") ?? part.textContent;
      const is = `${card.querySelector("h3").textContent} ${name}`;
      const beyond = [c.left - a.left, a.right - c.right, c.top - a.top, a.bottom - c.bottom];
      if (Math.max(...beyond) > 0.5) wrong.push(`${is} is outside`);
      const size = parseFloat(getComputedStyle(part).fontSize);
      if (a.width && size < 12) wrong.push(`${is} is small`);
      for (const other of parts.slice(k + 1).map(box)) {
        const wide = Math.min(a.right, other.right) - Math.max(a.left, other.left);
        const high = Math.min(a.bottom, other.bottom) - Math.max(a.top, other.top);
        if (wide > 0.5 && high > 0.5) wrong.push(`${is} lies on another`);
      }
    }
  }
  return [...new Set(wrong)];
}"""
#: Modes whose words are cut in their menu: it is narrower than it would be by itself.
CUT = """() => {
  const { joint, mode } = panel.cards[0], before = joint.mode, cut = [];
  for (const code of ["pos", "posd", "vel", "mix", "torq", "open", "idl", "hwfa", "cal", "cfgn"]) {
    joint.mode = code;
    panel.cards[0].drawModes();
    const free = mode.cloneNode(false);
    free.append(mode.selectedOptions[0].cloneNode(true));
    free.style.width = "max-content";
    mode.after(free);
    const missing = free.getBoundingClientRect().width - mode.getBoundingClientRect().width;
    free.remove();
    if (missing > 0.5) cut.push(`${code} by ${missing} px`);
  }
  joint.mode = before;
  panel.cards[0].drawModes();
  return cut;
}"""
LONG = "left_arm_shoulder_pitch_joint1"  # 30 characters


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
    labels = page.get_by_label("Position reference of", exact=False)
    all_labels = labels.evaluate_all("all => all.map((e) => e.ariaLabel)")
    assert len(set(all_labels)) == len(all_labels)  # both arms have an elbow
    page.reload()
    until(lambda: page.locator("#cards.as-cards article").count() == 32)


#: Gives all joints a name, or their own again.
NAMED = """(name) => document.querySelectorAll("h3").forEach((e) => {
  e.dataset.name ??= e.textContent;
  e.replaceChildren(name ?? e.dataset.name);
})"""


@pytest.mark.parametrize(
    ("how", "sizes"),
    [({}, [(1280, 800), (1440, 900), (1920, 1080), (2560, 1440)]), (PHONE, [(390, 844)])],
    ids=["desk", "phone"],
)
def test_cards_hold_what_is_theirs(
    browser: Any, address: str, how: dict[str, Any], sizes: list[tuple[int, int]]
) -> None:
    """At every width, with the robot's names and with names of 30 characters."""
    with context_of(browser, **how) as context:
        page = context.new_page()
        page.goto(address)
        until(lambda: page.evaluate("panel.cards.length === 32"))
        until(lambda: page.evaluate("panel.cards.every((card) => card.joint.state)"))
        for width, height in sizes:
            page.set_viewport_size({"width": width, "height": height})
            for tab in ("All joints", "left_arm"):
                page.get_by_role("tab", name=tab).click()
                if how is not PHONE:
                    page.get_by_label("Joints as: Cards").click()
                page.evaluate(NAMED, None)
                until(lambda: not page.evaluate(OUTSIDE), lambda: page.evaluate(OUTSIDE))
                assert page.evaluate(CUT) == []
                page.evaluate(NAMED, LONG)
                assert page.evaluate(OUTSIDE) == []
        words = page.locator("#estop small")
        assert words.inner_text() == "arms without brakes fall"
        assert words.is_visible()

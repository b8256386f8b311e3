# SPDX-License-Identifier: Apache-2.0
"""Accessibility: axe-core's rules in both themes, the keyboard alone, the system's theme."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from browsing import PHONE, context_of, operate, press_if_there
from waiting import until

from control_board_ros.client import ControlBoardClient

pytestmark = [pytest.mark.slow, pytest.mark.ros]
#: The view is looked at, too.
IN_3D = True
#: WCAG 2.1, levels A and AA: names, roles, contrast.
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "best-practice"]
FAULT = "lbr_iiwa_joint_7"
#: What may have the keyboard now.
FOCUSABLE = """
[...document.querySelectorAll("button, select, input, summary, [tabindex='0']")]
 .filter((e) => !e.disabled && e.tabIndex >= 0 && e.checkVisibility({visibilityProperty: true}))
"""


def violations(page: Any) -> list[str]:
    """What axe-core has to say: rule, and the elements."""
    found = Axe().run(page, options={"runOnly": RULES}).response["violations"]
    return [
        f"{rule['id']}: {node['html'][:160]} {node['failureSummary'][:200]}"
        for rule in found
        for node in rule["nodes"]
    ]


@pytest.fixture
def busy(page: Any, client: ControlBoardClient) -> Iterator[None]:
    """A joint open, a plot, commands, another mode, and a fault."""
    operate(page)
    client.set_control_mode(None, "pos")
    client.set_control_mode("lbr_iiwa_joint_5", "vel")
    page.get_by_label("Plot position of joint_1", exact=True).click()
    page.get_by_label("More of joint_3").click()
    client.inject_fault(FAULT, "external")
    try:
        page.get_by_role("alert").get_by_text("joint_7").wait_for()
        page.get_by_label("Speeds: Reference speed, wanted").wait_for()
        yield
    finally:
        client.clear_injected_faults()
        client.set_control_mode(FAULT, "fidl")
        page.get_by_role("alert").wait_for(state="detached")
        page.get_by_label("More of joint_3").click()
        page.get_by_label("Remove all plots").click()


@pytest.mark.parametrize("theme", ["dark", pytest.param("light", marks=pytest.mark.soak)])
def test_axe_finds_nothing(page: Any, busy: None, theme: str) -> None:
    """With cards and with the table, and with a question."""
    page.emulate_media(color_scheme=theme)
    until(lambda: page.evaluate("document.documentElement.dataset.theme") == theme)
    for view in ("Table", "Cards"):
        page.get_by_label(f"Joints as: {view}").click()
        assert violations(page) == []
    page.get_by_label("Position reference of joint_1, typed; Enter sends").fill("90")
    page.keyboard.press("Enter")
    page.locator("#questions").wait_for()
    assert violations(page) == []
    press_if_there(page.get_by_label("Cancel: nothing moves"))


def test_axe_finds_nothing_on_a_phone(page: Any, browser: Any, address: str) -> None:
    """Of a spectator."""
    with context_of(browser, in_3d=IN_3D, **PHONE) as context:
        phone = context.new_page()
        phone.goto(address)
        phone.get_by_label("More of joint_2").click()
        phone.get_by_label("Speeds: Reference speed, wanted").wait_for()
        assert violations(phone) == []


def test_the_theme_follows_the_system(page: Any) -> None:
    """While it is changed; a choice of its own lasts until it is the system's again."""
    shown = "document.documentElement.dataset.theme"
    for theme in ("light", "dark"):
        page.emulate_media(color_scheme=theme)
        until(lambda theme=theme: page.evaluate(shown) == theme)
    page.get_by_label("Light colours").click()
    page.emulate_media(color_scheme="light")
    page.emulate_media(color_scheme="dark")
    assert page.evaluate(shown) == "light"
    page.get_by_label("Dark colours").click()
    page.emulate_media(color_scheme="light")
    until(lambda: page.evaluate(shown) == "light")
    page.emulate_media(color_scheme="dark")


def test_the_keyboard_reaches_everything(page: Any) -> None:
    """Tab goes through all controls, in the order that is seen, each with a focus that is seen."""
    page.locator("canvas[aria-label^='The robot in 3D']").wait_for()  # it comes last
    page.evaluate("document.activeElement.blur(); scrollTo(0, 0); window.reached = new Set(); 0")
    count = page.evaluate(f"{FOCUSABLE}.length")
    assert count > 60
    bare = set()
    for _ in range(count + 2):
        page.keyboard.press("Tab")
        unseen = page.evaluate(
            "(() => { const e = document.activeElement; reached.add(e);"
            " const s = getComputedStyle(e);"
            " const thumb = e.matches('.range, body');"  # its handle has it; the browser's own
            " return thumb || s.outlineStyle !== 'none' ? '' : nameOf(e) })()"
        )
        bare |= {unseen} - {""}
    assert bare == set()
    missed = page.evaluate(f"{FOCUSABLE}.filter((e) => !reached.has(e)).map(nameOf)")
    assert missed == []
    page.keyboard.press("Escape")
    page.locator("#log .entry", has_text="STOP: every joint").first.wait_for()

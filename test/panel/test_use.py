# SPDX-License-Identifier: Apache-2.0
"""Made for use: what fits the screen, what a finger hits, what is kept, in a real browser."""

from __future__ import annotations

import math
from typing import Any

import pytest
from browsing import PHONE, context_of, operate
from waiting import until

from control_board_ros.client import ControlBoardClient

pytestmark = [pytest.mark.slow, pytest.mark.ros, pytest.mark.usefixtures("rested")]
FRONT = "lbr_iiwa_"
#: px that a finger hits.
FINGER = 44
CONTROLS = "button, select, summary, input:not(.range)"


def is_inside(page: Any, selector: str) -> bool:
    """Whether everything of a kind is on the screen, whole."""
    inside: bool = page.locator(selector).evaluate_all(
        "all => all.every((e) => { const b = e.getBoundingClientRect();"
        " return b.height > 0 && b.top >= 0 && b.left >= 0 && b.bottom <= innerHeight + 0.5"
        " && b.right <= innerWidth + 0.5 && b.bottom <= (e.closest('.joints')"
        "?.getBoundingClientRect().bottom ?? innerHeight) + 0.5 })"
    )
    return inside


@pytest.mark.parametrize("view", ["Cards", "Table"])
def test_seven_joints_and_the_log_fit(page: Any, client: ControlBoardClient, view: str) -> None:
    """Also with a joint in MIXED, which has two sliders, and with a log that is long."""
    page.evaluate(
        "for (let k = 0; k < 40; k++) panel.log.add({at: k, who: '', what: 'b is gone'}); 0"
    )
    page.get_by_label(f"Joints as: {view}").click()
    client.set_control_mode(f"{FRONT}joint_3", "mix")
    page.locator("article[data-mode='mix']").wait_for()
    assert page.locator("article.card").count() == 7
    assert is_inside(page, "article.card")
    assert is_inside(page, "#log")
    cut = "all => all.filter((e) => e.scrollWidth > e.clientWidth).length"
    assert page.locator("article h3").evaluate_all(cut) == 0
    page.get_by_label("Joints as: Cards").click()


def test_a_line_of_the_table_opens(page: Any) -> None:
    page.get_by_label("Joints as: Table").click()
    line = page.locator("article.card").nth(2)
    height = line.bounding_box()["height"]
    assert height <= 30
    page.get_by_label("More of joint_3").click()
    until(lambda: line.bounding_box()["height"] > 5 * height)
    page.get_by_label("Speeds: Reference speed, wanted").wait_for()
    page.get_by_label("More of joint_3").click()
    page.get_by_label("Joints as: Cards").click()


def test_a_phone(page: Any, browser: Any, address: str) -> None:
    """What is pressed is large, one joint is open at a time, STOP is in reach all the time."""
    with context_of(browser, **PHONE) as context:
        phone = context.new_page()
        phone.goto(address)
        phone.get_by_label("More of joint_7").wait_for()
        opened = phone.locator("article.open h3")
        for joint in ("joint_2", "joint_5"):
            phone.get_by_label(f"More of {joint}").click()
            assert opened.all_inner_texts() == [joint]
        phone.get_by_label("Speeds: Reference speed, wanted").wait_for()
        small = phone.locator(CONTROLS).evaluate_all(
            "(all, least) => all.filter((e) => e.checkVisibility()).filter((e) => {"
            " const b = e.getBoundingClientRect(); return b.width < least || b.height < least })"
            ".map((e) => e.ariaLabel || e.outerHTML)",
            FINGER - 0.5,
        )
        assert small == []
        assert phone.evaluate("document.documentElement.scrollWidth") <= 390
        for _ in range(3):
            assert is_inside(phone, "#stop")
            phone.mouse.wheel(0, 900)
        closed = "all => Math.max(...all.map((e) => e.getBoundingClientRect().height))"
        assert phone.locator("article:not(.open)").evaluate_all(closed) <= 80


def test_a_value_is_plotted_by_its_button(page: Any) -> None:
    """With its reference beside it."""
    value = page.get_by_label("Plot position of joint_2", exact=True)
    assert value.get_attribute("aria-pressed") == "false"
    value.click()
    until(lambda: value.get_attribute("aria-pressed") == "true")
    page.locator("#plots .legend", has_text="joint_2 position").wait_for()
    last = "panel.plots.charts[0].plot.data.map((column) => column.at(-1))"
    until(lambda: len(page.evaluate(last)) == 3 and None not in page.evaluate(last))
    _, measured, reference = page.evaluate(last)
    assert measured == pytest.approx(reference, abs=0.5)
    value.click()
    until(lambda: value.get_attribute("aria-pressed") == "false")
    assert page.locator("#plots canvas").count() == 0


def test_commands_keep_their_history(page: Any, client: ControlBoardClient) -> None:
    """Each move its line, with time and result, also after a reload; all of them as a script."""
    box = page.get_by_label("Position reference of joint_7, typed; Enter sends")
    for value in ("2", "4", "3"):
        box.fill(value)
        box.press("Enter")
        wanted = math.radians(float(value))
        until(lambda w=wanted: abs(client.get_target_position(f"{FRONT}joint_7")[0] - w) < 1e-4)
    lines = page.locator("#log .entry code")

    def moves() -> list[str]:
        return [text for text in lines.all_inner_texts() if "cbctl move lbr_iiwa_joint_7" in text]

    until(lambda: len(moves()) >= 3)
    assert [round(math.degrees(float(m.partition("=")[2]))) for m in moves()[:3]] == [3, 4, 2]
    assert page.locator("#log .entry .result").first.inner_text() == "✓"
    page.reload()
    until(lambda: len(moves()) >= 3)
    operate(page)
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.get_by_label("Copy all as a script").click()
    script = page.evaluate("navigator.clipboard.readText()")
    assert script.startswith("#!/bin/sh\n")
    done = [line for line in script.splitlines() if "move lbr_iiwa_joint_7" in line]
    assert done[-3:] == moves()[:3][::-1]

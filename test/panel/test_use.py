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


def view_is_drawn(page: Any) -> None:
    until(lambda: page.evaluate("Boolean(panel.view && panel.view.robot && panel.view.placed)"))


def on_screen(page: Any, link: str) -> tuple[float, float]:
    """Where a link's origin is on the screen."""
    x, y, left, top, width, height = page.evaluate(
        "(link) => { const v = panel.view, p = v.camera.position.clone();"
        " v.camera.updateMatrixWorld(); v.robot.links[link].getWorldPosition(p).project(v.camera);"
        " const b = v.canvas.getBoundingClientRect(); return [p.x, p.y, b.x, b.y, b.width,"
        " b.height] }",
        link,
    )
    return left + (x + 1.0) / 2.0 * width, top + (1.0 - y) / 2.0 * height


def test_a_joint_is_dragged_in_the_view(page: Any, client: ControlBoardClient) -> None:
    """Where that is switched on; a long way is asked about, and a STOP voids it."""
    view_is_drawn(page)
    proposed = "panel.cards.some((card) => card.joint.proposed !== null)"
    place = (0.0, 0.0)

    def aimed() -> bool:
        """The pointer is on the joint; panes that open and close move the picture."""
        nonlocal place
        place = on_screen(page, f"{FRONT}link_4")
        page.mouse.move(*place)
        page.wait_for_timeout(200)
        known = page.evaluate("!panel.view.grasp.on || panel.view.grasp.over !== null")
        return bool(known and place == on_screen(page, f"{FRONT}link_4"))

    def drag(px: float) -> None:
        until(aimed)
        page.mouse.down()
        page.mouse.move(place[0], place[1] + px, steps=4)

    before = client.get_encoder()
    drag(80.0)
    assert not page.evaluate(proposed)  # it turns the view
    page.mouse.up()
    page.get_by_label("Show the whole robot").click()
    page.get_by_label("Drag joints in the view").click()
    drag(80.0)
    until(lambda: page.evaluate(f"{proposed} && panel.view.ghost.visible"))
    page.keyboard.press("Escape")
    page.mouse.move(place[0], place[1] + 100.0, steps=2)
    page.mouse.up()
    page.wait_for_timeout(600)
    assert client.get_encoder() == pytest.approx(before, abs=0.005)
    drag(120.0)
    page.mouse.up()
    page.get_by_label("Go: yes").wait_for()
    assert client.get_encoder() == pytest.approx(before, abs=0.005)
    name, wanted = page.evaluate(
        "panel.cards.map((card) => card.joint).filter((joint) => joint.proposed !== null)"
        ".map((joint) => [joint.name, joint.proposed])[0]"
    )
    page.get_by_label("Go: yes").click()
    until(lambda: abs(client.get_encoder(name)[0] - wanted) < 0.01)
    page.get_by_label("Drag joints in the view").click()


def test_the_view_fits_again(page: Any) -> None:
    """If the arm leaves it, unless it was turned by hand; the button resets it."""
    view_is_drawn(page)
    far = "panel.view.camera.position.length()"
    fitted = page.evaluate(far)
    nearer = "panel.view.camera.position.multiplyScalar(0.3); 0"
    page.evaluate(nearer)
    until(lambda: page.evaluate(far) > 0.7 * fitted)
    page.locator("#view canvas").focus()
    page.keyboard.press("ArrowLeft")
    page.evaluate(nearer)
    page.wait_for_timeout(1200)
    assert page.evaluate(far) < 0.5 * fitted
    page.get_by_label("Show the whole robot").click()
    until(lambda: page.evaluate(far) > 0.7 * fitted)

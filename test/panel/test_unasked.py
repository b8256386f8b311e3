# SPDX-License-Identifier: Apache-2.0
"""Nothing moves without a request: the page in a real browser, judged by the board."""

from __future__ import annotations

import math
import signal
from collections.abc import Iterator
from typing import Any

import pytest
from browsing import PHONE, context_of, operate, panel_beside, press_if_there
from waiting import insist, until

from control_board_ros.client import ControlBoardClient
from control_board_ros.testing import BoardProcess, board_process

pytestmark = [pytest.mark.slow, pytest.mark.ros, pytest.mark.usefixtures("rested")]
FRONT = "lbr_iiwa_"
#: ms in which a sent reference reaches the board.
LATER = 600
#: Degrees; maximum travel of a joint that holds.
STILL = 0.3


def degrees(client: ControlBoardClient, joint: str) -> float:
    return math.degrees(client.get_encoder(FRONT + joint)[0])


def moves(client: ControlBoardClient, joint: str) -> bool:
    return not client.check_motion_done(FRONT + joint)[0]


def slider_of(page: Any, joint: str) -> Any:
    return page.get_by_label(f"Position reference of {joint}", exact=True)


def box_of(page: Any, joint: str) -> Any:
    return page.get_by_label(f"Position reference of {joint}, typed; Enter sends")


def card_of(page: Any, joint: str) -> Any:
    return page.locator(f"article[aria-label='Joint {FRONT}{joint}']")


def shown(page: Any, joint: str) -> float:
    """The value of the slider, degrees."""
    return math.degrees(float(slider_of(page, joint).input_value()))


def go(page: Any) -> None:
    page.get_by_label("Go: yes").click()


def stop(page: Any, client: ControlBoardClient, joint: str) -> None:
    page.locator("#stop").click()
    until(lambda: not moves(client, joint))


def stays(page: Any, client: ControlBoardClient, joint: str, at: float) -> None:
    page.wait_for_timeout(LATER)
    assert not moves(client, joint)
    assert degrees(client, joint) == pytest.approx(at, abs=STILL)


def test_the_target_of_a_move_that_was_stopped_is_gone(
    page: Any, client: ControlBoardClient
) -> None:
    """One arrow key afterwards is one step, and not the rest of the way."""
    box_of(page, "joint_1").fill("100")
    box_of(page, "joint_1").press("Enter")
    go(page)
    until(lambda: moves(client, "joint_1"))
    until(lambda: page.evaluate("panel.cards[0].joint.goal > 1.7"))
    stop(page, client, "joint_1")
    held = degrees(client, "joint_1")
    until(lambda: abs(shown(page, "joint_1") - held) < STILL)
    slider_of(page, "joint_1").focus()
    page.keyboard.press("ArrowRight")
    stays(page, client, "joint_1", held)


@pytest.mark.parametrize("how", ["move of others", "posd", "idle", "reload"])
def test_the_slider_shows_where_the_joint_is(
    page: Any, client: ControlBoardClient, how: str
) -> None:
    """After any history, the next step begins at the joint's position."""
    name, joint = f"{FRONT}joint_3", "joint_3"
    if how == "posd":
        client.set_control_mode(name, "posd")
        client.set_position(name, client.get_encoder(name)[0] + 0.1)
    elif how == "idle":
        client.set_control_mode(name, "idl")
    client.set_control_mode(name, "pos")
    client.position_move(name, client.get_encoder(name)[0] + 0.6, 0.2)
    until(lambda: moves(client, joint))
    target = math.degrees(client.get_target_position(name)[0])
    until(lambda: abs(shown(page, joint) - target) < STILL)  # while it runs, of any program
    client.stop(name)
    until(lambda: abs(client.get_encoder_speed(name)[0]) < 1e-3)  # it brakes for half a degree
    held = degrees(client, joint)
    assert abs(held - target) > 1.0
    if how == "reload":
        page.reload()
        page.get_by_text("You operate", exact=True).wait_for()
    until(lambda: abs(shown(page, joint) - held) < STILL)
    slider_of(page, joint).focus()
    page.keyboard.press("ArrowLeft")
    stays(page, client, joint, held)


def test_requests_begun_before_stop_are_void(page: Any, client: ControlBoardClient) -> None:
    """Drag, Esc, on with the drag, release."""
    held = degrees(client, "joint_5")
    slider = slider_of(page, "joint_5")
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    middle = box["y"] + box["height"] / 2.0
    page.mouse.move(
        box["x"] + page.evaluate("panel.cards[4].sliders[0].handleAt()") - box["x"], middle
    )
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], middle, steps=4)
    page.keyboard.press("Escape")
    page.mouse.move(box["x"] + 0.65 * box["width"], middle, steps=4)
    page.mouse.up()
    stays(page, client, "joint_5", held)
    box_of(page, "joint_5").fill(str(held + 60.0))
    box_of(page, "joint_5").press("Enter")
    page.get_by_label("Go: yes").wait_for()
    page.keyboard.press("Escape")
    page.get_by_label("Go: yes").wait_for(state="hidden")
    stays(page, client, "joint_5", held)


def test_a_long_way_is_asked_about(page: Any, client: ControlBoardClient) -> None:
    """By a tap on the track and by a typed number; with from, to and time; not in Live."""
    held = degrees(client, "joint_7")
    slider = slider_of(page, "joint_7")
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    asked, yes = page.locator("#question-text"), page.get_by_label("Go: yes")
    insist(
        lambda: page.mouse.click(box["x"] + 0.8 * box["width"], box["y"] + box["height"] / 2.0),
        lambda: (page.evaluate("panel.cards[6].joint.proposed") or 0.0) > math.radians(held + 15),
    )
    assert f"from {held:.1f}°".replace("-0.0", "0.0") in asked.inner_text().replace("−", "-")
    assert " s?" in asked.inner_text()
    press_if_there(page.get_by_label("Cancel: nothing moves"))
    stays(page, client, "joint_7", held)
    page.get_by_label("Ask before ways longer than this, degrees").fill("5")
    page.get_by_label("Ask before ways longer than this, degrees").press("Tab")
    assert page.evaluate("panel.askAbove") == 5

    def typed() -> None:
        box_of(page, "joint_7").fill(str(held + 8.0))
        box_of(page, "joint_7").press("Enter")

    insist(typed, yes.is_visible)
    stays(page, client, "joint_7", held)  # the key that was pressed is no answer
    insist(
        lambda: (None if yes.is_visible() else typed(), press_if_there(yes)),
        lambda: abs(degrees(client, "joint_7") - held - 8.0) < STILL,
    )
    page.get_by_label("Ask before ways longer than this, degrees").fill("15")
    page.get_by_label("Ask before ways longer than this, degrees").press("Tab")


@pytest.mark.parametrize("text", ["400", "30mm", "12 apples"])
def test_a_wrong_number_is_refused(page: Any, client: ControlBoardClient, text: str) -> None:
    held = degrees(client, "joint_1")
    box_of(page, "joint_1").fill(text)
    box_of(page, "joint_1").press("Enter")
    said = page.locator("#toast.bad")
    said.wait_for()
    assert ("outside its limits, −168" in said.inner_text()) == (text == "400")
    assert ("deg or rad" in said.inner_text()) == (text != "400")
    stays(page, client, "joint_1", held)


def test_the_menu_of_modes_acts_on_enter(page: Any, client: ControlBoardClient) -> None:
    menu = page.get_by_label("Control mode of joint_3", exact=True)
    menu.focus()
    for _ in range(3):
        page.keyboard.press("ArrowDown")
    page.wait_for_timeout(LATER)
    assert client.get_control_mode(f"{FRONT}joint_3")[0].code == "pos"
    page.keyboard.press("Tab")
    assert menu.input_value() == "pos"  # left without Enter, it shows the present mode
    menu.focus()
    for _ in range(2):
        page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    until(lambda: client.get_control_mode(f"{FRONT}joint_3")[0].code == "vel")


@pytest.mark.parametrize("mode", ["idl", "torq", "open"])
def test_a_joint_that_would_fall_is_asked_about(
    page: Any, client: ControlBoardClient, mode: str
) -> None:
    menu = page.get_by_label("Control mode of joint_2", exact=True)
    asked = page.locator("#question-text")
    insist(lambda: menu.select_option(mode), asked.is_visible)
    assert "N·m" in asked.inner_text()
    press_if_there(page.get_by_label("Cancel: nothing moves"))
    page.wait_for_timeout(LATER)
    assert client.get_control_mode(f"{FRONT}joint_2")[0].code == "pos"
    assert menu.input_value() == "pos"

    def answered() -> None:
        menu.select_option(mode)
        press_if_there(page.get_by_label("Set: yes"))

    insist(answered, lambda: client.get_control_mode(f"{FRONT}joint_2")[0].code == mode)


@pytest.fixture
def phone(page: Any, browser: Any, address: str) -> Iterator[Any]:
    """A phone that operates; the desk's page has stepped back."""
    page.get_by_label("Step back: let others operate").click()
    with context_of(browser, **PHONE) as context:
        phone = context.new_page()
        phone.goto(address)
        phone.get_by_label("More of joint_7").wait_for()
        operate(phone)
        yield phone


class Finger:
    """A finger on a phone, by the browser's own input."""

    def __init__(self, phone: Any) -> None:
        self._session = phone.context.new_cdp_session(phone)
        self._phone = phone

    def _send(self, kind: str, points: list[dict[str, float]]) -> None:
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def swipe(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self._send("touchStart", [{"x": start[0], "y": start[1]}])
        for k in range(1, 11):
            x, y = (a + (b - a) * k / 10.0 for a, b in zip(start, end, strict=True))
            self._send("touchMove", [{"x": x, "y": y}])
            self._phone.wait_for_timeout(16)
        self._send("touchEnd", [])


#: Brings an element to the middle, where no bar covers it; resolves once it has stayed where it is
#: for ten frames: a scroll rolls on.
INTO_THE_MIDDLE = """element => new Promise((resolve) => {
  element.scrollIntoView({block: "center", behavior: "instant"});
  let before = "", frames = 0;
  const look = () => {
    const box = element.getBoundingClientRect(), now = `${box.x} ${box.y}`;
    frames = now === before ? frames + 1 : 0;
    before = now;
    if (frames < 10) requestAnimationFrame(look); else resolve();
  };
  look();
})"""


def centre(locator: Any, share: float = 0.5) -> tuple[float, float]:
    """A point of an element, once the page has come to rest."""
    locator.evaluate(INTO_THE_MIDDLE)
    box = locator.bounding_box()
    return box["x"] + share * box["width"], box["y"] + box["height"] / 2.0


def test_a_finger_that_scrolls_moves_nothing(phone: Any, client: ControlBoardClient) -> None:
    """Nor does a tap on the track; the handle does."""
    phone.get_by_label("More of joint_2").click()  # a list shows one joint in full
    track = card_of(phone, "joint_2").locator(".track").first
    held = degrees(client, "joint_2")
    finger = Finger(phone)
    before = phone.evaluate("scrollY")
    for share in (0.2, 0.35, 0.9):  # beside the handle
        x, y = centre(track, share)
        finger.swipe((x, y), (x + 15.0, y - 250.0))
        stays(phone, client, "joint_2", held)
    assert phone.evaluate("scrollY") != before  # it was a scroll
    phone.touchscreen.tap(*centre(track, 0.9))
    stays(phone, client, "joint_2", held)
    handle = card_of(phone, "joint_2").locator(".handle").first

    def dragged() -> None:
        x, y = centre(handle)
        finger.swipe((x, y), (x + 12.0, y))

    insist(dragged, lambda: abs(degrees(client, "joint_2") - held) > 1.0)


def test_a_finger_that_scrolls_from_a_button_moves_nothing(
    phone: Any, client: ControlBoardClient
) -> None:
    """A velocity acts once the finger rests on its button."""
    client.set_control_mode(f"{FRONT}joint_6", "vel")
    phone.get_by_label("More of joint_6").click()
    button = phone.get_by_label("Velocity of joint_6 up, while held")
    button.wait_for()
    held = degrees(client, "joint_6")
    x, y = centre(button)
    Finger(phone).swipe((x, y), (x, y - 200.0))
    stays(phone, client, "joint_6", held)
    phone.evaluate("scrollTo(0, 0)")


def test_requests_to_take_over_are_shown(
    page: Any, client: ControlBoardClient, browser: Any, address: str
) -> None:
    """Also on a page that is scrolled down, with the consequence of no answer.

    The banner keeps its element while the question is the same: another banner takes no button
    from under a finger, restarts no countdown and signals no second time.
    """
    page.evaluate("window.calls = 0; navigator.vibrate = () => { window.calls += 1; }; 0")
    asked = page.locator(".banner.ask")
    with context_of(browser, viewport={"width": 390, "height": 844}) as context:
        other = context.new_page()
        other.goto(address)
        other.get_by_label("Ask to take over").click()
        asked.wait_for()
        first, ends = asked.element_handle(), page.evaluate("panel.banners.until")
        client.inject_fault(f"{FRONT}joint_7", "external")
        page.locator(".banner.fault").get_by_text("joint_7").wait_for()
        client.clear_injected_faults()
        page.get_by_label("Clear faults: the joints go to idle, without power").click()
        page.locator(".banner.fault").wait_for(state="detached")
        assert asked.evaluate("(e, first) => e === first", first)
        assert page.evaluate("[panel.banners.until, window.calls]") == [ends, 1]
        assert asked.evaluate("e => getComputedStyle(e).position") == "fixed"
        box, stop = asked.bounding_box(), page.locator("#stop").bounding_box()
        assert 0.0 <= box["y"] < 100.0
        assert stop["y"] + stop["height"] <= box["y"]  # STOP stays in reach
        assert "Without an answer control goes there in" in asked.inner_text()
        page.get_by_text("Keep operating").click()
        asked.wait_for(state="detached")
        for calls in (1, 2):  # a question that is asked again is another one
            assert page.evaluate("window.calls") == calls
            if calls == 1:
                other.get_by_label("Ask to take over").click()
                asked.wait_for()
        page.get_by_text("Keep operating").click()
        asked.wait_for(state="detached")


def test_a_paused_board_is_shown_as_paused(
    page: Any, client: ControlBoardClient, process: BoardProcess
) -> None:
    """A process that was stopped: words on every card, and controls that are dead."""
    process.process.send_signal(signal.SIGSTOP)
    try:
        for card in page.locator("article.card").all():
            card.get_by_text("the board does not answer").wait_for()
        menus = page.locator("article select.mode")
        assert all(menus.nth(k).is_disabled() for k in range(menus.count()))
        assert page.get_by_text("Moving.").count() == 0
    finally:
        process.process.send_signal(signal.SIGCONT)
    until(lambda: page.evaluate("panel.cards.every((card) => !card.mode.disabled)"))


def test_a_stop_names_the_board_that_does_not_answer(page: Any, process: BoardProcess) -> None:
    """The panel's server lives: the words send nobody to it."""
    process.process.send_signal(signal.SIGSTOP)
    try:
        page.locator("article.card.silent").first.wait_for()
        page.keyboard.press("Escape")
        said = page.locator("#toast.loud", has_text="STOP NOT CONFIRMED")
        said.wait_for()
        assert "control_board does not answer: no state for" in said.inner_text()
    finally:
        process.process.send_signal(signal.SIGCONT)
    until(lambda: page.evaluate("panel.cards.every((card) => !card.mode.disabled)"))


def test_an_unsent_stop_is_reported(browser: Any, tmp_path: Any) -> None:
    """With the panel's own server gone, STOP looks dead and says so."""
    with (
        board_process({}, env={"XDG_CONFIG_HOME": str(tmp_path)}) as board,
        panel_beside(board.environment) as (panel, address),
        context_of(browser, viewport={"width": 1440, "height": 900}) as context,
    ):
        page = context.new_page()
        page.goto(address)
        page.get_by_text("You operate", exact=True).wait_for()
        panel.kill()
        page.locator("#stop.dead").wait_for()
        assert "NO STOP" in page.locator("#stop").inner_text()
        page.locator("#stop").click()
        page.locator("#toast.loud", has_text="STOP NOT SENT").wait_for()

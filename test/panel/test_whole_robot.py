# SPDX-License-Identifier: Apache-2.0
"""The page with a robot of two parts: states of the robot's own board, commands by part."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from iiwa import JOINTS
from waiting import until

from control_board_ros.client import ControlBoardClient
from control_board_ros.testing import BoardProcess, board_process

pytestmark = [pytest.mark.slow, pytest.mark.ros]
#: Whose client the tests ask.
BOARD = "/pair/lower"
PARTS = {
    "upper": {"joints": [*JOINTS[:4]]},
    "lower": {"joints": [*JOINTS[4:]]},
}


@pytest.fixture(scope="module")
def process() -> Iterator[BoardProcess]:
    params = {"robot": "iiwa", "robot_name": "pair", "parts": PARTS, "physics": "ideal"}
    with board_process(params | {"control_rate": 250.0}, robot="pair") as board:
        yield board


def shown(page: Any, joint: str, what: str) -> Any:
    """What the page knows of a joint."""
    return page.evaluate(f"panel.cards.find((c) => c.joint.name === '{joint}').joint.{what}")


def test_parts_are_received_together(page: Any) -> None:
    """One message brings the state of all parts; a tab brings that of its board."""
    until(lambda: page.evaluate("panel.cards.length") == 7)
    until(lambda: page.evaluate("panel.watched") == "/pair/robot")
    until(lambda: page.evaluate("panel.cards.every((card) => card.joint.state)"))
    assert page.locator("h2.part").all_inner_texts() == ["upper", "lower"]  # the robot's order
    tabs = page.get_by_role("tab").all_inner_texts()
    assert tabs == ["All joints", "upper", "lower"]  # the robot's own board is all joints
    for part, number in (("lower", 3), ("upper", 4)):
        page.get_by_role("tab", name=part).click()
        until(lambda part=part: page.evaluate("panel.watched") == f"/pair/{part}")
        until(lambda n=number: page.evaluate("panel.cards.length") == n)
    page.get_by_role("tab", name="All joints").click()
    until(lambda: page.evaluate("panel.watched") == "/pair/robot")


def test_tabs_by_keyboard(page: Any) -> None:
    """Arrow keys choose the next one, which then has the focus."""
    page.get_by_role("tab", name="All joints").focus()
    for key, tab in (
        ("Right", "upper"),
        ("Right", "lower"),
        ("Left", "upper"),
        ("Left", "All joints"),
    ):
        page.keyboard.press(f"Arrow{key}")
        assert page.evaluate("document.activeElement.textContent") == tab
        assert page.evaluate("document.activeElement.ariaSelected") == "true"


def test_a_part_is_driven_and_the_whole_stops(page: Any, client: ControlBoardClient) -> None:
    joint = JOINTS[4]
    page.get_by_label("Position reference of joint_5, typed; Enter sends").fill("100")
    page.keyboard.press("Enter")
    page.get_by_label("Go: yes").click()
    until(lambda: not client.check_motion_done(joint)[0])
    until(lambda: shown(page, joint, "state.motion_done") is False)
    page.locator("code", has_text=f"cbctl --board /pair/lower move {joint}").first.wait_for()
    page.keyboard.press("Escape")
    page.locator("#toast", has_text="Stopped").wait_for()  # or it ends what comes next
    until(lambda: client.check_motion_done(joint)[0])


def test_torque_held_in_a_part_returns(page: Any, client: ControlBoardClient) -> None:
    """To the holding torque, known here from the robot's state only."""
    joint = JOINTS[5]
    page.get_by_label("Control mode of joint_6", exact=True).select_option("torq")
    until(lambda: shown(page, joint, "mode") == "torq")
    until(lambda: client.get_control_mode(joint)[0].code == "torq")
    k = client.names.index(joint)
    rest = client.get_state().torque_reference[k]
    page.get_by_label("Torque of joint_6 up, while held").focus()
    page.keyboard.down("Space")
    until(lambda: client.get_state().torque_reference[k] > rest + 0.1)
    page.keyboard.up("Space")
    until(lambda: client.get_state().torque_reference[k] == pytest.approx(rest))
    page.keyboard.press("Escape")
    until(lambda: client.get_control_mode(joint)[0].code == "pos")


def test_the_panels_own_requests_are_not_shown_as_others(page: Any) -> None:
    """The robot's board shows the changes that the panel asks of a part."""
    entries = page.locator("#log .entry .from").all_inner_texts()
    assert "another program" not in entries
    assert not page.locator("#log .entry", has_text="→").count()


def test_signals_of_several_boards(page: Any) -> None:
    """Those of a board that is not shown go on, and CSV names the boards."""
    for part, joint in (("upper", "joint_1"), ("lower", "joint_5")):
        page.get_by_role("tab", name=part).click()
        page.get_by_label(f"Plot position of {joint}", exact=True).click()
    counts = "panel.plots.signals.map((s) => s.times.length)"
    before = page.evaluate(counts)
    until(lambda: all(b > a for a, b in zip(before, page.evaluate(counts), strict=True)))
    assert "upper joint_1 position" in page.locator("#plots .legend").inner_text()
    with page.expect_download() as csv:
        page.get_by_label("Save the plots as CSV").click()
    head, *rows = Path(csv.value.path()).read_text("utf-8").splitlines()
    assert f"/pair/upper/{JOINTS[0]}.position," in head
    assert f"/pair/lower/{JOINTS[4]}.position_reference" in head
    assert len(rows) > 2
    page.get_by_label("Remove all plots").click()
    page.get_by_role("tab", name="All joints").click()

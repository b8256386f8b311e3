# SPDX-License-Identifier: Apache-2.0
"""A panel with a stand-in; and a real board, the panel beside it, and a real browser."""

from __future__ import annotations

import math
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browsing import context_of, operate, panel_beside
from cbctl_process import interrupted
from playwright import sync_api as playwright
from standins import Panel, StandIn, panel_of
from talk import patient
from waiting import until

from control_board_ros.client import ControlBoardClient
from control_board_ros.panel import robot
from control_board_ros.testing import BoardProcess, board_process, ros_node

ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
#: The joint that carries the arm, rad, away from its limits: 3.3 % of its torque, where 2 % is a
#: load to the page. (At 30 degrees it was 2.1 %: while it swung no question came.)
CARRIER, CARRYING = "lbr_iiwa_joint_2", math.radians(50.0)
#: m/s²: an arm that a test lets go lies down, and throws no other joint beyond its speed (F7).
FALLING = [0.0, 0.0, -2.0]
#: Notes down which controls are used, by what a screen reader calls them.
USED = """
window.used = new Set();
window.seen = new Set();
window.nameOf = (e) => (e.getAttribute("aria-label") || e.textContent || "").trim()
 .replace(/joint_\\d/g, "joint");
const note = (event) => {
  const control = event.target.closest?.("button, select, input, summary");
  if (control) window.used.add(window.nameOf(control));
};
for (const kind of ["pointerdown", "change", "keydown", "click"]) {
  addEventListener(kind, note, true);
}
setInterval(() => {
  for (const e of document.querySelectorAll("button, select, input, summary")) {
    if (e.checkVisibility({visibilityProperty: true})) window.seen.add(window.nameOf(e));
  }
}, 50);
"""


@pytest.fixture(scope="module")
def stand_in_panel() -> Iterator[Panel]:
    with panel_of(StandIn("/b", 0, ["pos", "vel", "torq", "idl"])) as panel:
        yield panel


@pytest.fixture
def panel(stand_in_panel: Panel) -> Iterator[Panel]:
    """The panel of a stand-in, without browsers, and without requests to its board."""
    board = stand_in_panel.board()
    board.calls.made.clear()
    board.calls.refused, board.calls.delay, board.robot = "", 0.0, robot.NO_ROBOT
    yield stand_in_panel
    stand_in_panel.close()


@pytest.fixture(scope="module")
def process(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BoardProcess]:
    """The iiwa, with fault injection and a folder for poses of its own."""
    if CHROMIUM is None:
        pytest.skip("there is no chromium; on Debian: sudo apt-get install chromium")
    home = {"XDG_CONFIG_HOME": str(tmp_path_factory.mktemp("config"))}
    params = {"allow_fault_injection": True, "gravity": FALLING, "control_rate": 250.0}
    with board_process(params, env=home) as board:
        yield board


@pytest.fixture(scope="module")
def client(process: BoardProcess, request: pytest.FixtureRequest) -> Iterator[ControlBoardClient]:
    """What the board itself says, or that which the file names."""
    name = getattr(request.module, "BOARD", "control_board")
    with (
        ros_node(process.domain, "user", spin=False) as node,
        patient(node, name) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the panel records."""
    return tmp_path_factory.mktemp("recordings")


@pytest.fixture(scope="module")
def address(process: BoardProcess, recordings: Path) -> Iterator[str]:
    """Where the panel is, with its token."""
    words = ("--takeover", "10min", "--recordings", str(recordings))
    with panel_beside(process.environment, *words) as (panel, address):
        yield address
        done = interrupted(panel, signal.SIGTERM)
    assert (done.code, done.err) == (0, ""), done


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, without a screen; each page has a context of its own.

    A module's, as its client runs an event loop in this thread for as long as it is open, and
    other tests run loops of their own. (In a folder without ``__init__.py`` the scope "package" is
    the session.)
    """
    with playwright.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def page(browser: Any, address: str, request: pytest.FixtureRequest) -> Iterator[Any]:
    """The panel on a desk, of the operator; in 3D where the file says so."""
    desk = {"viewport": {"width": 1440, "height": 900}, "color_scheme": "dark"}
    in_3d = getattr(request.module, "IN_3D", False)
    with context_of(browser, in_3d=in_3d, **desk) as context:
        yield from operated(context, address)


@pytest.fixture
def rested(page: Any, client: ControlBoardClient) -> Iterator[None]:
    """The page operates, all joints hold and are at rest, no question is open."""
    operate(page)
    if any(fault.active for fault in client.get_faults()):  # a long fall ends in one
        recovered = client.recover()
        assert recovered, recovered.message
    held = client.set_control_mode(None, "pos")
    assert held, held.message
    if abs(client.get_encoder(CARRIER)[0] - CARRYING) > 0.005:  # it fell in a test before
        moved = client.move(CARRIER, CARRYING, 1.0)
        assert moved, moved.message
    until(lambda: page.evaluate("panel.cards.every((card) => card.joint.mode === 'pos')"))
    until(lambda: np.abs(client.get_encoder_speed()).max() < 0.01)  # pushed in a test before
    yield
    operate(page)
    stops = "panel.log.entries.filter((entry) => entry.what === 'stop').length"
    before = page.evaluate(stops)
    page.keyboard.press("Escape")
    until(lambda: page.evaluate(stops) > before)
    until(lambda: all(client.check_motion_done()))


def operated(context: Any, address: str) -> Iterator[Any]:
    """A page that operates, and has no errors in the end."""
    context.add_init_script(USED)
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda m: errors.append(m.text) if m.type == "error" else None)
    page.on(
        "response", lambda r: errors.append(f"{r.status} {r.url}") if r.status >= 400 else None
    )
    page.goto(address)
    page.get_by_label("More of joint_7").wait_for()
    page.get_by_text("You operate", exact=True).wait_for()
    yield page
    assert not errors, errors

# SPDX-License-Identifier: Apache-2.0
"""The page beside a board that says what no board would: the good board's cards work."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browsing import context_of, operate, panel_beside
from cbctl_process import interrupted
from waiting import GUARD, insist, until

from control_board_ros.client import ControlBoardClient
from control_board_ros.testing import BoardProcess

pytestmark = [pytest.mark.slow, pytest.mark.ros]
STRANGER = Path(__file__).parents[1] / "support" / "hostile_board.py"


@pytest.fixture(scope="module")
def address(process: BoardProcess) -> Iterator[str]:
    """Where the panel is; of strangers it complains in lines, and in nothing else."""
    with panel_beside(process.environment) as (panel, address):
        yield address
        done = interrupted(panel, signal.SIGTERM)
    assert done.code == 0, done
    assert "Traceback" not in done.err, done.err
    own = [line for line in done.err.splitlines() if "RTPS_" not in line]  # not the middleware's
    assert all(line.isprintable() for line in own), done.err


@pytest.fixture(autouse=True, params=["words", "lengths", "many", "nan", "laughs"])
def stranger(process: BoardProcess, request: pytest.FixtureRequest) -> Iterator[None]:
    words = [sys.executable, str(STRANGER), request.param]
    running = subprocess.Popen(words, env=process.environment, stderr=subprocess.DEVNULL)
    yield
    running.send_signal(signal.SIGINT)
    running.wait(GUARD)


def test_the_good_board_keeps_running(
    browser: Any, address: str, client: ControlBoardClient, request: pytest.FixtureRequest
) -> None:
    """The stranger's board is listed, the page draws on, and a slider of the good one moves it."""
    with context_of(browser) as context:
        page = context.new_page()
        drive_beside_it(page, address, client)
        if "words" in request.node.name:  # names that were cleaned are the names of its states
            page.get_by_role("tab", name="hostile").click()
            joints = "panel.model.boards.get('/hostile').joints"
            until(lambda: page.evaluate(f"{joints}.length > 2 && {joints}.every((j) => j.state)"))


def drive_beside_it(page: Any, address: str, client: ControlBoardClient) -> None:
    """Move a joint of the good board; the page before may have left after this one came."""
    page.goto(address)
    page.get_by_label("More of joint_7").wait_for()
    until(lambda: page.evaluate("panel.model.boards.has('/hostile')"))
    page.wait_for_timeout(1000)  # it says what it says
    assert page.locator("script:not([src])", has_text="alert").count() == 0
    here = math.degrees(client.get_encoder("lbr_iiwa_joint_7")[0])
    box = page.get_by_label("Position reference of joint_7, typed; Enter sends").first
    wanted = here + (5.0 if here < 0.0 else -5.0)
    insist(
        lambda: (operate(page), box.fill(f"{wanted:.3f}"), box.press("Enter")),
        lambda: abs(math.degrees(client.get_encoder("lbr_iiwa_joint_7")[0]) - wanted) < 0.5,
    )
    joint = "panel.model.boards.get('/control_board').joints[6]"
    shown = f"Math.abs({joint}.state.position * 180 / Math.PI"
    until(lambda: page.evaluate(f"{shown} - {wanted}) < 0.5"))

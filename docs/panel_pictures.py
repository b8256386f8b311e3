# SPDX-License-Identifier: Apache-2.0
"""Make the pictures of the panel: a real board, the panel beside it, and chromium.

python docs/panel_pictures.py         those of docs/images
python docs/panel_pictures.py FOLDER  all sizes, both themes, iiwa and iCub, each scene

Needs chromium, and the extras test and icub.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import math
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from control_board_ros.client import ControlBoardClient
from control_board_ros.testing import board_process, child_environment, free_domain, ros_node

IMAGES = Path(__file__).parent / "images"
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]
DESK, WIDE, PHONE = (1440, 900), (1920, 1080), (390, 844)
SIZES, THEMES = (DESK, WIDE, PHONE), ("dark", "light")
#: Robot, scene, size, theme -> picture in docs/images.
SHOWN = {
    ("iiwa", "motion", DESK, "dark"): "panel.png",
    ("iiwa", "motion", DESK, "light"): "panel_light.png",
    ("iiwa", "asked", DESK, "light"): "panel_asked.png",
    ("iiwa", "motion", PHONE, "dark"): "panel_phone.png",
    ("iiwa", "asked", PHONE, "light"): "panel_phone_asked.png",
    ("iiwa", "fault", DESK, "dark"): "panel_fault.png",  # the last: its joint falls
    ("icub", "motion", WIDE, "dark"): "panel_robot.png",
    ("icub", "motion", PHONE, "light"): "panel_robot_phone.png",
    ("none", "empty", DESK, "dark"): "panel_no_board.png",
}
Client = ControlBoardClient
Key = tuple[str, str, tuple[int, int], str]


def chromium(play: Any) -> Any:
    """Chromium, as it is installed."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    return play.chromium.launch(executable_path=program, args=ARGUMENTS)


def wait_until_shown(page: Any) -> None:
    """Wait for control, the view in 3D, and a state of each joint."""
    page.get_by_text("You operate", exact=True).wait_for()
    while not page.evaluate(
        "Boolean(panel.view?.robot) && panel.cards.every((card) => card.joint.state)"
    ):
        page.wait_for_timeout(100)


def plot_positions(page: Any, *joints: str) -> None:
    """Plot positions of joints with their references."""
    for joint in joints:
        page.evaluate(
            "(name) => panel.plot(panel.cards.find((c) => c.joint.name === name).joint,"
            " 'position')",
            joint,
        )


def move(client: Client, page: Any) -> None:
    """Joints in motion, in several modes, with plots."""
    desk = page.locator("#cards.as-list").count() == 0
    names = client.names
    arm = names if len(names) == 7 else [n for n in names if n.startswith(("l_", "r_"))][:14]
    if desk:
        plot_positions(page, arm[0], arm[3])
    else:
        page.locator("button.more").nth(1).click()
    back = client.get_encoder(arm)
    if len(names) == 7:
        client.set_control_mode(names[4], "vel")
        client.set_interaction_mode(names[1], "comp")
    page.wait_for_timeout(1500)
    moving = [arm[0], arm[1], arm[3]]
    start = client.get_encoder(moving)
    client.position_move(moving, start + math.radians(24.0), math.radians(12.0))
    page.wait_for_timeout(1300)
    page.calls = lambda: (
        client.stop(),
        client.set_control_mode(None, "pos"),
        client.move(arm, back, 1.0),
    )


def fault(client: Client, page: Any) -> None:
    """A joint in fault."""
    client.inject_fault(client.names[1], "external")
    page.get_by_role("alert").wait_for()
    page.calls = lambda: (
        client.clear_injected_faults(),
        client.set_control_mode(client.names[1], "fidl"),
    )


def asked(_: Client, page: Any) -> None:
    """A request to take over."""
    other = page.context.browser.new_context().new_page()
    other.goto(page.address)
    other.get_by_label("Ask to take over").click()
    page.locator(".banner.ask").wait_for()
    page.calls = other.context.close


SCENES: dict[str, Callable[[Client, Any], None]] = {"motion": move, "asked": asked, "fault": fault}


@contextlib.contextmanager
def panel(environment: dict[str, str]) -> Iterator[str]:
    """The panel beside what runs in an environment; its address."""
    words = [sys.executable, "-m", "control_board_ros.cli", "panel", "--port", "0", "--json"]
    running = subprocess.Popen(
        [*words, "--takeover", "30s"], env=environment, stdout=subprocess.PIPE, text=True
    )
    try:
        assert running.stdout is not None
        yield json.loads(running.stdout.readline())["addresses"][0]
    finally:
        running.terminate()
        running.wait()


@contextlib.contextmanager
def robot(name: str) -> Iterator[tuple[dict[str, str], Client | None]]:
    """A robot, or none: the environment, and a client."""
    if name == "none":
        with free_domain() as domain:
            yield child_environment(domain), None
        return
    icub = name == "icub"
    params = {"robot": "icub", "physics": "ideal"} if icub else {"allow_fault_injection": True}
    home = {"XDG_CONFIG_HOME": tempfile.mkdtemp()}
    with (
        board_process(params, env=home, robot="icub" if icub else "") as board,
        ros_node(board.domain, "pictures", spin=False) as node,
        Client(node, board.name, find_timeout=60.0, answer_timeout=60.0) as client,
    ):
        yield board.environment, client


def take(browser: Any, address: str, client: Client | None, key: Key, path: Path) -> None:
    """One picture."""
    _, scene, (width, height), theme = key
    context = browser.new_context(
        viewport={"width": width, "height": height},
        color_scheme=theme,
        is_mobile=width < 500,
        has_touch=width < 500,
    )
    page = context.new_page()
    page.set_default_timeout(60_000)
    page.goto(address)
    page.calls, page.address = lambda: None, address
    if client is None:
        page.get_by_text("No board on this ROS domain").wait_for()
    else:
        client.set_control_mode(None, "pos")
        page.locator("article.card").nth(len(client.names) - 1).wait_for()
        wait_until_shown(page)
        SCENES[scene](client, page)
    page.wait_for_timeout(700)
    page.screenshot(path=path)
    page.calls()
    context.close()
    print(path)


def make(wanted: dict[Key, Path]) -> None:
    """Pictures by robot, scene, size and theme."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        browser = chromium(play)
        for name in dict.fromkeys(key[0] for key in wanted):
            with robot(name) as (environment, client), panel(environment) as address:
                for key, path in wanted.items():
                    if key[0] == name:
                        take(browser, address, client, key, path)
        browser.close()


def everything(folder: Path) -> dict[Key, Path]:
    """All of them."""
    scenes = [("iiwa", s) for s in SCENES] + [("icub", "motion"), ("icub", "asked")]
    keys = list(itertools.product([*scenes, ("none", "empty")], SIZES, THEMES))
    return {
        (name, scene, size, theme): folder / f"{name}_{scene}_{size[0]}_{theme}.png"
        for (name, scene), size, theme in keys
    }


def main(argv: list[str] | None = None) -> None:
    """Draw the pictures of docs/, or all into a folder."""
    parser = argparse.ArgumentParser(description="Make the pictures of the panel.")
    parser.add_argument("folder", nargs="?", type=Path, help="for all sizes, themes and scenes")
    folder = parser.parse_args(argv).folder
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
    make(everything(folder) if folder else {key: IMAGES / n for key, n in SHOWN.items()})


if __name__ == "__main__":
    main()

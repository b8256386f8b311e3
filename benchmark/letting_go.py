# SPDX-License-Identifier: Apache-2.0
"""Measure how soon a joint stops, by each way in which people let go of it.

python benchmark/letting_go.py [DEGREES_PER_SECOND]

A real board, a panel in a real browser, cbctl at a terminal. Joint 1 of the iiwa runs at the
speed, then it is let go. Printed: time and travel from that instant until it rests, by the board's
states at 250 Hz; medians of TIMES trials.
"""

from __future__ import annotations

import json
import math
import os
import pty
import shutil
import signal
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from control_board_ros.client import ControlBoardClient, State
from control_board_ros.testing import BoardProcess, board_process, ros_node

JOINT, SHORT = "lbr_iiwa_joint_1", "joint_1"
CBCTL = [sys.executable, "-m", "control_board_ros.cli"]
CHROMIUM = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]
#: s between repetitions of a held key or velocity.
REPEAT = 0.03
START = -1.5
#: Reference acceleration, rad/s².
ACCELERATION = 1.0
TIMES = 5


class Bench:
    """A joint in VELOCITY, and how it comes to rest.

    Args:
        client: of the board, whose state arrives at 250 Hz.
        speed: at which the joint is let go, rad/s.
    """

    def __init__(self, client: ControlBoardClient, speed: float) -> None:
        self.client, self.speed = client, speed

    def prepare(self) -> None:
        """The joint at its start, at rest, in VELOCITY."""
        self.client.set_control_mode(JOINT, "pos")
        self.client.move(JOINT, START, 1.0)
        self.client.set_control_mode(JOINT, "vel")

    def runs(self) -> bool:
        """Whether the joint has its speed."""
        state = self.client.get_state(fresh=False)
        return bool(state.velocity[state.names.index(JOINT)] > 0.99 * self.speed)

    def rest_after(self, let_go: Callable[[], object]) -> tuple[float, float]:
        """Let go; time and travel until rest, s and rad."""
        state = self.client.get_state()
        j = state.names.index(JOINT)
        start, place = state.stamp, state.position[j]
        let_go()

        def rests(state: State) -> bool:
            return bool(state.velocity_reference[j] == 0.0 and abs(state.velocity[j]) < 0.01)

        rested = self.client.wait_for_state(rests, 30.0)
        time.sleep(0.2)
        return rested.stamp - start, self.client.get_encoder(JOINT)[0] - place

    def streamed(self, let_go: Callable[[], object]) -> tuple[float, float]:
        """A program that sends velocities at 1/REPEAT Hz, then lets go."""
        self.prepare()
        while not self.runs():
            self.client.velocity_move(JOINT, self.speed)
            time.sleep(REPEAT)
        return self.rest_after(let_go)


@contextmanager
def panel_page(board: BoardProcess) -> Iterator[Callable[[], Any]]:
    """Opens pages of a panel beside the board, which operate."""
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium") or shutil.which("chromium-browser")
    words = [*CBCTL, "panel", "--port", "0", "--json"]
    panel = subprocess.Popen(words, env=board.environment, stdout=subprocess.PIPE, text=True)
    try:
        address = json.loads(panel.stdout.readline())["addresses"][0]
        with sync_playwright() as play:
            browser = play.chromium.launch(executable_path=program, args=CHROMIUM)

            def opened() -> Any:
                page = browser.new_page(viewport={"width": 1440, "height": 900})
                page.goto(address)
                page.get_by_text("You operate", exact=True).wait_for()
                return page

            yield opened
            browser.close()
    finally:
        panel.terminate()
        panel.wait()


def by_panel(bench: Bench, opened: Callable[[], Any], way: str) -> tuple[float, float]:
    """The button of a slider, by mouse or by key, or a page that is closed while it is held."""
    bench.prepare()
    page = opened()
    try:
        page.locator(f"article[aria-label='Joint {JOINT}'][data-mode='vel']").wait_for()
        box = page.get_by_label(f"Velocity that the buttons of {SHORT} give")
        box.fill(f"{math.degrees(bench.speed):.6g}")
        button = page.get_by_label(f"Velocity of {SHORT} up, while held")
        button.scroll_into_view_if_needed()
        if way == "mouse":
            place = button.bounding_box()
            page.mouse.move(place["x"] + place["width"] / 2, place["y"] + place["height"] / 2)
            page.mouse.down()
        else:
            button.focus()
            page.keyboard.down(" ")
        while not bench.runs():
            page.wait_for_timeout(10)
        ends = {"mouse": page.mouse.up, "key": lambda: page.keyboard.up(" "), "closed": page.close}
        return bench.rest_after(ends[way])
    finally:
        if not page.is_closed():
            page.close()


def by_terminal(
    bench: Bench, board: BoardProcess, words: list[str], key: bytes, end: str
) -> tuple[float, float]:
    """Run cbctl at a terminal: a key held and let go, or Ctrl-C."""
    bench.prepare()
    master, slave = pty.openpty()
    environment = board.environment | {"TERM": "xterm"}
    process = subprocess.Popen(
        [*CBCTL, *words], env=environment, stdin=slave, stdout=slave, stderr=slave
    )
    os.close(slave)
    reader = threading.Thread(target=drain, args=(master,), daemon=True)
    reader.start()
    while not bench.runs():
        if key:
            os.write(master, key)
        time.sleep(REPEAT)
    found = bench.rest_after(lambda: process.send_signal(signal.SIGINT) if end == "" else None)
    if process.poll() is None:
        os.write(master, end.encode())
    process.wait()
    return found


def drain(terminal: int) -> None:
    """Read what is shown, until the process has ended."""
    try:
        while os.read(terminal, 65536):
            pass
    except OSError:
        return


def main() -> None:
    """Print a line for each way."""
    speed = math.radians(float(sys.argv[1]) if len(sys.argv) > 1 else 30.0)
    shown = f"{math.degrees(speed):.6g}deg"
    with (
        board_process({"state_rate": 250.0}) as board,
        ros_node(board.domain, "letting_go", spin=False) as node,
        ControlBoardClient(node, "control_board") as client,
    ):
        client.set_ref_acceleration(JOINT, ACCELERATION)
        bench = Bench(client, speed)
        jog = ["jog", SHORT, "--speed", shown]
        with panel_page(board) as opened:
            ways = {
                "program, zero": lambda: bench.streamed(lambda: client.velocity_move(JOINT, 0.0)),
                "program, stop": lambda: bench.streamed(lambda: client.stop(JOINT)),
                "program, silence": lambda: bench.streamed(lambda: None),
                "cbctl jog, key": lambda: by_terminal(bench, board, jog, b"\x1b[C", "q"),
                "cbctl velocity, Ctrl-C": lambda: by_terminal(
                    bench, board, ["velocity", f"{SHORT}={shown}"], b"", ""
                ),
                "panel, mouse button": lambda: by_panel(bench, opened, "mouse"),
                "panel, key": lambda: by_panel(bench, opened, "key"),
                "panel, page closed": lambda: by_panel(bench, opened, "closed"),
            }
            print(f"let go at {math.degrees(speed):.0f} deg/s", flush=True)
            for name, way in ways.items():
                found = [way() for _ in range(TIMES)]
                took, travel = (statistics.median(values) for values in zip(*found, strict=True))
                print(f"{name:24} {took:5.2f} s  {math.degrees(travel):6.1f} deg", flush=True)
    print(f"medians of {TIMES}, load of the machine {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()

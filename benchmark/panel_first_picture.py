# SPDX-License-Identifier: Apache-2.0
"""Measure how long a page of the panel takes, beside a running board, until it shows its state.

python benchmark/panel_first_picture.py [TIMES]

Each load is a browser's first: nothing is cached. The time is the page's own, from its request.
"""

from __future__ import annotations

import json
import os
import shutil
import statistics
import subprocess
import sys
from typing import Any

from control_board_ros.testing import board_process

ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]
PANEL = [sys.executable, "-m", "control_board_ros.cli", "panel", "--port", "0", "--json"]
PAINTED = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime"
SHOWN = "performance.getEntriesByName('first state shown')[0]?.startTime"


def measure(browser: Any, address: str) -> tuple[float, float]:
    """First paint and first state on the screen, s after the request."""
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    try:
        page = context.new_page()
        page.goto(address)
        while not page.evaluate(f"Boolean({SHOWN} && {PAINTED})"):
            page.wait_for_timeout(20)
        return page.evaluate(PAINTED) / 1000.0, page.evaluate(SHOWN) / 1000.0
    finally:
        context.close()


def main() -> None:
    """Print the figures."""
    from playwright.sync_api import sync_playwright

    times = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    with board_process() as board, sync_playwright() as play:
        panel = subprocess.Popen(PANEL, env=board.environment, stdout=subprocess.PIPE, text=True)
        try:
            address = json.loads(panel.stdout.readline())["addresses"][0]
            browser = play.chromium.launch(executable_path=program, args=ARGUMENTS)
            measure(browser, address)  # the panel has found the board
            found = [measure(browser, address) for _ in range(times)]
            browser.close()
        finally:
            panel.terminate()
            panel.wait()
    for what, values in zip(
        ("first paint", "first state shown"), zip(*found, strict=True), strict=True
    ):
        print(f"{what}: median {statistics.median(values):.2f} s, longest {max(values):.2f} s")
    print(f"{times} loads, load of the machine {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores")


if __name__ == "__main__":
    main()

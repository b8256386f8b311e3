# SPDX-License-Identifier: Apache-2.0
"""Record the animation of the README: an arm moves, yields, faults and recovers.

    python docs/moving_picture.py

A real board, slowed down so that each frame can be drawn, the panel beside it, and chromium. Needs
chromium and the extra test.
"""

from __future__ import annotations

import io
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from panel_pictures import chromium, panel, plot_positions, wait_until_shown
from PIL import Image

from control_board_ros.client import ControlBoardClient
from control_board_ros.interface import EXTERNAL_TORQUE
from control_board_ros.testing import board_process, ros_node

PICTURE = Path(__file__).parent / "images" / "board.gif"
#: px, of the page and of the picture.
PAGE, SHOWN = (1440, 900), (960, 600)
#: Simulated time from frame to frame, s, and the slow-down of the recording.
STEP, SLOWNESS = 0.15, 8.0
#: Largest size, bytes, and the numbers of colours to try.
MOST, COLOURS = 2_000_000, (192, 128, 96, 64, 48, 32)


def scenes(client: ControlBoardClient, node: Any) -> Iterator[float]:
    """The scene; yields the simulated time to show, s."""
    names = client.names
    kind = EXTERNAL_TORQUE.load()
    pushes = node.create_publisher(kind, EXTERNAL_TORQUE.of(client.board_name), 10)

    def push(torque: float) -> None:
        pushes.publish(kind(names=[names[1]], torques=[torque]))

    moving = [names[0], names[1], names[3]]
    start = client.get_encoder(moving)
    yield 0.4
    client.position_move(moving, start + np.array([0.6, 0.5, 0.5]), math.radians(25.0))
    yield 2.2
    client.set_interaction_mode(names[1], "comp")
    push(60.0)
    yield 0.75
    push(0.0)
    yield 0.75
    client.set_interaction_mode(names[1], "stif")
    client.inject_fault(names[5], "external")
    yield 1.1
    client.recover()
    client.set_control_mode(None, "pos")
    client.position_move(moving, start, math.radians(25.0))
    client.position_move(names[5], 0.9, math.radians(25.0))
    yield 2.4


def record(page: Any, client: ControlBoardClient, node: Any) -> list[Image.Image]:
    """The frames."""
    frames: list[Image.Image] = []
    for length in scenes(client, node):
        for _ in range(round(length / STEP)):
            due = time.monotonic() + STEP * SLOWNESS
            picture = Image.open(io.BytesIO(page.screenshot()))
            frames.append(picture.convert("RGB").resize(SHOWN, Image.Resampling.LANCZOS))
            time.sleep(max(0.0, due - time.monotonic()))
    return frames


def write(frames: list[Image.Image], path: Path = PICTURE) -> int:
    """Write the picture with as many colours as MOST allows; its size, bytes."""
    several = Image.new("RGB", (SHOWN[0], SHOWN[1] * 4))
    for k in range(4):
        several.paste(frames[len(frames) * (2 * k + 1) // 8], (0, SHOWN[1] * k))
    for colours in COLOURS:
        # Colours that stand for little of the picture, as a fault's, are kept.
        palette = several.quantize(colours, method=Image.Quantize.MAXCOVERAGE)
        shown = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
        shown[0].save(
            path,
            save_all=True,
            append_images=shown[1:],
            duration=round(STEP * 1000),
            loop=0,
            optimize=False,
        )
        if path.stat().st_size <= MOST:
            break
    return path.stat().st_size


def main() -> None:
    """Record and write."""
    from playwright.sync_api import sync_playwright

    params = {"allow_fault_injection": True, "real_time_factor": 1.0 / SLOWNESS}
    with (
        board_process(params) as board,
        ros_node(board.domain, "picture", spin=False) as node,
        ControlBoardClient(node, board.name, find_timeout=60.0, answer_timeout=60.0) as client,
        panel(board.environment) as address,
        sync_playwright() as play,
    ):
        browser = chromium(play)
        page = browser.new_context(
            viewport={"width": PAGE[0], "height": PAGE[1]}, color_scheme="dark"
        ).new_page()
        page.set_default_timeout(60_000)
        page.goto(address)
        wait_until_shown(page)
        plot_positions(page, client.names[0], client.names[3])
        page.wait_for_timeout(4000)
        frames = record(page, client, node)
        browser.close()
    print(f"{PICTURE}: {len(frames)} frames, {write(frames) / 1e6:.2f} MB")


if __name__ == "__main__":
    main()

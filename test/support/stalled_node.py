# SPDX-License-Identifier: Apache-2.0
"""The node, with a hook in its control loop that hangs while a file is there."""

import sys
import time
from pathlib import Path

from control_board_ros.node.loop import loop
from control_board_ros.node.main import main


def install(file: Path) -> None:
    """Hang the control thread in each cycle for as long as the file exists."""

    def hang(_board: object, _time: float) -> None:
        while file.exists():
            time.sleep(0.01)

    begin = loop.ControlLoop.start

    def start(self: loop.ControlLoop) -> None:
        self.hooks.append(hang)
        begin(self)

    loop.ControlLoop.start = start  # type: ignore[method-assign]


if __name__ == "__main__":
    install(Path(sys.argv.pop(1)))
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""Boards with one rule broken each, to see that the conformance suite finds it.

``python wrong_boards.py NAME --ros-args …`` starts the node with that one thing changed, or with
several: ``NAME+NAME``. ``python wrong_boards.py --try`` takes lines ``NAME RULE…``, tries these
rules, or all, on that board in process, and answers with outcome and evidence by rule, as JSON.
Each function of the modules below breaks a board before the node is made; its decorator names what
must be found.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # also with Python's -P

import wrong_answers  # noqa: F401  (each registers its boards)
import wrong_modes  # noqa: F401
import wrong_motion  # noqa: F401
from breaking import WRONG

__all__ = ["WRONG", "main"]


def try_in_process() -> None:
    """Answer line by line; each board is broken in a fork, so that the next one is whole."""
    from board_in_process import tried

    for line in sys.stdin:
        name, *rules = line.split()
        if os.fork():
            if os.wait()[1]:
                print("{}", flush=True)
            continue
        wrong = WRONG[name]
        wrong.change()
        print(json.dumps(tried(rules, wrong.robot, **wrong.options)), flush=True)
        os._exit(0)


def main(arguments: list[str]) -> int:
    """Break the board of these names, joined by ``+``, and run the node."""
    if arguments == ["--try"]:
        try_in_process()
        return 0
    for name in arguments[0].split("+"):
        WRONG[name].change()
    from control_board_ros.node.main import main as run_node

    return run_node(arguments[1:])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

# SPDX-License-Identifier: Apache-2.0
"""Boards with one rule broken each, to see that the conformance suite finds it.

``python wrong_boards.py NAME --ros-args …`` starts the node with that one thing changed, or with
several: ``NAME+NAME``. ``python wrong_boards.py NAME --rules RULE…`` tries rules, or all, on the
board in process, and prints outcome and evidence by rule, as JSON. Each function of the modules
below breaks a board before the node is made; its decorator names what must be found.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # also with Python's -P

import wrong_answers  # noqa: F401  (each registers its boards)
import wrong_modes  # noqa: F401
import wrong_motion  # noqa: F401
from breaking import WRONG

__all__ = ["WRONG", "main"]


def main(arguments: list[str]) -> int:
    """Break the board of these names, joined by ``+``, and run the node."""
    for name in arguments[0].split("+"):
        WRONG[name].change()
    if arguments[1:2] == ["--rules"]:
        from board_in_process import tried  # what it imports is broken by now

        wrong = WRONG[arguments[0]]
        print(json.dumps(tried(arguments[2:], wrong.robot, **wrong.options)))
        return 0
    from control_board_ros.node.main import main as run_node

    return run_node(arguments[1:])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

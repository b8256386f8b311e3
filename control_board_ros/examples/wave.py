# SPDX-License-Identifier: Apache-2.0
"""Wave with one joint: the same program for a simulation in this process, and for a board on ROS.

python -m control_board_ros.examples.wave
python -m control_board_ros.examples.wave --board
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from ..client import BoardError, ControlBoardClient, connect
from ..simulation import Simulation

SWING, SPEED = 0.17, 1.0  # rad, rad/s


def wave(board: ControlBoardClient, joint: str, swings: int = 4) -> float:
    """Swing a joint; returns the time that it took, s of the board's clock.

    Raises:
        BoardError: a move is refused, or the board does not answer.
    """
    start, here = board.get_state().stamp, board.get_encoder(joint)[0]
    for k in range(swings):
        reply = board.move(joint, here + (0.0 if k % 2 else SWING), SPEED)
        if not reply:
            raise BoardError(reply.message)
    return board.get_state().stamp - start


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--board",
        nargs="?",
        const="control_board",
        help="on ROS, control_board or that name; without it: an iiwa in this process",
    )
    name = parser.parse_args(arguments).board
    try:
        if name:
            with connect(name) as board:
                taken = wave(board, board.names[-1])
        else:
            with Simulation.load("iiwa") as simulation, connect(simulation) as board:
                taken = wave(board, board.names[-1])
    except BoardError as error:
        sys.exit(str(error))
    print(f"waved for {taken:.2f} s")


if __name__ == "__main__":
    main()

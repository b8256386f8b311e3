# SPDX-License-Identifier: Apache-2.0
"""The Python client: the interfaces of SPEC A and D, over ROS.

::

    rclpy.init()
    node = rclpy.create_node("my_program")
    board = ControlBoardClient(node, "control_board")
    board.set_control_mode("l_elbow", "pos")
    board.position_move("l_elbow", 0.5)          # starts it; the reply is the board's
    board.move(["l_elbow", 2], [0.7, 0.1])       # waits for the end
    board.get_encoder()                          # numpy array, all joints

``await board.aio.move(…)`` is the awaitable form of each method, for asyncio and for coroutines
of an rclpy executor. A call works from any thread, with the node spinning or not, and from
within a callback: the client serves its own connection. A script without a node calls
``connect("control_board")``, which brings one; ``connect(simulation)`` is the client of a
``Simulation`` in the same process, without ROS.
"""

from .board import ControlBoardClient, connect
from .errors import BoardError, BoardNotFound, BoardTimeout, InvalidAnswer
from .goals import CalibrationFeedback, MoveFeedback
from .guidance import Guidance, guide
from .poses import PoseFeedback
from .state import State

__all__ = [
    "BoardError",
    "BoardNotFound",
    "BoardTimeout",
    "CalibrationFeedback",
    "ControlBoardClient",
    "Guidance",
    "InvalidAnswer",
    "MoveFeedback",
    "PoseFeedback",
    "State",
    "connect",
    "guide",
]

# SPDX-License-Identifier: Apache-2.0
"""cbctl foxglove."""

from __future__ import annotations

import threading
from importlib.util import find_spec
from pathlib import Path

from ..board.session import Session
from ..line.arguments import argument, takes
from ..line.words import Refused, UsageError
from ..text.output import DONE, note, put, put_json


def layout() -> Path:
    """Path of the installed layout."""
    from ament_index_python.packages import get_package_share_directory

    share = Path(get_package_share_directory("control_board_ros"))
    return share / "config/foxglove/control_board.json"


@takes(
    argument("--host", default="127.0.0.1", metavar="ADDRESS", help="To listen on."),
    argument(
        "--port", type=int, default=8765, metavar="PORT", help="To listen on; 0: a free one."
    ),
    argument("--read-only", action="store_true", help="Display only, without operation."),
)
def foxglove(session: Session, host: str, port: int, read_only: bool) -> int:
    """Serve the board to Foxglove: prints the address to open there; Ctrl-C ends it.

    It serves state, modes, faults, frames, parameters and services. A client that connects can
    operate the board: by default only this machine can connect (--host).
    """
    if not 0 <= port <= 65535:
        raise UsageError(f"--port {port} is not valid; give 0 to 65535")
    if find_spec("foxglove") is None:
        raise Refused(
            "foxglove needs the package foxglove-sdk; install the extra: "
            "pip install 'control_board_ros[foxglove]'"
        )
    from rclpy.node import Node

    from control_board_ros.foxglove.live import CannotServe, Live

    client = session.client
    asking = Node(
        "cbctl_foxglove",
        context=session.node.context,
        enable_rosout=False,
        start_parameter_services=False,
    )
    ended = threading.Event()
    try:
        client.list_parameters()  # the board is there
        live = Live(
            session.node,
            asking,
            client,
            host=host,
            port=port,
            read_only=read_only,
            answer_timeout=max(session.options.timeout, 1.0),
            report=lambda text: note(session, f"foxglove: {text}"),
        )
        if session.options.json:
            put_json({"success": True, "address": live.address, "read_only": read_only})
        else:
            put(f"{live.board} is served" + (", read-only:" if read_only else ":"))
            put(f"  {live.address}  (in Foxglove: Open connection, Foxglove WebSocket)")
            put(f"  {live.app}")
            put(f"Layout: {layout()}. Ctrl-C ends it.")
        live.run(ended)
    except CannotServe as error:
        raise Refused(str(error)) from None
    except KeyboardInterrupt:
        return DONE
    finally:
        ended.set()
        asking.destroy_node()
    return DONE

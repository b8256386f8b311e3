# SPDX-License-Identifier: Apache-2.0
"""cbctl panel and foxglove: servers for browsers and for Foxglove."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from ..board.session import Session
from ..line.arguments import Argument, amount, argument, with_arguments
from ..line.words import Refused, UsageError
from ..text.output import DONE, note, put, put_json

HOST = argument("--host", default="127.0.0.1", metavar="ADDRESS", help="To listen on.")
READ_ONLY = argument("--read-only", action="store_true", help="Display without operation.")


def port_argument(default: int) -> Argument:
    return argument(
        "--port", type=int, default=default, metavar="PORT", help="To listen on; 0: a free one."
    )


def check_server(port: int, extra: str, packages: Mapping[str, str]) -> None:
    """Check the port and the packages of an extra, names by module.

    Raises:
        UsageError: the port is invalid.
        Refused: a package is not installed.
    """
    if not 0 <= port <= 65535:
        raise UsageError(f"--port {port} is not valid; give 0 to 65535")
    for module, package in packages.items():
        if find_spec(module) is None:
            raise Refused(
                f"{extra} needs the package {package}; install the extra: "
                f"pip install 'control_board_ros[{extra}]'"
            )


@with_arguments(
    HOST,
    port_argument(8080),
    READ_ONLY,
    amount(
        "--takeover",
        "time",
        default="10s",
        metavar="TIME",
        help="Time for the operator to answer a request to take over; no answer means yes.",
    ),
    argument(
        "--recordings",
        default="recordings",
        metavar="FOLDER",
        help="For the recordings of the panel, each in a folder of its own.",
    ),
)
def panel(
    session: Session, host: str, port: int, read_only: bool, takeover: float, recordings: str
) -> int:
    """Serve the web panel for all boards of the domain: prints its address; Ctrl-C ends it.

    By default only this machine can connect; others can with --host 0.0.0.0 and the token.
    """
    packages = ("starlette", "uvicorn", "websockets")
    check_server(port, "panel", dict(zip(packages, packages, strict=True)))
    from control_board_ros.panel.app import run

    as_json = session.options.json

    def announce(addresses: list[str]) -> None:
        if as_json:
            put_json({"success": True, "addresses": addresses, "read_only": read_only})
            return
        put("The panel is open" + (", read-only:" if read_only else ":"))
        for address in addresses:
            put(f"  {address}")
        put("The address grants operation: keep it secret. Ctrl-C ends the panel.")

    with contextlib.suppress(KeyboardInterrupt):
        run(
            session.node,
            host,
            port,
            read_only=read_only,
            answer_timeout=session.options.timeout,
            takeover=takeover,
            recordings=Path(recordings),
            announce=announce,
            report=lambda text: note(session, f"panel: {text}"),
        )
    return DONE


@with_arguments(
    HOST,
    port_argument(8765),
    argument("--operate", action="store_true", help="Clients may command the board, too."),
    argument("--read-only", action="store_true", help="Clients only read; the default."),
    argument(
        "--origin",
        action="append",
        default=[],
        metavar="URL",
        help="A web page that may connect, beside Foxglove's own, e.g. http://localhost:8080; "
        "give it once for each.",
    ),
)
def foxglove(
    session: Session, host: str, port: int, operate: bool, read_only: bool, origin: list[str]
) -> int:
    """Serve the board to Foxglove: prints the address to open there; Ctrl-C ends it.

    It serves state, modes, faults, frames and parameters to read; with --operate every client that
    connects can command the board, too. By default only this machine can connect (--host), and of
    web pages only Foxglove's own (--origin).
    """
    if operate and read_only:
        raise UsageError("--operate and --read-only exclude each other; give one of them")
    check_server(port, "foxglove", {"foxglove": "foxglove-sdk"})
    from rclpy.node import Node

    from control_board_ros.foxglove.live import Live

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
            operate=operate,
            origins=origin,
            answer_timeout=max(session.options.timeout, 1.0),
            report=lambda text: note(session, f"foxglove: {text}"),
        )
        if session.options.json:
            put_json({"success": True, "address": live.address, "read_only": not operate})
        else:
            put(f"{live.board} is served" + (":" if operate else ", read-only (--operate):"))
            put(f"  {live.address}  (in Foxglove: Open connection, Foxglove WebSocket)")
            put(f"  {live.app}")
            put(f"Layout: {layout()}. Ctrl-C ends it.")
        live.run(ended)
    except KeyboardInterrupt:
        pass
    finally:
        ended.set()
        asking.destroy_node()
    return DONE


def layout() -> Path:
    from ament_index_python.packages import get_package_share_directory

    share = Path(get_package_share_directory("control_board_ros"))
    return share / "config/foxglove/control_board.json"

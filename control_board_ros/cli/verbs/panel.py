# SPDX-License-Identifier: Apache-2.0
"""cbctl panel."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from ..board.session import Session
from ..line.arguments import amount, argument, takes
from ..line.words import Refused, UsageError
from ..text.output import DONE, note, put, put_json

#: Packages of the extra.
NEEDED = ("starlette", "uvicorn", "websockets")


@takes(
    argument("--host", default="127.0.0.1", metavar="ADDRESS", help="To listen on."),
    argument(
        "--port", type=int, default=8080, metavar="PORT", help="To listen on; 0: a free one."
    ),
    argument("--read-only", action="store_true", help="Display only, without operation."),
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
    if not 0 <= port <= 65535:
        raise UsageError(f"--port {port} is not valid; give 0 to 65535")
    for name in NEEDED:
        if find_spec(name) is None:
            raise Refused(
                f"the panel needs the package {name}; install the extra: "
                "pip install 'control_board_ros[panel]'"
            )
    from control_board_ros.panel.app import CannotListen, run

    as_json = session.options.json

    def announce(addresses: list[str]) -> None:
        if as_json:
            put_json({"success": True, "addresses": addresses, "read_only": read_only})
            return
        put("The panel is open" + (", read-only:" if read_only else ":"))
        for address in addresses:
            put(f"  {address}")
        put("The address grants operation: keep it secret. Ctrl-C ends the panel.")

    try:
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
    except CannotListen as error:
        raise Refused(str(error)) from None
    except KeyboardInterrupt:
        return DONE
    return DONE

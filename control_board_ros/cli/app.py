# SPDX-License-Identifier: Apache-2.0
"""The command line itself: options, verbs, exit codes."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Sequence
from typing import Annotated, Any

import typer

from .. import __version__
from . import verbs
from .helping import Verbs, reflowed
from .options import PLAIN, Options, hoist, split_ros_arguments
from .output import DONE, REFUSED, USAGE, ReaderGone, fail, put, put_json
from .session import Session
from .words import Refused, UsageError

HELP = """Look at and move a control board.

JOINT is a name, an index from 0, the part of one name, or all. Angles are in rad, or take a
unit: 90deg, 1.57rad; sliding joints take m and mm. The options below may stand anywhere on the
line. Exit codes: 0 done, 1 refused or no board, 2 wrong usage.
"""

app = typer.Typer(
    name="cbctl",
    cls=Verbs,
    help=reflowed(HELP),
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def show_version(context: typer.Context, wanted: bool) -> None:
    """Print the version and leave, before a verb is asked for."""
    if not wanted:
        return
    if context.params.get("json"):
        put_json({"version": __version__})
    else:
        put(f"control_board_ros {__version__}")
    raise typer.Exit


@app.callback()
def options(
    context: typer.Context,
    board: Annotated[str, typer.Option(help="Name of the board's node.")] = "control_board",
    namespace: Annotated[str, typer.Option(help="Namespace of the board.")] = "",
    timeout: Annotated[
        float, typer.Option(help="Seconds to find the board, and to wait for each answer.")
    ] = 5.0,
    domain: Annotated[
        int | None, typer.Option(help="ROS domain; else that of ROS_DOMAIN_ID.")
    ] = None,
    json: Annotated[
        bool,
        typer.Option("--json", is_eager=True, help="Print JSON, and nothing else, on stdout."),
    ] = False,
    version: Annotated[  # noqa: ARG001 - show_version has seen it
        bool,
        typer.Option(
            "--version", callback=show_version, is_eager=True, help="Print the version, and leave."
        ),
    ] = False,
) -> None:
    session: Session = context.obj
    if session.shared:
        if (board, namespace, domain) != ("control_board", "", None):
            raise UsageError("the shell is connected; give --board and the like to cbctl shell")
        session.options.json = json
        return
    if not 0.0 < timeout <= 3600.0:
        raise UsageError(f"--timeout {timeout:g} is not valid; give seconds above 0, up to 3600")
    if domain is not None and not 0 <= domain <= 232:
        raise UsageError(f"--domain {domain} is not valid; ROS domains are 0 to 232")
    session.options = Options(
        board, namespace, timeout, domain, json, session.options.ros_arguments
    )


#: What a wrong line raises; its module has changed with the versions of typer.
LINE_ERROR: Any = typer.BadParameter.__base__

verbs.register(app)
command = typer.main.get_command(app)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command line; the exit code."""
    line, ros_arguments = split_ros_arguments(sys.argv[1:] if arguments is None else arguments)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, interrupt)  # as Ctrl-C: what runs is stopped first
    with Session(Options(ros_arguments=ros_arguments)) as session:
        return invoke(session, line)


def interrupt(*_: Any) -> None:
    """Handle a signal as Ctrl-C."""
    raise KeyboardInterrupt


def invoke(session: Session, words: Sequence[str]) -> int:
    """Run one verb in a session; the exit code."""
    as_json = any(word in PLAIN for word in words) or (session.shared and session.options.json)
    try:
        code = command.main(
            args=hoist(words) or ["--help"],
            prog_name="cbctl",
            standalone_mode=False,
            obj=session,
        )
    except ReaderGone:  # what is still buffered goes nowhere, quietly
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except (KeyboardInterrupt, typer.Abort):
        return fail("interrupted", REFUSED, as_json=as_json)
    except Exception as error:  # noqa: BLE001  (explain raises what it does not know)
        message, code = explain(error)
        return fail(message, code, as_json=as_json)
    if not words:
        return USAGE
    return code if isinstance(code, int) else DONE


def explain(error: Exception) -> tuple[str, int]:
    """One line, and the exit code; what nobody expects is raised again."""
    if isinstance(error, LINE_ERROR):
        return " ".join(error.format_message().split()), USAGE
    if isinstance(error, UsageError):
        return str(error), USAGE
    if isinstance(error, (Refused, *expected_errors())):
        return str(error), REFUSED
    raise error


def expected_errors() -> tuple[type[Exception], ...]:
    """What the client raises; asked for only when something was raised."""
    from control_board_ros.client import BoardError
    from control_board_ros.core.selection import RequestError

    return BoardError, RequestError

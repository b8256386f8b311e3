# SPDX-License-Identifier: Apache-2.0
"""Printing: results on stdout (with --json nothing else goes there), the rest on stderr."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from .words import DEGREE

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text

    from control_board_ros.core.reply import Reply

    from .session import Session

DONE, REFUSED, USAGE = 0, 1, 2

#: Columns of a table that goes into a file or a pipe.
PIPE_WIDTH = 160

#: A range that no joint has, rad or m: that of one without limits.
ENDLESS = 1e5

#: Colours of modes by code: green holds or moves, yellow drives, red needs somebody.
COLOURS = {
    "pos": "green",
    "posd": "green",
    "mix": "green",
    "vel": "cyan",
    "torq": "yellow",
    "open": "yellow",
    "idl": "bright_black",
    "hwfa": "bold red",
    "cal": "magenta",
    "cfgn": "bright_black",
    "stif": "blue",
    "comp": "yellow",
}


def console(*, stderr: bool = False, width: int | None = None) -> Console:
    """A rich console: colours only where somebody looks, width only where there is one."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    if width is None and not stream.isatty():
        width = PIPE_WIDTH
    return Console(stderr=stderr, highlight=False, width=width)


def load_drawing() -> None:
    """Load what draws tables, where there is time for it: while a board is being found."""
    import rich.console
    import rich.table  # noqa: F401


class ReaderGone(Exception):  # noqa: N818
    """Who reads our output has enough of it, as in ``cbctl watch --json | head -1``."""


def put(result: Any, *, width: int | None = None) -> None:
    """Print something on stdout: text as it stands, and what rich can render.

    Args:
        result: what to print.
        width: of the lines, characters; None: that of the terminal.

    Raises:
        ReaderGone: nobody reads any more.
    """
    end = "\n"
    if not isinstance(result, str):  # rich itself would end the program on a closed pipe
        screen = console(width=width)
        with screen.capture() as captured:
            screen.print(result)
        result, end = captured.get(), ""
    try:
        print(result, end=end, flush=True)
    except BrokenPipeError as error:
        raise ReaderGone from error


def put_json(value: Any) -> None:
    """Print one line of JSON on stdout."""
    put(json.dumps(plain(value), ensure_ascii=False))


def show(session: Session, value: Any, render: Callable[[], RenderableType | str]) -> None:
    """Print a result: as JSON for machines, else as ``render`` makes it."""
    if session.options.json:
        answer(session, value)
    else:
        put(render())


def answer(session: Session, value: Any) -> None:
    """Print a result as JSON, or keep it for those of other boards."""
    if session.answers is None:
        put_json(value)
    else:
        session.answers.append(value)


def plain(value: Any) -> Any:
    """A value that every JSON reader takes: NaN and infinity become null."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def note(session: Session, text: str) -> None:
    """Print a remark on stderr; none with --json."""
    if not session.options.json:
        console(stderr=True).print(addressed(session, text), markup=False, soft_wrap=True)


#: Where a message names the next step.
NEXT_STEP = re.compile(r"(?<=: )cbctl (?=[a-z])")

#: What the board says of its services, in the words of cbctl.
IN_CBCTL = {
    "call ~/pause with data: true first": "pause it first with: cbctl pause",
    "~/step ": "step ",
    "configure the board first (service configure)": "configure it first with: cbctl configure",
}


def in_cbctl(message: str) -> str:
    """A message of the board with the next step as one types it here."""
    for theirs, ours in IN_CBCTL.items():
        message = message.replace(theirs, ours)
    return message


def addressed(session: Session, text: str) -> str:
    """A text whose next step, ``…: cbctl VERB``, goes to the board that is meant."""
    address = session.options.address
    if not address or session.shared:  # in the shell, the board is known
        return text
    return NEXT_STEP.sub(f"cbctl {address} ", text)


def conclude(session: Session, reply: Reply, text: str = "", **more: Any) -> int:
    """Print what became of a request; the exit code."""
    message, text = addressed(session, in_cbctl(reply.message)), addressed(session, text)
    if session.options.json:
        joints = {n: str(a) for n, a in zip(reply.joints, reply.answers, strict=True)}
        answer(session, {"success": bool(reply), "message": message, "joints": joints} | more)
    elif not reply:
        complain(message)
    else:
        put(text or message or "done")
        if text and message:  # what will be done in place of what was asked for
            note(session, message)
    return DONE if reply else REFUSED


def fail(message: str, code: int, *, as_json: bool) -> int:
    """Print why a command ended; the exit code."""
    if as_json:
        put_json({"success": False, "message": message})
    else:
        complain(message)
    return code


def complain(message: str) -> None:
    """One line on stderr."""
    console(stderr=True).print(f"cbctl: {message}", style="red", markup=False, soft_wrap=True)
    sys.stderr.flush()


def mode_text(code: str, name: str = "") -> Text:
    """A mode in its colour."""
    from rich.text import Text

    return Text(name or code, style=COLOURS.get(code, ""))


def position_text(value: float, prismatic: bool) -> str:
    """A position for people."""
    if not math.isfinite(value):
        return "-"
    return f"{value * 1000:z.1f} mm" if prismatic else f"{value / DEGREE:z.1f}°"


def force_text(value: float, prismatic: bool, digits: int = 1) -> str:
    """A torque, or of a sliding joint a force, for people."""
    if not math.isfinite(value):
        return "-"
    return f"{value:z.{digits}f} {'N' if prismatic else 'N·m'}"


def bar(value: float, lower: float, upper: float, width: int = 12) -> str:
    """Where a value lies between its limits: ``├────●─────┤``; empty without limits."""
    if not 0.0 < upper - lower < ENDLESS:
        return ""
    share = min(max((value - lower) / (upper - lower), 0.0), 1.0)
    k = round(share * (width - 1)) if math.isfinite(share) else 0
    return f"├{'─' * k}●{'─' * (width - 1 - k)}┤"

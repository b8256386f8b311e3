# SPDX-License-Identifier: Apache-2.0
"""Printing: results on stdout (with --json nothing else), the rest on stderr."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from control_board_ros.core.terms.joint_kind import ENDLESS
from control_board_ros.text import clean_lines, json_line

from .advice import advice, in_groups

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType
    from rich.segment import Segment
    from rich.text import Text

    from control_board_ros.core.terms.reply import Reply

    from ..line.options import Options

DONE, REFUSED, USAGE = 0, 1, 2


class Asker(Protocol):
    """The part of a session that printing uses."""

    answers: list[Any] | None

    @property
    def options(self) -> Options: ...
    @property
    def names(self) -> Sequence[str]: ...
    def line(self, *words: str) -> str: ...
    def manager(self) -> str: ...


#: Columns of a table that goes into a file or a pipe.
PIPE_WIDTH = 160

#: Colours of modes by code: green holds or moves, yellow drives, red requires an action.
COLOURS = {
    "pos": "green",
    "posd": "green",
    "mix": "green",
    "vel": "cyan",
    "veld": "cyan",
    "torq": "yellow",
    "open": "yellow",
    "icur": "yellow",
    "idl": "bright_black",
    "hwfa": "bold red",
    "cal": "magenta",
    "cfgn": "bright_black",
    "stif": "blue",
    "comp": "yellow",
}


def console(*, stderr: bool = False, width: int | None = None) -> Console:
    """A rich console: colours and width for terminals only."""
    from rich.console import Console
    from rich.segment import Segment

    class CleanConsole(Console):
        """Removes control sequences of terminals from texts of other origin."""

        def render(
            self, renderable: RenderableType, options: ConsoleOptions | None = None
        ) -> Iterator[Segment]:
            for segment in super().render(renderable, options):
                text, style, control = segment
                if control or text == "\n" or text.isprintable():
                    yield segment
                else:
                    yield Segment(clean_lines(text), style)

    stream = sys.stderr if stderr else sys.stdout
    if width is None and not stream.isatty():
        width = PIPE_WIDTH
    return CleanConsole(stderr=stderr, highlight=False, width=width)


def load_drawing() -> None:
    """Load the modules that draw tables, during the discovery of a board."""
    import rich.console
    import rich.table  # noqa: F401


class ReaderGone(Exception):  # noqa: N818
    """The reader of the output has closed it, as in ``cbctl watch --json | head -1``."""


class OutputLost(Exception):  # noqa: N818
    """The output cannot be written, as in ``cbctl watch > file`` on a full disk."""


def put(result: Any, *, width: int | None = None) -> None:
    """Print something on stdout: unchanged text, or a rich renderable.

    Args:
        result: what to print.
        width: of the lines, characters; None: that of the terminal.

    Raises:
        ReaderGone: the reader has closed the output.
        OutputLost: it cannot be written.
    """
    end = "\n"
    try:
        if isinstance(result, str):
            result = clean_lines(result)
        else:  # rich itself would end the program on a closed pipe
            screen = console(width=width)
            with screen.capture() as captured:
                screen.print(result)
            result, end = captured.get(), ""
        print(result, end=end, flush=True)
    except BrokenPipeError as error:
        raise ReaderGone from error
    except OSError as error:
        raise OutputLost(error.strerror or str(error)) from error


def put_json(value: Any) -> None:
    put(json_line(plain(value)))


def show(session: Asker, value: Any, render: Callable[[], RenderableType | str]) -> None:
    """Print a result: as JSON for machines, else as ``render`` makes it."""
    if session.options.json:
        answer(session, value)
    else:
        put(render())


def answer(session: Asker, value: Any) -> None:
    """Print a result as JSON, or keep it until all boards have answered."""
    if session.answers is None:
        put_json(value)
    else:
        session.answers.append(value)


def plain(value: Any) -> Any:
    """A value in standard JSON: NaN and infinity become null."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def note(session: Asker, text: str) -> None:
    """Print a remark on stderr; none with --json."""
    if not session.options.json:
        console(stderr=True).print(text, markup=False, soft_wrap=True)


def conclude(
    session: Asker, reply: Reply, text: str = "", *, mode: str = "pos", **more: Any
) -> int:
    """Print the outcome of a request; returns the exit code.

    Args:
        session: with the board.
        reply: of the board.
        text: the result, where all was accepted.
        mode: control mode that the request requires.
        more: further fields of the JSON.
    """
    next_step = ""
    if any(reply.codes):
        next_step = advice(reply, session.names, session.line, session.manager, mode)
    message = "; ".join(filter(None, (in_groups(reply), next_step)))
    if session.options.json:
        joints = {n: str(a) for n, a in zip(reply.joints, reply.answers, strict=True)}
        answer(session, {"success": bool(reply), "message": message, "joints": joints} | more)
    elif not reply:
        complain(message)
    else:
        put(text or message or "done")
        if text and message:  # e.g. a bounded speed
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
    from rich.text import Text

    return Text(name or code, style=COLOURS.get(code, ""))


def bar(value: float, lower: float, upper: float, width: int = 12) -> str:
    """The position of a value between its limits: ``├────●─────┤``; empty without limits."""
    if not 0.0 < upper - lower < ENDLESS:
        return ""
    share = min(max((value - lower) / (upper - lower), 0.0), 1.0)
    k = round(share * (width - 1)) if math.isfinite(share) else 0
    return f"├{'─' * k}●{'─' * (width - 1 - k)}┤"

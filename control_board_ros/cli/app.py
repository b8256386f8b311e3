# SPDX-License-Identifier: Apache-2.0
"""The command line itself: options, the verb, the exit code."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from control_board_ros.text import nearest

from .. import __version__
from .board.boards import is_pattern, sessions_meant
from .board.session import Session
from .line.arguments import HELP, Parser, arguments_of
from .line.options import Options, hoist, read_options, split_ros_arguments
from .line.words import Refused, UsageError
from .text.output import (
    DONE,
    REFUSED,
    USAGE,
    OutputLost,
    ReaderGone,
    complain,
    fail,
    put,
    put_json,
)
from .verbs import MEANT, VERBS, find, load

#: Set by the completion scripts: cbctl prints the words to offer.
COMPLETE = "_CBCTL_COMPLETE"


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command line; the exit code."""
    if arguments is None and COMPLETE in os.environ:
        from .completion import complete

        return complete(os.environ)
    line, ros_arguments = split_ros_arguments(sys.argv[1:] if arguments is None else arguments)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, interrupt)  # as Ctrl-C: motion stops first
        if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # nohup
            screens = [stream for stream in (1, 2) if os.isatty(stream)]
            signal.signal(signal.SIGHUP, partial(hang_up, screens))
    with Session(Options(ros_arguments=ros_arguments)) as session:
        return invoke(session, line)


def interrupt(*_: Any) -> None:
    """Handle a signal as Ctrl-C."""
    raise KeyboardInterrupt


def hang_up(screens: Sequence[int], *_: Any) -> None:
    """The terminal was closed: as Ctrl-C, once, and what is printed goes nowhere."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    for stream in screens:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    raise KeyboardInterrupt


def invoke(session: Session, words: Sequence[str]) -> int:
    """Run one verb in a session; the exit code."""
    as_json = "--json" in words
    session.run_line = partial(invoke, session)
    try:
        return do(session, words)
    except ReaderGone:  # what is still buffered goes nowhere, quietly
        discard_output()
        return DONE
    except OutputLost as error:
        discard_output()
        complain(f"the output cannot be written: {error}; write it to another file or disk")
        return REFUSED
    except KeyboardInterrupt:
        return fail("interrupted", REFUSED, as_json=as_json)
    except Exception as error:  # noqa: BLE001  (explain raises other errors)
        message, code = explain(error)
        return fail(message, code, as_json=as_json)


def discard_output() -> None:
    """What is still buffered, and all that follows, goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def do(session: Session, words: Sequence[str]) -> int:
    """Read a line and run it; returns the exit code.

    Raises:
        UsageError: the line is invalid.
    """
    front, rest = hoist(words)
    options, version = read_options(front, session.options.ros_arguments)
    if version:
        put_version(as_json=options.json)
        return DONE
    if not rest or rest[0] in HELP:
        from .help import put_help

        put_help()
        return DONE if rest else USAGE
    name, *arguments = rest
    verb = find(name)
    if verb is None:
        what = "option" if name.startswith("-") else "verb"
        hint = nearest(MEANT.get(name, name), [*VERBS, *MEANT.values()])
        raise UsageError(f"{what} {name[:40]!r} unknown{hint}; see cbctl --help")
    if set(arguments) & set(HELP):
        from .help import put_verb_help

        put_verb_help(name, verb)
        return DONE
    if not session.shared:
        session.options = options
    elif set(front) - {"--json"}:
        raise UsageError("the shell is connected; give --board and the like to cbctl shell")
    else:
        session.options.json = options.json
    values = Parser(f"cbctl {name}", arguments_of(verb)).read(arguments)
    if is_pattern(session.options.board) and not hasattr(verb, "patterns"):
        if not hasattr(verb, "several"):
            raise UsageError(
                f"{name} is for one board, and --board {session.options.board} may be several; "
                f"name one, as in --board /icub/head. For several: {', '.join(for_several())}"
            )
        return on_each(session, verb, values)
    code = verb(session, **values)
    return DONE if code is None else code


def for_several() -> list[str]:
    """The verbs that accept a pattern of boards."""
    return [
        name for name in VERBS if hasattr(load(name), "several") or hasattr(load(name), "patterns")
    ]


def on_each(session: Session, verb: Callable[..., Any], values: dict[str, Any]) -> int:
    """Run a verb on each selected board: a table below each name, or JSON by board."""
    answers: dict[str, Any] = {}
    codes = [DONE]
    ahead = getattr(verb, "ahead", None)
    request = ahead and partial(ahead, **values)
    with sessions_meant(session, values.get("joints", ()), request) as sessions:
        for k, (board, each) in enumerate(sessions.items()):
            each.answers = []
            if not session.options.json:
                put(f"{board}" if k == 0 else f"\n{board}")
            try:
                codes.append(verb(each, **values) or DONE)
            except Exception as error:  # noqa: BLE001  (explain raises other errors)
                message, code = explain(error)
                each.answers = [{"success": False, "message": message}]
                codes.append(code)
                if not session.options.json:
                    complain(message)
            answers[board] = each.answers[-1] if each.answers else None
    if session.options.json:
        put_json(answers)
    return max(codes)


def put_version(*, as_json: bool) -> None:
    if as_json:
        put_json({"version": __version__})
    else:
        put(f"control_board_ros {__version__}")


def explain(error: Exception) -> tuple[str, int]:
    """One line, and the exit code; unexpected errors are raised again."""
    if isinstance(error, UsageError):
        return str(error), USAGE
    if isinstance(error, (Refused, *expected_errors())):
        return str(error), REFUSED
    raise error


#: Errors in one line for people, by the modules that define them.
EXPECTED = {
    "client.errors": ("BoardError",),
    "core.selection": ("RequestError",),
    "recording.errors": ("RecordingError",),
    "conformance.rules": ("NotTestable", "OutOfTime"),
    "identification.motions": ("NoRoomError",),
    "web_access": ("CannotListen",),
}


def expected_errors() -> tuple[type[Exception], ...]:
    """Those whose modules are loaded."""
    loaded = {f"control_board_ros.{module}": names for module, names in EXPECTED.items()}
    return tuple(
        getattr(sys.modules[module], name)
        for module, names in loaded.items()
        if module in sys.modules
        for name in names
    )

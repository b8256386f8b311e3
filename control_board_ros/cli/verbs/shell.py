# SPDX-License-Identifier: Apache-2.0
"""cbctl shell."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import typer

from control_board_ros.core.vocabs import ControlMode, InteractionMode

from ..output import DONE, USAGE, complain, note
from ..session import Session

LEAVE = ("exit", "quit")


def shell(context: typer.Context) -> int:
    """Type verbs one after the other over one connection; Ctrl-D ends it.

    Lines may come from a pipe; then the exit code is that of the last line that failed.
    """
    from ..app import invoke

    session: Session = context.obj
    names = session.names  # fails at once where there is no board
    session.shared = True
    lines = typed(session, context, names) if sys.stdin.isatty() else piped()
    try:
        return serve(lines, lambda words: invoke(session, words))
    finally:
        session.shared = False


def serve(lines: Iterable[str], do: Callable[[list[str]], int]) -> int:
    """Run the lines; the exit code of the last that failed."""
    code = DONE
    for line in lines:
        try:
            words = shlex.split(line, comments=True)
        except ValueError as error:
            complain(f"{error}; check the quotes")
            code = USAGE
            continue
        if not words:
            continue
        if words[0] in LEAVE:
            break
        if words[0] == "cbctl":
            words = words[1:]
        if words[:1] == ["shell"]:
            complain("this is the shell already")
            code = USAGE
            continue
        code = do(words) or code
    return code


def piped() -> Iterator[str]:
    """The lines of standard input."""
    yield from sys.stdin


def typed(session: Session, context: typer.Context, names: Iterable[str]) -> Iterator[str]:
    """Lines from a person, with history and completion."""
    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import NestedCompleter, WordCompleter
    from prompt_toolkit.history import FileHistory

    group: Any = context.parent.command if context.parent is not None else None
    codes = [mode.code for mode in (*ControlMode, *InteractionMode)]
    words = WordCompleter([*names, *(f"{name}=" for name in names), *codes, "all"])
    verbs = {verb: words for verb in group.commands if verb != "shell"}
    completer = NestedCompleter({**verbs, **dict.fromkeys(LEAVE)})
    prompt: Any = PromptSession(history=FileHistory(str(history())), completer=completer)
    note(session, f"connected to {session.client.board_name}; Ctrl-D ends, --help lists the verbs")
    while True:
        try:
            yield prompt.prompt("cbctl> ")
        except KeyboardInterrupt:
            continue
        except EOFError:
            return


def history() -> Path:
    """The file of typed lines; made where the desktop wants such files."""
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    folder = Path(state) / "cbctl"
    folder.mkdir(parents=True, exist_ok=True)
    return folder / "history"

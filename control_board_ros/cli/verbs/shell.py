# SPDX-License-Identifier: Apache-2.0
"""cbctl shell."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import typer

from ..offers import offers
from ..output import DONE, USAGE, complain, note
from ..session import Session

LEAVE = ("exit", "quit")
HELP = ("help", "?")


def shell(context: typer.Context) -> int:
    """Type verbs one after the other over one connection; help lists them, quit ends it.

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
        if words[:1] and words[0] in HELP:
            words = [*words[1:2], "--help"]
        if words[:1] == ["shell"]:
            complain("this is the shell already")
            code = USAGE
            continue
        code = do(words) or code
    return code


def piped() -> Iterator[str]:
    """The lines of standard input."""
    yield from sys.stdin


def typed(session: Session, context: typer.Context, names: Sequence[str]) -> Iterator[str]:
    """Lines from a person, with history and completion."""
    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import Completer, Completion
    from prompt_toolkit.history import FileHistory

    group: Any = context.parent.command if context.parent is not None else None
    verbs = [verb for verb in group.commands if verb != "shell"]

    class Offers(Completer):
        def get_completions(self, document: Any, _: Any) -> Iterator[Any]:
            incomplete = document.get_word_before_cursor(WORD=True)
            for word in line_offers(document.text_before_cursor, verbs, names):
                yield Completion(word, -len(incomplete))

    prompt: Any = PromptSession(history=FileHistory(str(history())), completer=Offers())
    note(session, f"connected to {session.client.board_name}; help lists the verbs, quit ends")
    while True:
        try:
            yield prompt.prompt("cbctl> ")
        except KeyboardInterrupt:
            continue
        except EOFError:
            return


def line_offers(line: str, verbs: Sequence[str], names: Sequence[str]) -> list[str]:
    """What may follow a line that is being typed: verbs, or what the verb takes."""
    words = [*line.split(" ")]
    before, incomplete = [word for word in words[:-1] if word], words[-1]
    if before[:1] == ["cbctl"]:
        before = before[1:]
    if not before or (before[0] in HELP and len(before) == 1):
        first = [*verbs, *HELP, *LEAVE] if not before else verbs
        return [verb for verb in first if verb.startswith(incomplete)]
    if before[0] not in verbs:
        return []
    return offers(before[0], before[1:], incomplete, names)


def history() -> Path:
    """The file of typed lines; made where the desktop wants such files."""
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    folder = Path(state) / "cbctl"
    folder.mkdir(parents=True, exist_ok=True)
    return folder / "history"

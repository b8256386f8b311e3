# SPDX-License-Identifier: Apache-2.0
"""cbctl shell and completion."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from control_board_ros.text import unknown_word

from ..board.session import Session
from ..line.arguments import argument, offered, with_arguments
from ..line.offers import one_of
from ..line.words import UsageError
from ..text.output import DONE, USAGE, complain, note, put
from . import VERBS, load

#: Words that end the shell, and that show the help of cbctl.
LEAVE = ("exit", "quit")
HELP = ("help", "?")

#: Script of each shell; it requests the words at the cursor from cbctl.
SCRIPTS = {
    "bash": """\
_cbctl() {
    local IFS=$'\\n'
    COMPREPLY=($(COMP_WORDS="${COMP_WORDS[*]}" COMP_CWORD=$COMP_CWORD _CBCTL_COMPLETE=bash "$1"))
    [[ ${#COMPREPLY[@]} == 1 && ${COMPREPLY[0]} == *[=.] ]] && compopt -o nospace
}
complete -o default -F _cbctl cbctl""",
    "zsh": """\
#compdef cbctl
_cbctl() {
    local -a found
    found=("${(@f)$(COMP_WORDS="${words[*]}" COMP_CWORD=$((CURRENT - 1)) \\
        _CBCTL_COMPLETE=zsh cbctl)}")
    compadd -S '' -- ${(M)found:#*[=.]}
    compadd -- ${found:#*[=.]}
}
compdef _cbctl cbctl""",
    "fish": """\
function __cbctl
    env _CBCTL_COMPLETE=fish COMP_WORDS=(commandline -cp | string collect) \\
        COMP_CWORD=(count (commandline -opc)) cbctl
end
complete -c cbctl -f -a '(__cbctl)'""",
}


def shell(session: Session) -> int:
    """Run verbs interactively over one connection; help lists them, quit ends it.

    Lines may come from a pipe; then the exit code is that of the last line that failed.
    """
    _ = session.names  # fails at once without a board
    session.shared = True
    lines = typed(session) if sys.stdin.isatty() else iter(sys.stdin)
    try:
        return serve(lines, session.run_line)
    finally:
        session.shared = False


def serve(lines: Iterable[str], run_line: Callable[[Sequence[str]], int]) -> int:
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
        code = run_line(words) or code
    return code


def typed(session: Session) -> Iterator[str]:
    """Lines typed in a terminal, with history and completion."""
    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import Completer, Completion
    from prompt_toolkit.history import FileHistory, InMemoryHistory

    class Offers(Completer):
        def get_completions(self, document: Any, _: Any) -> Iterator[Any]:
            incomplete = document.get_word_before_cursor(WORD=True)
            for word in line_offers(session, document.text_before_cursor):
                yield Completion(word, -len(incomplete))

    try:
        kept: Any = FileHistory(str(history()))
    except OSError as error:
        kept = InMemoryHistory()
        note(session, f"typed lines are not kept ({error.filename}: {error.strerror})")
    prompt: Any = PromptSession(history=kept, completer=Offers())
    note(session, f"connected to {session.client.board_name}; help lists the verbs, quit ends")
    while True:
        try:
            yield prompt.prompt("cbctl> ")
        except KeyboardInterrupt:
            continue
        except EOFError:
            return


def line_offers(session: Session, line: str) -> list[str]:
    """The words that may follow a line in the shell, up to the cursor."""
    *before, incomplete = line.split(" ")
    before = [word for word in before if word]
    if before[:1] == ["cbctl"]:
        before = before[1:]
    known = [verb for verb in VERBS if verb != "shell"]
    if not before:
        return [word for word in (*known, *HELP, *LEAVE) if word.startswith(incomplete)]
    if before[0] in HELP and len(before) == 1:
        return [verb for verb in known if verb.startswith(incomplete)]
    if before[0] not in known:
        return []
    return offered(load(before[0]), session.typed(before[1:], incomplete))


def history() -> Path:
    """The file of typed lines, created in the user's state folder (XDG).

    Raises:
        OSError: it cannot be written.
    """
    state = os.environ.get("XDG_STATE_HOME") or os.path.expanduser("~/.local/state")
    folder = Path(state) / "cbctl"
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "history"
    file.open("a").close()
    return file


@with_arguments(
    argument(
        "shell",
        nargs="?",
        default="bash",
        metavar="SHELL",
        help=f"{', '.join(SCRIPTS)}.",
        offers=one_of(tuple(SCRIPTS)),
    )
)
def completion(_: Session, shell: str) -> None:
    """Print the completion script of a shell: source <(cbctl completion bash)."""
    if shell not in SCRIPTS:
        raise UsageError(unknown_word("shell", shell, SCRIPTS))
    put(SCRIPTS[shell])
